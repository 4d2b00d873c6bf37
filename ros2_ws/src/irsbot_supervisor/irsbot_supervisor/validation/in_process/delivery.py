"""Faults of delivery: drop-outs, random loss, late start, frozen encoders, two publishers.

The row knows when the last true sample arrived, and since when the arriving ones are false.
"""

from __future__ import annotations

from math import exp, log

from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.sim.faults import FaultInjector, parse_faults
from irsbot_supervisor.validation.harness.case import Case, Fault, take_turns
from irsbot_supervisor.validation.harness.rows import FALSE_STOPS, Job, Row
from irsbot_supervisor.validation.harness.stream import PERIOD_NS, WARM_UP, InputStream

NAME = "delivery"
MUST = (
    "STOP or UNKNOWN within stale limit + one heartbeat; 1-2 lost periods change nothing; "
    "<= 5 % loss no false stop; recovery <= 0.5 s"
)

LONGEST = 1000
"""Length of the longest drop-out, in periods."""
HARMLESS = 2
"""Number of periods that may be lost without effect."""
MOST_LOSS, HARMLESS_LOSS = 0.5, 0.05
"""Shares of samples lost at random: the largest that is tried, and one that must not cause a stop."""
SLOWEST = 0.1
"""1: least speed of some joint when encoders freeze, as a share of its velocity limit: an encoder at rest is not
frozen."""
APART = (0.02, 1.0)
"""rad or m: least and largest difference of two publishers; smaller ones count as noise."""
BUNCHED_S = 0.003
"""s by which samples may arrive closer together than they were taken: equal stamps contain no more information."""


def run(job: Job) -> Row:
    """The row: a case is one fault on a robot at work."""
    return take_turns(NAME, job, (drop_out, loss, late_start, frozen, two_publishers))


def drop_out(case: Case) -> Fault:
    """No samples for 1..1000 periods."""
    stream = case.stream
    stream.run(WARM_UP)
    periods = max(round(exp(case.share * log(LONGEST))), 1)
    blind_ns, before = stream.now_ns, len(stream.changes)
    for _ in range(periods):
        stream.advance()
        case.watch(blind_ns)
    failed = case.recovered()
    stream.run(WARM_UP)
    if periods <= HARMLESS and len(stream.changes) > before:
        failed = failed or f"{periods} lost periods changed the verdict"
    if case.stopped and (periods + 1) * PERIOD_NS <= stream.settings.stale_s * NS_PER_S:
        case.tally.add(FALSE_STOPS)
        failed = failed or f"stopped although {periods} lost periods are within the stale limit"
    return case.unsafe, failed


def loss(case: Case) -> Fault:
    """Samples lost at random, each with the same probability."""
    stream, share = case.stream, MOST_LOSS * case.share
    stream.run(WARM_UP)
    before = len(stream.changes)
    injector = FaultInjector(
        parse_faults(f"loss:share={share!r}"), stream.robot.mechanism, int(case.rng.integers(2**31))
    )
    true_ns = stream.now_ns
    for _ in range(LONGEST):
        stream.advance()
        sent = injector.send(stream.sample())
        stream.deliver([one.sample for one in sent])
        true_ns = stream.now_ns if sent else true_ns
        case.watch(true_ns)
    stops = sum(level > 1 for _ns, level in stream.changes[before:])
    if share <= HARMLESS_LOSS:
        case.tally.add(FALSE_STOPS, stops)
        if stops:
            return case.unsafe, f"{stops} stops at {share:.1%} loss"
    case.tally.add("stops at more than 5 % loss", stops)
    return case.unsafe, case.recovered()


def late_start(case: Case) -> Fault:
    """The first sample comes late."""
    stream = case.stream
    for _ in range(round(2 * LONGEST * case.share)):
        stream.advance()
        if stream.moves:
            case.unsafe = case.unsafe or "allowed before the first sample"
    return case.unsafe, case.recovered()


def frozen(case: Case) -> Fault:
    """Encoders stand still, or the whole message does, while stamps continue and the robot moves."""
    stream, which = case.stream, str(case.rng.choice(["all", "position"]))
    stream.run(WARM_UP)
    while _pace(stream) < SLOWEST:
        stream.run(1)
    injector = FaultInjector(parse_faults(f"freeze:which={which}"), stream.robot.mechanism)
    injector.send(stream.sample())  # the delivered sample, at which they freeze
    blind_ns = stream.now_ns
    for _ in range(WARM_UP):
        stream.advance()
        stream.deliver([one.sample for one in injector.send(stream.sample())])
        if which == "position" and _pace(stream) < SLOWEST:
            blind_ns = stream.now_ns  # positions that stand while rest is reported contradict nothing
        case.watch(blind_ns)
    return case.unsafe, case.recovered()


def _pace(stream: InputStream) -> float:
    """Speed of the fastest joint as a share of its limit."""
    return max(abs(v) / limit for v, limit in zip(stream.velocity, stream.settings.velocity_limit, strict=True))


def two_publishers(case: Case) -> Fault:
    """A second source publishes the same joints with other positions: at the same stamps, after the first one, or in
    between."""
    stream, rng = case.stream, case.rng
    stream.run(WARM_UP)
    by = float(exp(rng.uniform(log(APART[0]), log(APART[1])))) * float(rng.choice([-1.0, 1.0]))
    early_ns = int(rng.choice([0, 0, PERIOD_NS // 4, PERIOD_NS // 2]))
    blind_ns = stream.now_ns
    for _ in range(2 * WARM_UP):
        stream.advance()
        true = stream.sample()
        other = true._replace(position=tuple(q + by for q in true.position), stamp_ns=true.stamp_ns - early_ns)
        if early_ns == 0:
            stream.deliver([true, other])
            if abs(by) <= max(stream.settings.velocity_limit) * BUNCHED_S:
                blind_ns = stream.now_ns  # a repetition that adds nothing: the robot may have moved so far
        else:
            stream.deliver([other, true])
        case.watch(blind_ns)
    return case.unsafe, case.recovered()
