"""Compiled modules against plain Python, bit for bit: every bag, every robot, random joint positions and streams.

    ./irsbot python tests/campaigns/compiled.py [--samples 1000000] [--seed 0] [--robots irsbot2 ruu4] [--parts bags]

Each form judges in a process of its own and tells a digest per piece of work; pieces whose digests differ are named.
The exit code is 1 then, and 2 if there are no compiled modules of these sources.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import random
import struct
import subprocess
import sys
from collections.abc import Iterator
from itertools import zip_longest
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import Progress, SpinnerColumn, TimeElapsedColumn

ROOT = Path(__file__).resolve().parents[2]
BAGS = ROOT / "bags"
PIECE = 500
"""Samples of one digest."""
SHARP_EVERY = 25
"""Bounds of second order take a millisecond; of one posture in so many they are compared."""


def bits(value: Any) -> bytes:
    """Floats with every bit, numbers with names as numbers, all else as it is written; a NaN is as good as another."""
    if isinstance(value, float):
        return b"nan" if value != value else struct.pack("<d", value)
    if isinstance(value, (tuple, list)):
        return b"(" + b",".join(map(bits, value)) + b")"
    return repr(int(value) if isinstance(value, int) else value).encode()


def judged_bags() -> Iterator[tuple[str, bytes]]:
    """What is said about every input of every bag."""
    from irsbot_supervisor.core.supervisor import Supervisor
    from irsbot_supervisor.replay import stepping
    from irsbot_supervisor.replay.recording import read_recording
    from irsbot_supervisor.replay.rejudge import judge_again

    stated = hashlib.sha256()

    class Heard:
        """A supervisor whose every answer is noted."""

        def __init__(self, settings: Any, robot: Any) -> None:
            self._heard = Supervisor(settings, robot)

        def __getattr__(self, name: str) -> Any:
            return getattr(self._heard, name)

        def step(self, event: Any, report: bool = True) -> Any:
            step = self._heard.step(event)
            stated.update(bits(step))
            return step

    setattr(stepping, "Supervisor", Heard)  # noqa: B010 - the type checker knows another class
    for bag in sorted(path.parent for path in BAGS.glob("*/metadata.yaml")):
        stated = hashlib.sha256()
        judged = judge_again(read_recording(bag), watch=lambda *_: None)  # every sample by a step
        stated.update(bits(judged.intervals))
        yield f"bag {bag.name}", stated.digest()


def postures(samples: int, seed: int, robots: list[str]) -> Iterator[tuple[str, bytes]]:
    """Every function of every mechanism at random joint positions, some of them beyond what assembles."""
    from irsbot_kinematics import Posture, make_robot, statics
    from irsbot_kinematics.numerics.arithmetic import FLOATS

    for name in robots:
        robot, draw = make_robot(name), random.Random(f"{name} {seed}")
        mechanism = robot.mechanism
        mechanism.prepare()
        turning = len(mechanism.task) > 2 and mechanism.task[-1].is_angle
        for piece in range(0, samples, PIECE):
            stated = hashlib.sha256()
            near: Posture | None = None
            for number in range(min(PIECE, samples - piece)):
                joints = tuple(_drawn(draw, joint, mechanism.length_m) for joint in mechanism.joints)
                label = draw.choice(mechanism.assembly_modes)
                slack = draw.choice((0.0, 1e-4))
                travel = tuple(draw.random() ** 4 for _ in joints)
                rates = tuple(draw.gauss(0.0, 3.0) for _ in joints)
                fresh = (
                    near is None or number % 5 == 0 or mechanism.label_is_invariant
                )  # all assemblies take milliseconds
                at = mechanism.posture(joints, label) if fresh or near is None else near
                stated.update(bits(at))
                near = None
                if at.status != 0:
                    continue
                after = mechanism.track(tuple(q + 1e-3 * r for q, r in zip(at.joints, rates, strict=True)), at)
                stated.update(bits((after, mechanism.certified_bounds(at, travel, slack), mechanism.clearance(at))))
                stated.update(bits(statics.reaction_max(FLOATS, at.screws, 10.0, 1.0, turns=turning)))
                mode = draw.choice(mechanism.working_modes)
                stated.update(bits(mechanism.inverse(FLOATS, at.pose, mode)))
                if at.det:
                    pose_rates = statics.twist(at.screws, rates)
                    stated.update(bits((pose_rates, mechanism.bias(at, rates, pose_rates))))
                if number % SHARP_EVERY == 0:
                    stated.update(bits(mechanism.sharp_bounds(at, tuple(0.1 * t for t in travel), slack)))
                near = after if after.status == 0 else None
            yield f"{name}, postures from {piece}", stated.digest()


def _drawn(draw: random.Random, joint: Any, length_m: float) -> float:
    if joint.is_angle:
        return draw.uniform(-4.0, 4.0)
    low, high = max(joint.lower, -2.0 * length_m), min(joint.upper, 2.0 * length_m)
    return draw.uniform(low, high)


def streams(samples: int, seed: int, robots: list[str]) -> Iterator[tuple[str, bytes]]:
    """Whole steps over a motion of every robot that is disturbed: late, lost, noisy, wrong, not finite."""
    from irsbot_supervisor.core.supervisor import Supervisor
    from irsbot_supervisor.sim.scenario_file import scenario_robots
    from irsbot_supervisor.validation.bench.motion import SCENARIO, recorded

    for name in [name for name in scenario_robots(SCENARIO) if name in robots]:
        draw = random.Random(f"{name} {seed}")
        settings, robot, motion = recorded(name, min(samples, 20_000))
        for piece in range(-(-samples // len(motion))):
            stated, late_ns = hashlib.sha256(), 0
            supervisor = Supervisor(settings, robot)
            for sample in motion:
                chance = draw.random()
                if chance < 0.004:
                    continue  # lost
                late_ns = draw.randrange(30_000_000) if chance < 0.008 else round(0.9 * late_ns)
                position = list(sample.position)
                if chance > 0.9995:
                    position[0] = draw.choice((float("nan"), position[0] + draw.gauss(0.0, 0.1), position[0]))
                if chance > 0.998:
                    position = [q + draw.gauss(0.0, 1e-4) for q in position]
                velocity = () if 0.997 < chance < 0.9975 else sample.velocity
                times = sample.stamp_ns, sample.received_ns + late_ns, sample.seen_ns + late_ns
                stated.update(bits(supervisor.step(type(sample)(*times, sample.names, tuple(position), velocity))))
            yield f"{name}, stream {piece}", stated.digest()


def work(samples: int, seed: int, robots: list[str], parts: list[str]) -> None:
    """Say all digests: what one of the two processes does."""
    from irsbot_kinematics import compiled

    print(f"compiled {compiled.are_used()}", flush=True)
    each = -(-samples // len(robots))
    pieces = {
        "bags": judged_bags,
        "postures": lambda: postures(each, seed, robots),
        "streams": lambda: streams(each, seed, robots),
    }
    for part in parts:
        for name, digest in pieces[part]():
            print(f"{name}: {digest.hex()[:24]}", flush=True)


def compare(arguments: list[str]) -> int:
    """Both forms side by side."""
    command = [sys.executable, __file__, "--work", *arguments]
    forms = [
        subprocess.Popen(command, env={**os.environ, "IRSBOT_PLAIN": switch}, stdout=subprocess.PIPE, text=True)
        for switch in ("", "1")
    ]
    pieces, different = 0, 0
    columns = SpinnerColumn(), "{task.completed} pieces compared,", TimeElapsedColumn(), "{task.description}"
    with Progress(*columns, console=Console(stderr=True)) as progress:
        task = progress.add_task("", total=None)
        for compiled, plain in zip_longest(*map(_lines, forms)):  # in turn, so that neither form runs far ahead
            if not pieces and (compiled, plain) != ("compiled True", "compiled False"):
                hint = "there are no compiled modules of these sources: ./irsbot setup makes them"
                both = "IRSBOT_PLAIN=1 does not switch the compiled modules off: there is nothing to compare with"
                print(both if compiled == plain == "compiled True" else hint, file=sys.stderr)
                for process in forms:
                    process.kill()
                    process.communicate()
                return 2
            if pieces and compiled != plain:
                different += 1
                print(f"different: {compiled} against {plain}")
            progress.update(task, completed=pieces, description=plain or compiled or "")
            pieces += 1
    failed = [process.wait() for process in forms] != [0, 0]
    compared = pieces - 1  # the first line of a form says whether it is compiled
    print(f"{compared} pieces of work compared, {different} differ" + (", and one failed" if failed else ""))
    return 1 if different or failed or compared < 1 else 0


def _lines(process: subprocess.Popen[str]) -> Iterator[str]:
    """What a form says, line by line."""
    assert process.stdout is not None
    return (line.rstrip("\n") for line in process.stdout)


def main() -> int:
    """The command line."""
    from irsbot_kinematics import robots

    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--samples", type=int, default=20_000, help="random postures, and samples of streams, in all")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--robots", nargs="+", default=list(robots()))
    parser.add_argument("--parts", nargs="+", default=["bags", "postures", "streams"])
    parser.add_argument("--work", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if not given.work:
        return compare(sys.argv[1:])
    work(given.samples, given.seed, given.robots, given.parts)
    return 0


if __name__ == "__main__":
    sys.exit(main())
