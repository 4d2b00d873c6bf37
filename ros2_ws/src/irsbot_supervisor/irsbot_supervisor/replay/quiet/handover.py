"""The state of a sequential supervisor at the ends of a stretch that is judged as columns.

`history` reads the supervisor's memory, and says None where anything is remembered that a stretch would have to
change: a finding, a stop, a suspicion. `hand_over` writes what it would remember after the last sample of a stretch.
The number of verdicts that were spoken is not kept: a replay compares what was judged, not the heartbeats.
"""

from __future__ import annotations

from math import inf, nan

import numpy as np

from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.bag.joint_columns import JointColumns, Times, Values
from irsbot_supervisor.core.estimation.estimate import Estimate, Speeds
from irsbot_supervisor.core.estimation.observer import ObserverMemory
from irsbot_supervisor.core.estimation.sample_interval import IntervalMemory, SecondLargestMemory
from irsbot_supervisor.core.memory import EstimatorMemory, Standstill
from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.core.supervisor import Supervisor
from irsbot_supervisor.core.validation import Accepted
from irsbot_supervisor.replay.quiet.motion import History, Motion
from irsbot_supervisor.replay.quiet.suspicion import Mask


def history(supervisor: Supervisor, names: tuple[str, ...]) -> History | None:
    """What the supervisor remembers of the last samples; None if a stretch cannot begin. names: of the messages that
    follow."""
    if not supervisor.quiet:
        return None
    memory = supervisor.memory
    intake, estimator = memory.intake, memory.estimator
    observed, reported, last = estimator.observer.kept, estimator.reported, estimator.last
    if estimator.still or last is None:
        return None
    newest = {last.stamp_ns, intake.stamp_ns, *(kept[-1][0] for kept in (observed, reported) if kept)}
    if not (observed and reported and len(newest) == 1 and intake.names == names and intake.seen_ns == last.seen_ns):
        return None
    count = max(len(observed), len(reported))
    rows = list(observed)
    told = [(one.stamp_ns, one.position) for one in reported]
    longer, shorter = (rows, told) if len(rows) == count else (told, rows)
    if longer[count - len(shorter) :] != shorter or not all(len(one.velocity) for one in reported):
        return None
    velocity = np.full((len(last.position), count), nan)
    velocity[:, count - len(reported) :] = np.array([one.velocity for one in reported]).T
    return History(
        np.array([stamp for stamp, _ in longer], np.int64),
        np.array([position for _, position in longer]).T,
        velocity,
        count - len(observed),
        count - len(reported),
        last.received_ns,
        last.seen_ns,
        last.expected_s,
        *estimator.observer.speeds,
        estimator.intervals.sent_s,
        estimator.intervals.learned_ns,
        estimator.intervals.longest,
    )


def agrees(supervisor: Supervisor, motion: Motion, row: int) -> bool:
    """True if the supervisor, which has judged this sample itself, remembers the motion as the columns have it."""
    memory, at = supervisor.memory, row + len(motion.stamps) - len(motion.regular)
    estimator = memory.estimator
    observed, reported, longest = estimator.observer.kept, estimator.reported, estimator.intervals.longest
    return (
        bool(observed and reported)
        and observed[-1][0] == reported[-1].stamp_ns == motion.stamps[at]
        and memory.intake.stamp_ns == motion.stamps[at]
        and len(observed) == at - motion.observed[row] + 1
        and len(reported) == at - motion.reported[row] + 1
        and tuple(map(list, estimator.observer.speeds))
        == (motion.forward[:, row].tolist(), motion.backward[:, row].tolist())
        and estimator.still == motion.suspicions.memory.get(row, {})
        and estimator.intervals.sent_s == motion.sent_s[row]
        and longest.since_ns == motion.since_ns[row]
        and [*longest.now, *longest.before] == motion.longest[row].tolist()
    )


def hand_over(supervisor: Supervisor, block: JointColumns, motion: Motion, begin: int, end: int) -> None:
    """Let the supervisor remember the samples begin..end - 1 of a block as if it had judged them, without findings."""
    memory, row = supervisor.memory, end - 1
    estimator, settings = memory.estimator, supervisor.settings
    sure = np.delete(np.arange(begin, end), [row - begin for row in motion.suspicions.rates if begin <= row < end])
    stood = _Standing(settings, estimator.standstill)
    stood.take(block.seen_ns[sure], block.position[sure], block.velocity[sure])
    learned_ns, stood_ns = estimator.intervals.learned_ns, stood.since.stood_ns
    before = _estimate(block, motion, row - 1, learned_ns, stood_ns) if end - begin > 1 else estimator.last
    last = _estimate(block, motion, row, learned_ns, stood_ns)
    at = row + len(motion.stamps) - len(motion.regular)
    stamps, positions = motion.stamps, motion.positions
    kept = range(int(motion.observed[row]), at + 1)
    observed = tuple((int(stamps[k]), tuple(positions[:, k].tolist())) for k in kept)
    speeds = Speeds(tuple(motion.forward[:, row].tolist()), tuple(motion.backward[:, row].tolist()))
    reported = []
    for k in range(int(motion.reported[row]), at + 1):
        place = k - at + row
        received_ns, seen_ns = (int(block.received_ns[place]), int(block.seen_ns[place])) if place >= 0 else (0, 0)
        effort = tuple(block.effort[place].tolist()) if place >= 0 else ()
        position, velocity = tuple(positions[:, k].tolist()), tuple(motion.velocities[:, k].tolist())
        reported.append(Accepted(int(stamps[k]), received_ns, seen_ns, position, velocity, effort))
    a, b, c, d = motion.longest[row].tolist()
    longest = SecondLargestMemory(int(motion.since_ns[row]), (a, b), (c, d))
    supervisor.remember(
        memory.intake._replace(
            stamp_ns=last.stamp_ns,
            seen_ns=last.seen_ns,
            period_ns=int(stamps[at] - stamps[at - 1]),
            position=last.position,
        ),
        EstimatorMemory(
            last,
            before,
            ObserverMemory(observed, speeds),
            tuple(reported),
            IntervalMemory(float(motion.sent_s[row]), learned_ns, longest),
            dict(motion.suspicions.memory.get(row, {})),
            stood.since,
        ),
        end - begin,
    )


def _estimate(block: JointColumns, motion: Motion, row: int, learned_ns: int | None, stood_ns: int) -> Estimate:
    """The estimate of one sample. Time in which samples would come if they were not late matters to the sample itself
    alone, and is left out. learned_ns: when the last silence ended. stood_ns: since when the joints stand."""
    seen_ns = int(block.seen_ns[row])
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
        standing_s=0.0 if row in motion.suspicions.rates else (seen_ns - stood_ns) / NS_PER_S,
        judging_s=float(motion.judging_s[row]),
    )


class _Standing:
    """Follows since when the joints stand, as `Estimator._standing_s` does sample by sample."""

    def __init__(self, settings: Settings, since: Standstill) -> None:
        self._slow, self._step = settings.standstill_speed, 2.0 * settings.encoder_resolution
        self._stale_s = settings.stale_s
        self.since = since

    def take(self, seen_ns: Times, positions: Values, velocities: Values) -> None:
        """Take in consecutive samples: (N,), (N, n), (N, n)."""
        moving = np.flatnonzero((np.abs(velocities) > self._slow).any(1))
        at = 0
        if len(moving):
            at = int(moving[-1]) + 1
            self._rest_at(seen_ns, positions, at - 1, moves=True)
        while at < len(seen_ns):
            rest, rest_ns, _stood_ns = self.since
            place = np.array(rest) if rest else np.full(positions.shape[1], nan)
            last = int(np.searchsorted(seen_ns, rest_ns + round(self._stale_s * NS_PER_S), "right"))
            rows = slice(at, max(last, at) + 1)  # and the first one after the time for which the position is remembered
            since = (seen_ns[rows] - rest_ns) / NS_PER_S
            since = since[: int((since <= self._stale_s).argmin()) + 1] if since[-1] > self._stale_s else since
            rows = slice(at, at + len(since))
            stands = _within(positions[rows], place, (self._slow * since + self._step)[:, None])
            if stands.all():
                at += len(stands)
                if since[-1] > self._stale_s:
                    self._rest_at(seen_ns, positions, at - 1, moves=False)
            else:
                at += int(stands.argmin()) + 1
                self._rest_at(seen_ns, positions, at - 1, moves=True)

    def _rest_at(self, seen_ns: Times, positions: Values, row: int, moves: bool) -> None:
        now_ns = int(seen_ns[row])
        self.since = Standstill(tuple(positions[row].tolist()), now_ns, now_ns if moves else self.since.stood_ns)


def _within(positions: Values, rest: Values, most: Values) -> Mask:
    moved = positions - rest
    return np.asarray(((-most <= moved) & (moved <= most)).all(1))
