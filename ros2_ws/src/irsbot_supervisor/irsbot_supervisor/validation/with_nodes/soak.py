"""The whole suite at work for a long time: memory and descriptors of every node stay constant."""

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
import psutil

from irsbot_msgs_py.records import Level
from irsbot_supervisor.processes.suite import JOINTS, KINEMATICS, RECORDER, SUPERVISOR, Node, Suite, free_domain
from irsbot_supervisor.validation.harness.rows import FALSE_STOPS, Job, Row, Tally

NAME = "soak"
MUST = "memory and descriptors of every node stay flat at 1 kHz"

WARM_UP_S = 10.0
"""s until counting begins: buffers and histories fill up."""

GROWTH_MB = 2.0
"""MB: growth of a node by its heap alone."""

PAUSE = 1
"""s for which the robot may stand stopped: one second to come to rest, then it is reset."""

NODES = (
    Node("kinematics", KINEMATICS, {}),
    Node("supervisor", SUPERVISOR, {}),
    Node("simulated_joints", JOINTS, {"scenario": "pick_and_place"}),
)


class Use(NamedTuple):
    """Resources of a node at one moment."""

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
    """Record the resources of every node once a second."""
    from irsbot_msgs.srv import EvaluateJoints  # needs ROS, which the list of rows does not

    from irsbot_supervisor.validation.harness.client import Tester

    request = EvaluateJoints.Request(joints=[2.544, -0.19])
    domain = free_domain()
    with Suite(folder / "logs", domain) as suite, Tester(suite, domain) as tester:
        suite.start(Node("recorder", RECORDER, {"output": str(folder / "bag")}))
        for node in NODES:
            suite.start(node)
        tester.listen()
        tester.until(lambda: tester.works(1), "the robot at work")
        evaluate = tester.client(EvaluateJoints, "kinematics/evaluate")
        warm_s = time.monotonic() + min(WARM_UP_S, 0.5 * seconds)
        while time.monotonic() < warm_s:
            tester.ask(evaluate, request)
        uses: dict[str, list[Use]] = {name: [] for name in suite.processes}
        processes = {name: psutil.Process(process.pid) for name, process in suite.processes.items()}
        begin, before, idle = time.monotonic(), Level.OK, 0
        for second in range(seconds):
            tester.ask(evaluate, request)
            tester.look(max(begin + second + 1.0 - time.monotonic(), 0.0))
            suite.check()
            levels = [before, *(verdict.level for verdict in tester.verdicts)]
            before = levels[-1]
            tally.add(FALSE_STOPS, sum(a < Level.STOP <= b for a, b in pairwise(levels)))
            tester.reset_stop()  # of a machine so busy that samples are late
            idle = 0 if any(level < Level.STOP for level in levels[1:]) else idle + 1
            what = tester.verdicts[-1].text if tester.verdicts else "no verdict"
            tally.case(failed=f"no longer at work: {what}" if idle > PAUSE else "")
            tester.verdicts.clear()
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
    """Figures of one node, and its fault if it has one."""
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
