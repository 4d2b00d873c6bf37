"""Faults of delivery: drop-outs, random loss, late start, frozen encoders, two publishers.

What is true is known here: when a true sample arrived last, and since when what arrives is wrong.
"""

from __future__ import annotations

from math import exp, log

from irsbot_supervisor.campaign.case import Case, Fault, take_turns
from irsbot_supervisor.campaign.line import PERIOD_NS, WARM_UP, Line
from irsbot_supervisor.campaign.rows import FALSE_STOPS, Job, Row
from irsbot_supervisor.core.intake import S
from irsbot_supervisor.sim.faults import FaultInjector, parse_faults

NAME = "delivery"
MUST = (
    "STOP or UNKNOWN within stale limit + one heartbeat; 1-2 lost periods change nothing; "
    "<= 5 % loss no false stop; recovery <= 0.5 s"
)

LONGEST = 1000
"""Periods of the longest drop-out."""
HARMLESS = 2
"""Periods that may be lost without a trace."""
MOST_LOSS, HARMLESS_LOSS = 0.5, 0.05
"""Shares of samples lost at random: the most that is tried, and what must not stop anybody."""
SLOWEST = 0.1
"""1: share of its velocity limit with which some joint moves when encoders freeze: what stands still is not frozen."""
APART = (0.02, 1.0)
"""rad or m by which two publishers differ, least and most: nearer ones are noise."""
BUNCHED_S = 0.003
"""s by which samples may arrive nearer to each other than they were taken: equal stamps tell no more than this."""


def run(job: Job) -> Row:
    """The row: a case is one fault on a robot at work."""
    return take_turns(NAME, job, (drop_out, loss, late_start, frozen, two_publishers))


def drop_out(case: Case) -> Fault:
    """Nothing for 1..1000 periods."""
    line = case.line
    line.run(WARM_UP)
    periods = max(round(exp(case.share * log(LONGEST))), 1)
    blind_ns, before = line.now_ns, len(line.changes)
    for _ in range(periods):
        line.advance()
        case.watch(blind_ns)
    failed = case.recovered()
    line.run(WARM_UP)
    if periods <= HARMLESS and len(line.changes) > before:
        failed = failed or f"{periods} lost periods changed the verdict"
    if case.stopped and (periods + 1) * PERIOD_NS <= line.settings.stale_s * S:
        case.tally.add(FALSE_STOPS)
        failed = failed or f"stopped although {periods} lost periods are within the stale limit"
    return case.unsafe, failed


def loss(case: Case) -> Fault:
    """Samples lost at random, each with the same probability."""
    line, share = case.line, MOST_LOSS * case.share
    line.run(WARM_UP)
    before = len(line.changes)
    injector = FaultInjector(parse_faults(f"loss:share={share!r}"), line.robot.mechanism, int(case.rng.integers(2**31)))
    true_ns = line.now_ns
    for _ in range(LONGEST):
        line.advance()
        sent = injector.send(line.sample())
        line.deliver([one.sample for one in sent])
        true_ns = line.now_ns if sent else true_ns
        case.watch(true_ns)
    stops = sum(level > 1 for _ns, level in line.changes[before:])
    if share <= HARMLESS_LOSS:
        case.tally.add(FALSE_STOPS, stops)
        if stops:
            return case.unsafe, f"{stops} stops at {share:.1%} loss"
    case.tally.add("stops at more than 5 % loss", stops)
    return case.unsafe, case.recovered()


def late_start(case: Case) -> Fault:
    """The first sample comes late."""
    line = case.line
    for _ in range(round(2 * LONGEST * case.share)):
        line.advance()
        if line.moves:
            case.unsafe = case.unsafe or "allowed before the first sample"
    return case.unsafe, case.recovered()


def frozen(case: Case) -> Fault:
    """Encoders stand still, or the whole message does, while stamps go on and the robot moves."""
    line, which = case.line, str(case.rng.choice(["all", "position"]))
    line.run(WARM_UP)
    while _pace(line) < SLOWEST:
        line.run(1)
    injector = FaultInjector(parse_faults(f"freeze:which={which}"), line.robot.mechanism)
    injector.send(line.sample())  # which was delivered, and is what they freeze at
    blind_ns = line.now_ns
    for _ in range(WARM_UP):
        line.advance()
        line.deliver([one.sample for one in injector.send(line.sample())])
        if which == "position" and _pace(line) < SLOWEST:
            blind_ns = line.now_ns  # positions that stand while rest is reported contradict nothing
        case.watch(blind_ns)
    return case.unsafe, case.recovered()


def _pace(line: Line) -> float:
    """Speed of the fastest joint as a share of its limit."""
    return max(abs(v) / limit for v, limit in zip(line.velocity, line.settings.velocity_limit, strict=True))


def two_publishers(case: Case) -> Fault:
    """A second source of the same joints, somewhere else: at the same stamps, behind the first one, or in between."""
    line, rng = case.line, case.rng
    line.run(WARM_UP)
    by = float(exp(rng.uniform(log(APART[0]), log(APART[1])))) * float(rng.choice([-1.0, 1.0]))
    early_ns = int(rng.choice([0, 0, PERIOD_NS // 4, PERIOD_NS // 2]))
    blind_ns = line.now_ns
    for _ in range(2 * WARM_UP):
        line.advance()
        true = line.sample()
        other = true._replace(position=tuple(q + by for q in true.position), stamp_ns=true.stamp_ns - early_ns)
        if early_ns == 0:
            line.deliver([true, other])
            if abs(by) <= max(line.settings.velocity_limit) * BUNCHED_S:
                blind_ns = line.now_ns  # a repetition that adds nothing: the robot may have moved so far
        else:
            line.deliver([other, true])
        case.watch(blind_ns)
    return case.unsafe, case.recovered()
