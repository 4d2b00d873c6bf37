"""The whole suite at work for a long time: memory and descriptors of every node stay where they are."""

from __future__ import annotations

import os
import time
from collections import Counter
from collections.abc import Mapping
from contextlib import suppress
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np
import psutil  # type: ignore[import-untyped]

from irsbot_msgs_py.records import Level
from irsbot_supervisor.campaign.rows import FALSE_STOPS, Job, Row, Tally
from irsbot_supervisor.suite import JOINTS, KINEMATICS, RECORDER, SUPERVISOR, Node, Suite, free_domain

NAME = "soak"
MUST = "memory and descriptors of every node stay flat at 1 kHz"

WARM_UP_S = 10.0
"""s until counting begins: buffers and histories fill up."""

GROWTH_MB = 2.0
"""MB a node may have grown at the end: what a heap does by itself."""

NODES = (
    Node("kinematics", KINEMATICS, {}),
    Node("supervisor", SUPERVISOR, {}),
    Node("simulated_joints", JOINTS, {"scenario": "pick_and_place"}),
)


class Use(NamedTuple):
    """What a node holds at one moment."""

    resident_mb: float
    descriptors: Counter[str]
    """What the open descriptors refer to: files, sockets, pipes."""


def run(job: Job) -> Row:
    """The row: a case is a second of work."""
    tally = Tally(NAME, job)
    with TemporaryDirectory(prefix="irsbot-soak-") as folder:
        uses = _work(job.amount, tally, Path(folder))
    for name, series in uses.items():
        fault = _judge(tally, name, series)
        tally.many(0, failed=bool(fault), note=fault)
    return tally.row()


def _work(seconds: int, tally: Tally, folder: Path) -> Mapping[str, list[Use]]:
    """Once a second what every node holds."""
    from irsbot_msgs.srv import EvaluateJoints  # needs ROS, which the list of rows does not

    from irsbot_supervisor.campaign.peer import Peer

    request = EvaluateJoints.Request(joints=[2.544, -0.19])
    domain = free_domain()
    with Suite(folder / "logs", domain) as suite, Peer(suite, domain) as peer:
        suite.start(Node("recorder", RECORDER, {"output": str(folder / "bag")}))
        for node in NODES:
            suite.start(node)
        peer.listen()
        peer.until(lambda: peer.verdicts and peer.verdicts[-1].level < Level.STOP, "the robot at work")
        evaluate = peer.client(EvaluateJoints, "kinematics/evaluate")
        warm_s = time.monotonic() + min(WARM_UP_S, 0.5 * seconds)
        while time.monotonic() < warm_s:
            peer.ask(evaluate, request)
        uses: dict[str, list[Use]] = {name: [] for name in suite.processes}
        processes = {name: psutil.Process(process.pid) for name, process in suite.processes.items()}
        begin, before = time.monotonic(), Level.OK
        for second in range(seconds):
            peer.ask(evaluate, request)
            peer.look(max(begin + second + 1.0 - time.monotonic(), 0.0))
            suite.check()
            levels = [before, *(verdict.level for verdict in peer.verdicts)]
            before = levels[-1]
            tally.add(FALSE_STOPS, sum(a < Level.STOP <= b for a, b in pairwise(levels)))
            stopped = next((f"stopped, and no longer at work: {one.text}" for one in peer.verdicts if one.latched), "")
            tally.case(failed=stopped)
            peer.verdicts.clear()
            for name, process in processes.items():
                uses[name].append(Use(process.memory_info().rss * 1e-6, _descriptors(process.pid)))
        return uses


def _descriptors(pid: int) -> Counter[str]:
    found: Counter[str] = Counter()
    for descriptor in Path(f"/proc/{pid}/fd").iterdir():
        with suppress(FileNotFoundError):  # closed since it was listed
            found[os.readlink(descriptor)] += 1
    return found


def _judge(tally: Tally, name: str, series: list[Use]) -> str:
    """Figures of one node; what is wrong with it, if anything."""
    memory = np.array([use.resident_mb for use in series])
    tenth = max(len(memory) // 10, 1)
    start, end = float(np.median(memory[:tenth])), float(np.median(memory[-tenth:]))
    slope = float(np.polyfit(np.arange(len(memory)), memory, 1)[0]) * 3600.0 if len(memory) > 1 else 0.0
    first, last = (_usual(series[:tenth]), _usual(series[-tenth:]))
    tally.figures |= {
        f"{name} at the start [MB]": start,
        f"{name} at the end [MB]": end,
        f"{name} slope [MB/h]": slope,
        f"{name} descriptors at the start": first.total(),
        f"{name} descriptors at the end": last.total(),
    }
    if not end - start <= GROWTH_MB:
        return f"{name} grew from {start:.1f} to {end:.1f} MB"
    if last.total() > first.total():
        return f"{name} holds {last.total()} descriptors, {first.total()} at the start; new: {', '.join(last - first)}"
    return ""


def _usual(series: list[Use]) -> Counter[str]:
    """The descriptors of the moment with the median number of them."""
    return sorted((use.descriptors for use in series), key=Counter.total)[len(series) // 2]
