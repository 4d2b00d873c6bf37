"""Faults of time: stamps that are repeated, swapped, out of order, in the future, in the past or zero; clocks that are
set; simulated time that pauses and begins again.

docs/explanation/verdicts.md has the required result: a stamp beyond the limits is UNKNOWN at once; a repeated or
out-of-order one is counted and adds nothing; if no other samples come, the silence is STALE.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import exp, log

import numpy as np

from irsbot_msgs_py.records import Cause, JointSample
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.validation.harness.case import RECOVERY_LIMIT_S, Case, Fault, take_turns
from irsbot_supervisor.validation.harness.rows import FALSE_STOPS, RECOVERY_S, Job, Row
from irsbot_supervisor.validation.harness.stream import PERIOD_NS, WARM_UP, InputStream
from irsbot_supervisor.validation.in_process.reachable import least_margins

NAME = "stamps"
MUST = (
    "beyond the limits UNKNOWN at once; repeated or out of order counted, adds nothing; recovery <= 0.5 s; "
    "a reset is enough where a stamp that is off by more than stamp_jitter_s stops a robot"
)
STAMP_STOPS = "stops by one wrong stamp"
"""Figure: after it the speed of the joints is not known, and a robot is stopped that cannot be shown to stop in time
from full speed."""

PERIODS = 200
"""Length of each fault, in periods."""
LEAST_S, MOST_S = 1e-3, 10 * 365.25 * 86400.0
"""s: error of stamps and clocks, from a period to ten years."""
LONGEST_INTERRUPTION = 20
"""Periods: longest interruption of an ordinary kernel."""
LOOPED_NS = 10 * PERIOD_NS
"""ns: ROS time at which a simulation begins again."""
FAR = 1.0
"""rad or m: displacement of a robot that was put elsewhere."""


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
    return _harmless(case, lambda stream: [stream.sample()] * 2, PERIODS)


def swapped(case: Case) -> Fault:
    """Two samples in a row arrive together, each with the stamp of the other."""
    exchanged = _pairs(lambda a, b: [a._replace(stamp_ns=b.stamp_ns), b._replace(stamp_ns=a.stamp_ns)])
    return _harmless(case, exchanged, 0, wrong_stamp=True)


def overtaken(case: Case) -> Fault:
    """Two samples in a row arrive together, the later one first."""
    return _harmless(case, _pairs(lambda a, b: [b, a]), PERIODS // 2)


def repeated(case: Case) -> Fault:
    """The stamp stands still."""
    stream = case.stream
    stream.run(WARM_UP)
    stamp_ns, blind_ns, counted = stream.received_ns, stream.now_ns, _counted(stream)
    for _ in range(PERIODS):
        stream.advance()
        stream.deliver([stream.sample()._replace(stamp_ns=stamp_ns)])
        case.watch(blind_ns)
    failed = "" if _counted(stream) - counted == PERIODS else "not every repeated stamp was counted"
    return case.unsafe, failed or case.recovered()


def zero(case: Case) -> Fault:
    """The stamp is not set, or negative."""
    sign = int(case.rng.integers(2))
    return _beyond(case, lambda stream: stream.sample()._replace(stamp_ns=-sign * stream.received_ns))


def future(case: Case) -> Fault:
    """Stamps lie in the future; a small lead is allowed."""
    ahead_ns = _shift_ns(case)
    if ahead_ns <= case.stream.settings.future_limit_s * NS_PER_S:

        def ahead(stream: InputStream) -> list[JointSample]:
            return [stream.sample()._replace(stamp_ns=stream.received_ns + ahead_ns)]

        return _harmless(case, ahead, 0, wrong_stamp=True)
    return _beyond(case, lambda stream: stream.sample()._replace(stamp_ns=stream.received_ns + ahead_ns))


def past(case: Case) -> Fault:
    """Stamps lie in the past. Within the age limit the sender's clock is believed once nothing newer has come."""
    stream, behind_ns = case.stream, _shift_ns(case)
    if behind_ns > stream.settings.age_limit_s * NS_PER_S:
        return _beyond(case, lambda stream: stream.sample()._replace(stamp_ns=max(stream.received_ns - behind_ns, 1)))
    stream.run(WARM_UP)
    for _ in range(PERIODS):
        stream.advance()
        stream.deliver([stream.sample()._replace(stamp_ns=stream.received_ns - behind_ns)])
    return case.unsafe, case.recovered()


def interrupted(case: Case) -> Fault:
    """The sender is interrupted between reading and stamping: one sample is older than its stamp, the following ones
    are correct.

    The error exceeds `stamp_jitter_s`: the speed of the joints is then unknown, and a robot that could not be stopped
    from its full speed is stopped.
    """
    stream = case.stream
    stream.run(WARM_UP)
    stream.advance()
    read = stream.sample()
    for _ in range(1 + round(case.share * LONGEST_INTERRUPTION)):
        stream.advance()
    stream.deliver([read._replace(stamp_ns=stream.received_ns)])
    stream.run(PERIODS)
    lost = stream.verdict is not None and stream.verdict.latched and bool(stream.verdict.causes & Cause.BRANCH)
    return "", "the branch is lost for one stamp" if lost else case.recovered()


def step_forward(case: Case) -> Fault:
    """The ROS clock of all processes is set forward: the samples are correct."""
    step_ns = _shift_ns(case)

    def stepped(stream: InputStream) -> list[JointSample]:
        stream.ros_shift_ns = step_ns
        return [stream.sample()]

    return _harmless(case, stepped, 0, wrong_stamp=True)


def step_back(case: Case) -> Fault:
    """The ROS clock of all processes is set back: samples are out of order until nothing newer has come for a while."""
    stream = case.stream
    stream.run(WARM_UP)
    stream.ros_shift_ns = -min(_shift_ns(case), stream.received_ns - LOOPED_NS)
    return "", _settles(case)


def pause(case: Case) -> Fault:
    """Simulated time stands still, and with it every stamp; samples come or do not."""
    stream, silent = case.stream, bool(case.rng.integers(2))
    stream.run(WARM_UP)
    blind_ns, stream.standing = stream.now_ns, True
    for _ in range(PERIODS):
        stream.ros_shift_ns -= PERIOD_NS
        stream.advance()
        stream.deliver([] if silent else [stream.sample()])
        case.watch(blind_ns)
    stream.standing = False
    return case.unsafe, case.recovered()


def loop(case: Case) -> Fault:
    """Simulated time begins again at nearly zero, with the robot at the same place."""
    stream = case.stream
    stream.run(WARM_UP)
    stream.ros_shift_ns -= stream.received_ns - LOOPED_NS
    return "", _settles(case)


def put_back(case: Case) -> Fault:
    """Simulated time begins again with the robot at another place, which no motion explains."""
    stream = case.stream
    stream.run(WARM_UP)
    stream.ros_shift_ns -= stream.received_ns - LOOPED_NS
    blind_ns = stream.now_ns
    for _ in range(PERIODS):
        stream.advance()
        sample = stream.sample()
        stream.deliver([sample._replace(position=tuple(q + FAR for q in sample.position))])
        case.watch(blind_ns)
    held = stream.verdict is not None and stream.verdict.latched
    return case.unsafe, "" if held else "a robot that was put somewhere else is not latched"


def _harmless(
    case: Case, make: Callable[[InputStream], Sequence[JointSample]], count: int, *, wrong_stamp: bool = False
) -> Fault:
    """Feed samples that must not cause a stop. count: least number of them that must be counted as rejected.
    wrong_stamp: stamps are off by more than `stamp_jitter_s` once, so that the speed is not known for a while."""
    stream = case.stream
    stream.run(WARM_UP)
    counted = _counted(stream)
    for _ in range(PERIODS):
        stream.advance()
        stream.deliver(make(stream))
        if not stream.moves:
            if wrong_stamp:
                case.tally.add(STAMP_STOPS)
                return "", case.recovered()
            case.tally.add(FALSE_STOPS)
            return "", f"stopped: {stream.verdict.text if stream.verdict else ''}"
    failed = "" if _counted(stream) - counted >= count else f"{_counted(stream) - counted} counted of {count}"
    return "", failed or case.recovered()


def _beyond(case: Case, make: Callable[[InputStream], JointSample]) -> Fault:
    """Feed samples with invalid stamps: UNKNOWN with the first of them, every one counted."""
    stream = case.stream
    stream.run(WARM_UP)
    counted, blind_ns = _counted(stream), stream.now_ns
    for _ in range(PERIODS):
        stream.advance()
        stream.deliver([make(stream)])
        case.watch(blind_ns)
        if stream.moves:
            case.unsafe = case.unsafe or f"{stream.level.name} with a stamp beyond the limits"
    failed = "" if _counted(stream) - counted == PERIODS else "not every stamp was counted"
    return case.unsafe, failed or case.recovered()


def _settles(case: Case) -> str:
    """Feed true samples after a clock was set: returns why motion is not allowed in time and for good, or empty. The
    branch may be lost, and needs a reset, if a singularity was within reach during the silence; so does a stop
    because the speed is not known after the step."""
    stream, begin_ns = case.stream, case.stream.now_ns
    last_ns = begin_ns
    for _ in range(round(RECOVERY_LIMIT_S * NS_PER_S / PERIOD_NS) + PERIODS):
        stream.run(1)
        if stream.verdict is not None and stream.verdict.latched and stream.verdict.causes & Cause.BRANCH:
            return case.recovered() if _near_type2(stream) else "the branch is lost, and no singularity was near"
        if stream.verdict is not None and stream.verdict.latched:
            case.tally.add(STAMP_STOPS)
            return case.recovered()
        last_ns = last_ns if stream.moves else stream.now_ns
    case.tally.largest(RECOVERY_S, (last_ns - begin_ns) / NS_PER_S)
    return (
        ""
        if last_ns - begin_ns <= RECOVERY_LIMIT_S * NS_PER_S
        else f"stopped {(last_ns - begin_ns) / NS_PER_S:.3f} s after the step"
    )


def _near_type2(stream: InputStream) -> bool:
    """True if a Type 2 singularity is within reach of the joints until consumers brake for silence."""
    settings, robot = stream.settings, stream.supervisor.robot
    here = np.array(stream.position)
    way = np.array(settings.velocity_limit) * (settings.stale_s + settings.heartbeat_s + settings.latency_s)
    at = robot.mechanism.posture(stream.position, settings.assembly_mode)
    least = least_margins(robot, settings, (here - way)[None], (here + way)[None], [at])
    return not least[0, 1] > 0.0


def _pairs(
    order: Callable[[JointSample, JointSample], list[JointSample]],
) -> Callable[[InputStream], list[JointSample]]:
    held: list[JointSample] = []

    def make(stream: InputStream) -> list[JointSample]:
        held.append(stream.sample())
        if len(held) < 2:
            return []
        pair = order(*held)
        held.clear()
        return pair

    return make


def _counted(stream: InputStream) -> int:
    return stream.supervisor.rejections.get(Cause.STAMP, 0)


def _shift_ns(case: Case) -> int:
    """From a period to ten years, evenly in the logarithm."""
    return round(exp(log(LEAST_S) + case.share * log(MOST_S / LEAST_S)) * NS_PER_S)
