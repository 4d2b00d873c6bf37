"""The state of a sequential supervisor at the ends of a stretch that is judged as columns.

This is the one place that knows what the stages of the core remember. `history` reads it, and says None where anything
is remembered that a stretch would have to change: a finding, a stop, a suspicion. `hand_over` writes what the stages
would remember after the last sample of a stretch. The number of verdicts that were spoken is not kept: a replay
compares what was judged, not the heartbeats.
"""

from __future__ import annotations

from collections import deque
from math import inf, nan

import numpy as np

from irsbot_msgs_py.records import Level
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.bag.joint_columns import JointColumns, Times, Values
from irsbot_supervisor.core.estimation.estimate import Estimate, Speeds
from irsbot_supervisor.core.estimation.estimator import Estimator
from irsbot_supervisor.core.margins import margins_of
from irsbot_supervisor.core.report import Moment
from irsbot_supervisor.core.supervisor import FOREVER, Supervisor
from irsbot_supervisor.core.validation import Accepted
from irsbot_supervisor.replay.quiet.filters import Longest
from irsbot_supervisor.replay.quiet.motion import History, Motion
from irsbot_supervisor.replay.quiet.suspicion import Mask


def is_quiet(supervisor: Supervisor) -> bool:
    """True if nothing is in force or under suspicion, so that an ordinary sample changes nothing."""
    latch, estimator, good = supervisor._latch, supervisor._estimator, supervisor._good
    return (
        latch.now.level == Level.OK
        and not (latch._held or latch._stopped_by or latch._bypass or latch._transitions)
        and good is not None
        and good is estimator._last
        and not (supervisor._stale or supervisor._found or supervisor._silence)
        and supervisor._found_until_ns == FOREVER
        and supervisor._stops._begin is None
        and not supervisor._assessor._lost
        and supervisor._assessor._before is None
        and estimator._jumps._astray is None
        and not estimator._leads.any
    )


def history(supervisor: Supervisor, names: tuple[str, ...]) -> History | None:
    """What the supervisor remembers of the last samples; None if a stretch cannot begin. names: of the messages that
    follow."""
    if not is_quiet(supervisor) or supervisor._estimator._frozen.still:
        return None
    estimator, intake, last = supervisor._estimator, supervisor._intake, supervisor._good
    assert last is not None
    observed, reported = estimator._observer._kept, estimator._reported._kept
    newest = {last.stamp_ns, intake._stamp_ns, *(kept[-1][0] for kept in (observed, reported) if kept)}
    if not (observed and reported and len(newest) == 1 and intake._names == names and intake._seen_ns == last.seen_ns):
        return None
    count = max(len(observed), len(reported))
    rows = [(stamp, position) for stamp, position in observed]
    told = [(one.stamp_ns, one.position) for one in reported]
    longer, shorter = (rows, told) if len(rows) == count else (told, rows)
    if longer[count - len(shorter) :] != shorter or not all(len(one.velocity) for one in reported):
        return None
    velocity = np.full((len(last.position), count), nan)
    velocity[:, count - len(reported) :] = np.array([one.velocity for one in reported]).T
    intervals = estimator._intervals
    return History(
        np.array([stamp for stamp, _ in longer], np.int64),
        np.array([position for _, position in longer]).T,
        velocity,
        count - len(observed),
        count - len(reported),
        last.received_ns,
        last.seen_ns,
        *estimator._observer._speeds,
        intervals._sent_s,
        intervals._learned_ns,
        Longest(intervals._longest._since_ns, intervals._longest._now, intervals._longest._before),
    )


def agrees(supervisor: Supervisor, motion: Motion, row: int) -> bool:
    """True if the supervisor, which has judged this sample itself, remembers the motion as the columns have it."""
    estimator, at = supervisor._estimator, row + len(motion.stamps) - len(motion.regular)
    observed, reported = estimator._observer._kept, estimator._reported._kept
    longest = estimator._intervals._longest
    return (
        bool(observed and reported)
        and observed[-1][0] == reported[-1].stamp_ns == motion.stamps[at]
        and supervisor._intake._stamp_ns == motion.stamps[at]
        and len(observed) == at - motion.observed[row] + 1
        and len(reported) == at - motion.reported[row] + 1
        and tuple(map(list, estimator._observer._speeds))
        == (motion.forward[:, row].tolist(), motion.backward[:, row].tolist())
        and estimator._frozen.still == motion.suspicions.memory.get(row, {})
        and estimator._intervals._sent_s == motion.sent_s[row]
        and longest._since_ns == motion.since_ns[row]
        and [*longest._now, *longest._before] == motion.longest[row].tolist()
    )


def hand_over(supervisor: Supervisor, block: JointColumns, motion: Motion, begin: int, end: int) -> None:
    """Let the supervisor remember the samples begin..end - 1 of a block as if it had judged them, without findings."""
    estimator, intake, row = supervisor._estimator, supervisor._intake, end - 1
    sure = np.delete(np.arange(begin, end), [row - begin for row in motion.suspicions.rates if begin <= row < end])
    _stand(estimator, block.seen_ns[sure], block.position[sure], block.velocity[sure])
    if end - begin > 1:
        estimator._before = _estimate(estimator, block, motion, row - 1)
    else:
        estimator._before = estimator._last
    last = estimator._last = supervisor._good = _estimate(estimator, block, motion, row)
    at = row + len(motion.stamps) - len(motion.regular)
    stamps, positions = motion.stamps, motion.positions
    kept = range(int(motion.observed[row]), at + 1)
    estimator._observer._kept = deque((int(stamps[k]), tuple(positions[:, k].tolist())) for k in kept)
    estimator._observer._speeds = Speeds(
        tuple(motion.forward[:, row].tolist()), tuple(motion.backward[:, row].tolist())
    )
    estimator._frozen.still = dict(motion.suspicions.memory.get(row, {}))
    reported: deque[Accepted] = deque()
    for k in range(int(motion.reported[row]), at + 1):
        place = k - at + row
        received_ns, seen_ns = (int(block.received_ns[place]), int(block.seen_ns[place])) if place >= 0 else (0, 0)
        effort = tuple(block.effort[place].tolist()) if place >= 0 else ()
        position, velocity = tuple(positions[:, k].tolist()), tuple(motion.velocities[:, k].tolist())
        reported.append(Accepted(int(stamps[k]), received_ns, seen_ns, position, velocity, effort))
    estimator._reported._kept = reported
    intervals = estimator._intervals
    intervals._sent_s = float(motion.sent_s[row])
    a, b, c, d = motion.longest[row].tolist()
    intervals._longest._since_ns = int(motion.since_ns[row])
    intervals._longest._now, intervals._longest._before = (a, b), (c, d)
    intake._period_ns = int(stamps[at] - stamps[at - 1])
    intake._stamp_ns, intake._seen_ns, intake._position = last.stamp_ns, last.seen_ns, last.position
    assessor = supervisor._assessor
    supervisor._at = at_rest = assessor._mechanism.posture(last.position, assessor._assembly)
    assessor._gaps = at_rest.gaps
    supervisor._last = Moment(last.stamp_ns, margins_of(at_rest))
    supervisor._samples += end - begin


def _estimate(estimator: Estimator, block: JointColumns, motion: Motion, row: int) -> Estimate:
    """The estimate of one sample. Time in which samples would come if they were not late matters to the sample itself
    alone, and is left out."""
    learned_ns, seen_ns = estimator._intervals._learned_ns, int(block.seen_ns[row])
    return Estimate(
        stamp_ns=int(block.stamp_ns[row]),
        received_ns=int(block.received_ns[row]),
        seen_ns=seen_ns,
        position=tuple(block.position[row].tolist()),
        velocity=tuple(block.velocity[row].tolist()),
        effort=tuple(block.effort[row].tolist()),
        speeds=Speeds(*(tuple(bounds[:, row].tolist()) for bounds in motion.speeds)),
        prediction_delay_s=float(motion.delay_s[row]),
        expected_s=float(motion.expected_s[row]),
        steady_s=(seen_ns - learned_ns) / NS_PER_S if learned_ns is not None else inf,
        standing_s=0.0 if row in motion.suspicions.rates else (seen_ns - estimator._stood_ns) / NS_PER_S,
    )


def _stand(estimator: Estimator, seen_ns: Times, positions: Values, velocities: Values) -> None:
    """Follow since when the joints stand, as `Estimator._standing_s` does sample by sample."""
    moving = np.flatnonzero((np.abs(velocities) > estimator._slow).any(1))
    at = 0
    if len(moving):
        at = int(moving[-1]) + 1
        _rest_at(estimator, seen_ns, positions, at - 1, moves=True)
    while at < len(seen_ns):
        rest = np.array(estimator._rest) if estimator._rest else np.full(positions.shape[1], nan)
        last = int(np.searchsorted(seen_ns, estimator._rest_ns + round(estimator._stale_s * NS_PER_S), "right"))
        rows = slice(at, max(last, at) + 1)  # and the first one after the time for which the position is remembered
        since = (seen_ns[rows] - estimator._rest_ns) / NS_PER_S
        since = since[: int((since <= estimator._stale_s).argmin()) + 1] if since[-1] > estimator._stale_s else since
        rows = slice(at, at + len(since))
        most = (estimator._slow * since + estimator._step)[:, None]
        stands = _within(positions[rows], rest, most)
        if stands.all():
            at += len(stands)
            if since[-1] > estimator._stale_s:
                _rest_at(estimator, seen_ns, positions, at - 1, moves=False)
        else:
            at += int(stands.argmin()) + 1
            _rest_at(estimator, seen_ns, positions, at - 1, moves=True)


def _within(positions: Values, rest: Values, most: Values) -> Mask:
    moved = positions - rest
    return np.asarray(((-most <= moved) & (moved <= most)).all(1))


def _rest_at(estimator: Estimator, seen_ns: Times, positions: Values, row: int, moves: bool) -> None:
    estimator._rest, estimator._rest_ns = tuple(positions[row].tolist()), int(seen_ns[row])
    if moves:
        estimator._stood_ns = estimator._rest_ns
