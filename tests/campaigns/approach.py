"""Runs at singularities in a closed loop, and clean motion: the robot stands before any stop margin is crossed, and
is not stopped where nothing is near.

    python tests/campaigns/approach.py --ramps 10000 --clean 1000000

A ramp moves all joints at constant rates, 10 to 100 % of their limits, from a random good posture at a stop limit.
The supervisor sees one sample per period, each a little late; when its verdict says stop, every joint goes on for the
latency and then brakes with its own deceleration. Afterwards the margins are evaluated along the whole way. Exit
code 1 if a margin fell below its stop limit, or if clean motion was stopped.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import track
from rich.table import Table

SOURCES = Path(__file__).parents[2] / "ros2_ws/src"
sys.path[:0] = [str(SOURCES / name) for name in ("irsbot_kinematics", "irsbot_msgs_py", "irsbot_supervisor")]

import irsbot_kinematics as irs  # noqa: E402
from irsbot_kinematics import Status  # noqa: E402
from irsbot_msgs_py.records import JointSample, Level  # noqa: E402
from irsbot_supervisor.core.outlook import limits_of  # noqa: E402
from irsbot_supervisor.core.pipeline import Supervisor  # noqa: E402
from irsbot_supervisor.core.settings import Settings  # noqa: E402
from irsbot_supervisor.settings_file import read_settings  # noqa: E402
from irsbot_supervisor.sim.trajectory import JointLimits, swing  # noqa: E402

Array = NDArray[np.float64]

PRESETS = tuple(name for name in irs.robots() if name.startswith("irsbot2"))
NS = 1_000_000_000
BEGIN_NS = 10**15
PERIOD_S = 0.001
SEARCH_S = 3.0
"""s: how long a ramp is followed in search of a stop limit."""
SEARCH_STEPS = 600
RUN_UP_S = 0.05
"""s: at most so long before the last moment for a stop, as the outlook sees it, a run begins."""
FINE_STEPS = 500
"""Points on the way of a run at which its margins are evaluated: some 0.5 ms apart."""
ROUNDING = 1e-9
"""1: a margin that is below its limit by less than this has not crossed it."""
HEADROOM = 1.5
"""1: clean motion and OVERSHOOT_S beyond it keep this many times the warning limits."""
OVERSHOOT_S = 0.06
"""s at full speed: latency, two periods, and half of the 30 ms that braking takes."""


class Ramp(NamedTuple):
    """Joints at constant rates; a stop limit is crossed if nobody stops them."""

    start: Array  # rad
    rates: Array  # rad/s
    latency_s: float
    age_s: float  # of every sample on arrival
    phase_s: float  # of the first sample

    def at(self, times: Array, brake_s: float, brakes: Array) -> Array:
        """(N, n) joint positions when the joints brake from `brake_s` on."""
        braking = np.minimum(np.maximum(times - brake_s, 0.0)[:, None], np.abs(self.rates) / brakes)
        going = np.minimum(times, brake_s)[:, None]
        way = self.rates * (going + braking) - 0.5 * np.sign(self.rates) * brakes * braking**2
        return np.asarray(self.start + way)


class Result(NamedTuple):
    """What became of the ramps of one robot."""

    robot: str
    ramps: int
    stopped: int
    crossed: int
    """Runs in which a margin fell below its stop limit."""
    least_spare: float
    """Smallest margin above its stop limit that any run met."""
    median_spare: float


class Clean(NamedTuple):
    """What became of motion that is free of singularities."""

    robot: str
    samples: int
    false_stops: int
    warnings: int


def margins_along(robot: irs.Robot, Q: Array) -> Array:
    """(N, 4) smallest margins of each kind of postures (N, n): 0 where not assembled, infinite where there is none."""
    found = robot.evaluate_many(Q)
    solved = (found.status == Status.SOLVED)[:, None]
    limb = found.limb_margin.min(axis=1) if found.limb_margin.shape[1] else np.full(len(Q), np.inf)
    constraint = np.where(np.isnan(found.constraint_margin), np.inf, found.constraint_margin)
    columns = np.column_stack((found.type1_margin.min(axis=1), found.type2_margin, constraint, limb))
    return np.where(solved, columns, 0.0)


def random_postures(robot: irs.Robot, settings: Settings, number: int, rng: np.random.Generator) -> Array:
    """Joint positions over the whole range, in the usual mode, with margins well above the warning limits."""
    Q = np.empty((0, len(robot.mechanism.joints)))
    while len(Q) < number:
        tried = rng.uniform(-np.pi, np.pi, (20 * number, Q.shape[1]))
        good = (margins_along(robot, tried) >= HEADROOM * np.array(limits_of(settings, "warn"))).all(axis=1)
        usual = (robot.evaluate_many(tried).working_mode == settings.working_mode).all(axis=1)
        Q = np.concatenate((Q, tried[good & usual]))
    return Q[:number]


def random_ramps(robot: irs.Robot, settings: Settings, number: int, rng: np.random.Generator) -> list[Ramp]:
    """Ramps that meet a stop limit, and begin in time for the supervisor to see them come."""
    limits, brakes = np.array(settings.velocity_limit), np.array(settings.deceleration_limit)
    stop = np.array(limits_of(settings, "stop"))
    times = np.linspace(0.0, SEARCH_S, SEARCH_STEPS)
    ramps: list[Ramp] = []
    while len(ramps) < number:
        for start in random_postures(robot, settings, 100, rng):
            share = rng.uniform(-1.0, 1.0, len(limits))
            rates = limits * share / np.abs(share).max() * rng.uniform(0.1, 1.0)
            crossed = (margins_along(robot, start + times[:, None] * rates) < stop).any(axis=1)
            latency_s, age_s = rng.uniform(0.0, 0.05), rng.choice([0.0, 0.0005, 0.003])
            needed_s = latency_s + age_s + PERIOD_S + (np.abs(rates) / brakes).max()
            begin_s = times[np.argmax(crossed)] - needed_s - rng.uniform(0.0, RUN_UP_S)
            if crossed.any() and begin_s > 0.0:
                ramps.append(Ramp(start + rates * begin_s, rates, latency_s, age_s, rng.uniform(0.0, PERIOD_S)))
    return ramps[:number]


def stop_time(ramp: Ramp, settings: Settings, robot: irs.Robot) -> float | None:
    """When a verdict that means stop is heard, s; None if there is none. Encoders count in their steps."""
    supervisor = Supervisor(settings, robot)
    names, rates, step = settings.joint_names, tuple(ramp.rates.tolist()), settings.encoder_resolution
    for k in range(round(SEARCH_S / PERIOD_S)):
        stamp_s = ramp.phase_s + k * PERIOD_S
        position = np.round((ramp.start + ramp.rates * stamp_s) / step) * step
        stamp_ns, seen_ns = round(stamp_s * NS), round((stamp_s + ramp.age_s) * NS)
        sample = JointSample(
            BEGIN_NS + stamp_ns, BEGIN_NS + seen_ns, NS + seen_ns, names, tuple(position.tolist()), rates
        )
        verdict = supervisor.step(sample).verdict
        if verdict is not None and verdict.level >= Level.STOP:
            return stamp_s + ramp.age_s
    return None


def run_ramps(name: str, number: int, rng: np.random.Generator) -> Result:
    """Random ramps of one robot, closed loop, then evaluated along their whole way."""
    settings, robot = read_settings(name)
    settings = replace(settings, dwell_s=0.0)  # a run begins in motion: what holds at first is not to outlast it
    brakes, stop = np.array(settings.deceleration_limit), np.array(limits_of(settings, "stop"))
    spare, stopped = [], 0
    for ramp in track(random_ramps(robot, settings, number, rng), f"ramps of {name}", console=Console(stderr=True)):
        seen_s = stop_time(ramp, replace(settings, latency_s=ramp.latency_s), robot)
        stopped += seen_s is not None
        brake_s = SEARCH_S if seen_s is None else seen_s + ramp.latency_s
        times = np.linspace(0.0, brake_s + (np.abs(ramp.rates) / brakes).max(), FINE_STEPS)
        spare.append((margins_along(robot, ramp.at(times, brake_s, brakes)) - stop).min())
    crossed = sum(value < -ROUNDING for value in spare)
    return Result(name, number, stopped, crossed, float(np.min(spare)), float(np.median(spare)))


def clean_motion(robot: irs.Robot, settings: Settings, rng: np.random.Generator) -> Iterator[tuple[Array, Array]]:
    """Swings at full speed between random postures, straight in joint space and free of singularities, also where the
    joints would get if they went on at full speed for a while at any moment. Positions and rates, period by period."""
    limits = JointLimits(settings.velocity_limit, settings.deceleration_limit, settings.deceleration_limit)
    enough = HEADROOM * np.array(limits_of(settings, "warn"))
    overshoot = OVERSHOOT_S * np.array(settings.velocity_limit)
    here = random_postures(robot, settings, 1, rng)[0]
    while True:
        for there in random_postures(robot, settings, 50, rng):
            beyond = overshoot * np.sign(there - here)
            way = np.linspace(here - beyond, there + beyond, 200)
            if (margins_along(robot, way) >= enough).all():
                motion = swing(tuple(here.tolist()), tuple(there.tolist()), limits)
                for t in np.arange(0.0, motion.duration_s + 0.02, PERIOD_S):
                    point = motion.at(float(t))
                    yield np.array(point.position), np.array(point.velocity)
                here = there


def run_clean(name: str, number: int, rng: np.random.Generator) -> Clean:
    """Samples of clean motion, and how many of them led to a stop or were called unknown."""
    settings, robot = read_settings(name)
    supervisor = Supervisor(replace(settings, dwell_s=0.0), robot)
    step = settings.encoder_resolution
    stops = warnings = 0
    motion = clean_motion(robot, settings, rng)
    for k in track(range(number), f"clean motion of {name}", console=Console(stderr=True)):
        position, velocity = next(motion)
        measured = tuple((np.round(position / step) * step).tolist())
        times = BEGIN_NS + k * 1_000_000, BEGIN_NS + k * 1_000_000, NS + k * 1_000_000
        state = supervisor.step(JointSample(*times, settings.joint_names, measured, tuple(velocity.tolist()))).state
        stops += state is None or state.level >= Level.STOP
        warnings += state is not None and state.level == Level.WARN
    return Clean(name, number, stops, warnings)


def report(ramps: Sequence[Result], clean: Sequence[Clean]) -> None:
    table = Table("robot", "ramps", "stopped", "crossed", "least spare", "median spare", title="runs at a stop limit")
    for one in ramps:
        spare = f"{one.least_spare:.2e}", f"{one.median_spare:.4f}"
        table.add_row(one.robot, str(one.ramps), str(one.stopped), str(one.crossed), *spare)
    Console().print(table)
    table = Table("robot", "samples", "false stops", "warnings", title="clean motion")
    for other in clean:
        table.add_row(other.robot, str(other.samples), str(other.false_stops), str(other.warnings))
    Console().print(table)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--ramps", type=int, default=1000, help="runs at a stop limit, over all robots")
    parser.add_argument("--clean", type=int, default=100_000, help="samples of clean motion, over all robots")
    parser.add_argument("--robots", nargs="+", default=list(PRESETS), choices=irs.robots())
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args()
    seeds = [np.random.default_rng([given.seed, k]) for k in range(len(given.robots))]
    share = len(given.robots)
    ramps = [run_ramps(name, -(-given.ramps // share), rng) for name, rng in zip(given.robots, seeds, strict=True)]
    clean = [run_clean(name, -(-given.clean // share), rng) for name, rng in zip(given.robots, seeds, strict=True)]
    if given.json:
        print(json.dumps({"ramps": [one._asdict() for one in ramps], "clean": [one._asdict() for one in clean]}))
    else:
        report(ramps, clean)
    good = all(one.crossed == 0 and one.stopped == one.ramps for one in ramps)
    return 0 if good and not any(one.false_stops for one in clean) else 1


if __name__ == "__main__":
    sys.exit(main())
