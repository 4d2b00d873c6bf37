"""Faults of time: stamps that are repeated, swapped, overtaken, in the future, in the past or zero; clocks that are
set; simulated time that pauses and begins again.

What must follow is in docs/verdicts.md: a stamp beyond the limits is UNKNOWN at once, one that is repeated or out of
order is counted and adds nothing, and when nothing else comes the silence is STALE.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import exp, log

import numpy as np

from irsbot_msgs_py.records import Cause, JointSample
from irsbot_supervisor.campaign.case import RECOVERY_LIMIT_S, Case, Fault, take_turns
from irsbot_supervisor.campaign.line import PERIOD_NS, WARM_UP, Line
from irsbot_supervisor.campaign.reachable import least_margins
from irsbot_supervisor.campaign.rows import FALSE_STOPS, RECOVERY_S, Job, Row
from irsbot_supervisor.core.intake import S

NAME = "stamps"
MUST = "beyond the limits UNKNOWN at once; repeated or out of order counted, adds nothing; recovery <= 0.5 s"

PERIODS = 200
"""For how long each fault lasts."""
LEAST_S, MOST_S = 1e-3, 10 * 365.25 * 86400.0
"""s by which stamps and clocks are wrong: a period to ten years."""
LONGEST_INTERRUPTION = 20
"""Periods: the ordinary kernel's."""
LOOPED_NS = 10 * PERIOD_NS
"""ROS time at which a simulation begins again."""
FAR = 1.0
"""rad or m: where a robot appears that was put somewhere else."""


def run(job: Job) -> Row:
    """The row: a case is one fault on a robot at work."""
    kinds = (
        duplicate,
        swapped,
        overtaken,
        repeated,
        zero,
        future,
        past,
        interrupted,
        step_forward,
        step_back,
        pause,
        loop,
        put_back,
    )
    return take_turns(NAME, job, kinds)


def duplicate(case: Case) -> Fault:
    """Every sample is delivered twice."""
    return _harmless(case, lambda line: [line.sample()] * 2, PERIODS)


def swapped(case: Case) -> Fault:
    """Two samples in a row arrive together, each with the stamp of the other."""
    return _harmless(case, _pairs(lambda a, b: [a._replace(stamp_ns=b.stamp_ns), b._replace(stamp_ns=a.stamp_ns)]), 0)


def overtaken(case: Case) -> Fault:
    """Two samples in a row arrive together, the later one first."""
    return _harmless(case, _pairs(lambda a, b: [b, a]), PERIODS // 2)


def repeated(case: Case) -> Fault:
    """The stamp stands still."""
    line = case.line
    line.run(WARM_UP)
    stamp_ns, blind_ns, counted = line.received_ns, line.now_ns, _counted(line)
    for _ in range(PERIODS):
        line.advance()
        line.deliver([line.sample()._replace(stamp_ns=stamp_ns)])
        case.watch(blind_ns)
    failed = "" if _counted(line) - counted == PERIODS else "not every repeated stamp was counted"
    return case.unsafe, failed or case.recovered()


def zero(case: Case) -> Fault:
    """The stamp is not set, or negative."""
    sign = int(case.rng.integers(2))
    return _beyond(case, lambda line: line.sample()._replace(stamp_ns=-sign * line.received_ns))


def future(case: Case) -> Fault:
    """Stamps lie in the future: a little is allowed."""
    ahead_ns = _shift_ns(case)
    if ahead_ns <= case.line.settings.future_limit_s * S:
        return _harmless(case, lambda line: [line.sample()._replace(stamp_ns=line.received_ns + ahead_ns)], 0)
    return _beyond(case, lambda line: line.sample()._replace(stamp_ns=line.received_ns + ahead_ns))


def past(case: Case) -> Fault:
    """Stamps lie in the past. Within the age limit the sender's clock is believed once nothing newer has come."""
    line, behind_ns = case.line, _shift_ns(case)
    if behind_ns > line.settings.age_limit_s * S:
        return _beyond(case, lambda line: line.sample()._replace(stamp_ns=max(line.received_ns - behind_ns, 1)))
    line.run(WARM_UP)
    for _ in range(PERIODS):
        line.advance()
        line.deliver([line.sample()._replace(stamp_ns=line.received_ns - behind_ns)])
    return case.unsafe, case.recovered()


def interrupted(case: Case) -> Fault:
    """The sender is interrupted between reading and stamping: one sample is older than it says, what follows is not.

    That is more than `stamp_jitter_s`: nobody knows how fast the joints are then, and a robot that could not be stopped
    at its fastest is stopped."""
    line = case.line
    line.run(WARM_UP)
    line.advance()
    read = line.sample()
    for _ in range(1 + round(case.share * LONGEST_INTERRUPTION)):
        line.advance()
    line.deliver([read._replace(stamp_ns=line.received_ns)])
    line.run(PERIODS)
    lost = line.verdict is not None and line.verdict.latched and bool(line.verdict.causes & Cause.BRANCH)
    return "", "the branch is lost for one stamp" if lost else case.recovered()


def step_forward(case: Case) -> Fault:
    """The ROS clock of everybody is set forward: nothing is wrong with the samples."""
    step_ns = _shift_ns(case)

    def stepped(line: Line) -> list[JointSample]:
        line.ros_shift_ns = step_ns
        return [line.sample()]

    return _harmless(case, stepped, 0)


def step_back(case: Case) -> Fault:
    """The ROS clock of everybody is set back: what comes is out of order until nothing newer has come for a while."""
    line = case.line
    line.run(WARM_UP)
    line.ros_shift_ns = -min(_shift_ns(case), line.received_ns - LOOPED_NS)
    return "", _settles(case)


def pause(case: Case) -> Fault:
    """Simulated time stands, and with it every stamp; samples come or do not."""
    line, silent = case.line, bool(case.rng.integers(2))
    line.run(WARM_UP)
    blind_ns, line.standing = line.now_ns, True
    for _ in range(PERIODS):
        line.ros_shift_ns -= PERIOD_NS
        line.advance()
        line.deliver([] if silent else [line.sample()])
        case.watch(blind_ns)
    line.standing = False
    return case.unsafe, case.recovered()


def loop(case: Case) -> Fault:
    """Simulated time begins again at nearly zero, the robot is where it was."""
    line = case.line
    line.run(WARM_UP)
    line.ros_shift_ns -= line.received_ns - LOOPED_NS
    return "", _settles(case)


def put_back(case: Case) -> Fault:
    """Simulated time begins again and the robot is somewhere else: where it is now, no motion has brought it."""
    line = case.line
    line.run(WARM_UP)
    line.ros_shift_ns -= line.received_ns - LOOPED_NS
    blind_ns = line.now_ns
    for _ in range(PERIODS):
        line.advance()
        sample = line.sample()
        line.deliver([sample._replace(position=tuple(q + FAR for q in sample.position))])
        case.watch(blind_ns)
    held = line.verdict is not None and line.verdict.latched
    return case.unsafe, "" if held else "a robot that was put somewhere else is not latched"


def _harmless(case: Case, make: Callable[[Line], Sequence[JointSample]], count: int) -> Fault:
    """Samples that must not stop anybody. count: how many of them must be counted as rejected, at least."""
    line = case.line
    line.run(WARM_UP)
    counted = _counted(line)
    for _ in range(PERIODS):
        line.advance()
        line.deliver(make(line))
        if not line.moves:
            case.tally.add(FALSE_STOPS)
            return "", f"stopped: {line.verdict.text if line.verdict else ''}"
    failed = "" if _counted(line) - counted >= count else f"{_counted(line) - counted} counted of {count}"
    return "", failed or case.recovered()


def _beyond(case: Case, make: Callable[[Line], JointSample]) -> Fault:
    """Stamps that say nothing at all: UNKNOWN with the first of them, every one counted."""
    line = case.line
    line.run(WARM_UP)
    counted, blind_ns = _counted(line), line.now_ns
    for _ in range(PERIODS):
        line.advance()
        line.deliver([make(line)])
        case.watch(blind_ns)
        if line.moves:
            case.unsafe = case.unsafe or f"{line.level.name} with a stamp beyond the limits"
    failed = "" if _counted(line) - counted == PERIODS else "not every stamp was counted"
    return case.unsafe, failed or case.recovered()


def _settles(case: Case) -> str:
    """After a clock was set and true samples go on: why motion is not allowed in time and for good, or empty. A branch
    may be lost, and is to be confirmed by a reset, where a singularity can have been met while nothing was heard."""
    line, begin_ns = case.line, case.line.now_ns
    last_ns = begin_ns
    for _ in range(round(RECOVERY_LIMIT_S * S / PERIOD_NS) + PERIODS):
        line.run(1)
        if line.verdict is not None and line.verdict.latched and line.verdict.causes & Cause.BRANCH:
            return case.recovered() if _near_type2(line) else "the branch is lost, and no singularity was near"
        last_ns = last_ns if line.moves else line.now_ns
    case.tally.largest(RECOVERY_S, (last_ns - begin_ns) / S)
    return (
        "" if last_ns - begin_ns <= RECOVERY_LIMIT_S * S else f"stopped {(last_ns - begin_ns) / S:.3f} s after the step"
    )


def _near_type2(line: Line) -> bool:
    """A Type 2 singularity is within what the joints can go until consumers brake for silence."""
    settings, robot = line.settings, line.supervisor.robot
    here = np.array(line.position)
    way = np.array(settings.velocity_limit) * (settings.stale_s + settings.heartbeat_s + settings.latency_s)
    at = robot.mechanism.posture(line.position, settings.assembly_mode)
    least = least_margins(robot, settings, (here - way)[None], (here + way)[None], [at])
    return not least[0, 1] > 0.0


def _pairs(
    order: Callable[[JointSample, JointSample], list[JointSample]],
) -> Callable[[Line], list[JointSample]]:
    held: list[JointSample] = []

    def make(line: Line) -> list[JointSample]:
        held.append(line.sample())
        if len(held) < 2:
            return []
        pair = order(*held)
        held.clear()
        return pair

    return make


def _counted(line: Line) -> int:
    return line.supervisor.rejections.get(Cause.STAMP, 0)


def _shift_ns(case: Case) -> int:
    """From a period to ten years, evenly in the logarithm."""
    return round(exp(log(LEAST_S) + case.share * log(MOST_S / LEAST_S)) * S)
