"""The estimator for many samples at once, as far as each follows the one before in the ordinary way.

Only sums, products, quotients and comparisons of the same numbers in the same order occur, which numpy rounds as Python
does: speeds, delays and boxes are those of the estimator, bit for bit. `Motion.regular` says for which samples the
assumptions hold; the others, and what follows them, are the estimator's.

Arrays hold one joint after the other, (n, N): numbers of one joint for many samples are what numpy is fast with.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import NamedTuple

import numpy as np

from irsbot_kinematics.mechanism import Coordinate
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.bag.joint_columns import JointColumns, Times, Values
from irsbot_supervisor.core.estimation.clock_steps import STEP_S
from irsbot_supervisor.core.estimation.observer import stamped_errors
from irsbot_supervisor.core.estimation.sample_interval import JUDGING_S, SETTLING, SecondLargestMemory
from irsbot_supervisor.core.reachable_box import position_error
from irsbot_supervisor.core.settings import OVERSPEED, Settings
from irsbot_supervisor.replay.quiet.filters import Rows, column_of, growing, kept_from, second_largest
from irsbot_supervisor.replay.quiet.suspicion import Mask, Suspicions, suspicions

NEAR = 3.0
"""rad: smaller differences of angles are their own remainder."""

SURELY_MOVED = 1.0 + 1e-9
"""1: a joint that moved by this multiple of the least step has moved, however the difference is rounded: nothing is
suspected of it."""

FARTHEST_ROW = 100.0
"""rad or m: positions beyond are left to the supervisor: there sines lose digits."""


class History(NamedTuple):
    """The estimator's memory before a stretch: its last samples, oldest first."""

    stamp_ns: Times  # (P,)
    position: Values  # (n, P)
    velocity: Values  # (n, P)
    observed: int  # of these rows the first that the observer keeps
    reported: int  # and that the comparison with reported velocities keeps
    received_ns: int  # of the last row
    seen_ns: int
    expected_s: float  # s, when the sample after the last row was expected to be judged
    forward: tuple[float, ...]
    backward: tuple[float, ...]
    sent_s: float
    learned_ns: int | None
    longest: SecondLargestMemory


@dataclass(frozen=True, eq=False)
class Motion:
    """Estimates of N samples; P rows of history come before them in `stamps`, `positions` and `velocities`."""

    regular: Mask  # (N,) True where the estimator finds nothing
    stamps: Times  # (P + N,)
    positions: Values  # (n, P + N)
    velocities: Values
    observed: Rows  # (N,) first row that is kept after the sample
    reported: Rows
    forward: Values  # (n, N) rad/s or m/s, bounds of the observer
    backward: Values
    speeds: tuple[Values, Values]  # of the estimates: at least what is reported of joints that may be frozen
    suspicions: Suspicions
    sent_s: Values  # (N,)
    since_ns: Times  # (N,) state of `SecondLargest`
    longest: Values  # (N, 4)
    expected_s: Values  # (N,)
    judging_s: Values  # of it
    delay_s: Values
    low: Values  # (n, N) rad or m: reachable box
    high: Values
    half: Values


class MotionColumns:
    """Applies the settings of one robot."""

    def __init__(self, settings: Settings, joints: tuple[Coordinate, ...]) -> None:
        self._settings, self._joints = settings, joints
        self._angles = np.array([[joint.is_angle] for joint in joints])
        turns = column_of([joint.turn for joint in joints])
        self._fastest, self._gain = column_of(settings.velocity_limit), column_of(settings.acceleration_limit)
        self._brake = column_of(settings.deceleration_limit)
        errors = stamped_errors(settings)
        self._errors = column_of([2.0 * error for error in errors])
        pairs = list(zip(errors, settings.acceleration_limit, strict=True))
        self._window_ns = round(max(sqrt(4.0 * e / a) for e, a in pairs) * NS_PER_S)
        self._reported_ns = max(round((4.0 * e / a) ** 0.5 * NS_PER_S) for e, a in pairs)
        self._told_s = float(((0.5 * turns - self._errors) / self._fastest).min())
        half = position_error(settings)
        self._box_errors = column_of([half + settings.stamp_jitter_s * v for v in settings.velocity_limit])
        self._jump = column_of(
            [settings.encoder_resolution + 2.0 * settings.stamp_jitter_s * v for v in settings.velocity_limit]
        )
        self._lower, self._upper = column_of(settings.position_lower), column_of(settings.position_upper)

    def over(self, block: JointColumns, history: History) -> Motion:
        """Estimates of samples that follow the history. block: positions and velocities in the order of the robot."""
        settings, before = self._settings, len(history.stamp_ns)
        stamps = np.concatenate([history.stamp_ns, block.stamp_ns])
        positions = np.concatenate([history.position, block.position.T], axis=1)
        velocities = np.concatenate([history.velocity, block.velocity.T], axis=1)
        row, position, speed = before + np.arange(len(block)), positions[:, before:], np.abs(velocities[:, before:])
        stamp_steps = block.stamp_ns - stamps[before - 1 : -1]
        seen_steps = np.diff(block.seen_ns, prepend=history.seen_ns)
        received_steps = np.diff(block.received_ns, prepend=history.received_ns)
        age = block.received_ns - block.stamp_ns
        passed, stamped = seen_steps / NS_PER_S, stamp_steps / NS_PER_S
        regular = (stamp_steps > 0) & (seen_steps >= 0) & (age >= 0) & (age <= round(settings.age_limit_s * NS_PER_S))
        regular &= (passed <= settings.stale_s) & (stamped <= settings.stale_s)
        regular &= seen_steps <= round(settings.stale_s * NS_PER_S)
        clock_step = received_steps - seen_steps
        regular &= ~((clock_step > STEP_S * NS_PER_S) & (clock_step < stamp_steps))
        regular &= (np.abs(position) <= FARTHEST_ROW).all(0)
        moved = position - positions[:, before - 1 : -1]
        span = np.maximum(passed, stamped)
        regular &= (np.abs(moved) <= OVERSPEED * self._fastest * span + self._jump).all(0)
        regular &= (speed <= self._fastest).all(0)
        still = np.abs(moved) <= 2.0 * settings.encoder_resolution * SURELY_MOVED
        slow = (still & (speed > settings.standstill_speed)).any(0)
        suspected = suspicions(settings, self._joints, block, moved, stamped, slow)
        regular[suspected.faults] = False
        if history.learned_ns is not None:
            regular &= (block.seen_ns - history.learned_ns) / NS_PER_S >= SETTLING * settings.stale_s

        observed = kept_from(stamps, row, self._window_ns, history.observed)
        forward, backward = self._speeds(stamps, positions, row, observed, history, regular)
        reported = kept_from(stamps, row, self._reported_ns, history.reported)
        self._compare(stamps, positions, velocities, row, reported, forward, backward, regular)
        expected, judging, since, longest = self._expected(block.seen_ns, passed, stamped, history)
        covered = np.concatenate([[history.expected_s], expected[:-1]]) + settings.latency_s
        regular &= passed <= covered  # else the branch has to be proved
        delay = expected + age / NS_PER_S
        up, down = speeds = _raised(forward, backward, suspected)
        ahead = self._until_rest(up, delay + settings.latency_s) + self._box_errors
        back = self._until_rest(down, delay + settings.latency_s) + self._box_errors
        low, high = position - back, position + ahead
        regular &= ((self._lower <= low) & (high <= self._upper)).all(0)
        return Motion(
            regular=regular,
            stamps=stamps,
            positions=positions,
            velocities=velocities,
            observed=observed,
            reported=reported,
            forward=forward,
            backward=backward,
            speeds=speeds,
            suspicions=suspected,
            sent_s=stamped,
            since_ns=since,
            longest=longest,
            expected_s=expected,
            judging_s=judging,
            delay_s=delay,
            low=low,
            high=high,
            half=np.maximum(ahead, back),
        )

    def _speeds(
        self, stamps: Times, positions: Values, row: Rows, observed: Rows, history: History, regular: Mask
    ) -> tuple[Values, Values]:
        """Bounds of the observer; `regular` becomes False where it starts anew."""
        first = np.concatenate([[history.observed], observed[:-1]])  # kept after the sample before
        count, back = row - first, np.ones_like(row)
        position, stamp = positions[:, row[0] :], stamps[row[0] :]
        forward = np.broadcast_to(self._fastest, position.shape).copy()
        backward = forward.copy()
        least: tuple[Values, Values] | None = None
        asked = np.ones(len(row), bool)
        while asked.any():
            then = row - back
            age = stamp - stamps.take(then)
            span = age / NS_PER_S
            asked &= span <= self._told_s
            way = position - positions.take(then, axis=1)
            regular &= ~(asked & (self._angles & ~(np.abs(way) < NEAR)).any(0))
            mean, gained = way / span, self._gain * span
            rest = self._errors / span + 0.5 * gained
            up, down = mean + rest, rest - mean
            least = least or (up, down)
            np.minimum(forward, np.maximum(up, gained), out=forward, where=asked)
            np.minimum(backward, np.maximum(down, gained), out=backward, where=asked)
            asked &= ~((back == count) | (age >= self._window_ns))
            back = np.minimum(2 * back, count)
        gains = self._gain * ((stamp - stamps[row[0] - 1 : -1]) / NS_PER_S)
        forward, before = growing(forward, gains, history.forward)
        backward, earlier = growing(backward, gains, history.backward)
        assert least is not None
        regular &= ((-least[1] <= before) & (-least[0] <= earlier)).all(0)
        return forward, backward

    def _compare(
        self,
        stamps: Times,
        positions: Values,
        velocities: Values,
        row: Rows,
        reported: Rows,
        forward: Values,
        backward: Values,
        regular: Mask,
    ) -> None:
        """`regular` becomes False where reported velocities contradict the positions."""
        settings, rate = self._settings, velocities[:, row[0] :]
        tolerance = settings.standstill_speed
        span = (stamps[row[0] :] - stamps.take(reported)) / NS_PER_S
        way, begin = positions[:, row[0] :] - positions.take(reported, axis=1), velocities.take(reported, axis=1)
        mean, least = way / span, self._errors / span + 0.5 * self._gain * span + tolerance
        right = (-backward - tolerance <= rate) & (rate <= forward + tolerance)
        right &= (mean - least <= np.maximum(begin, 0.0)) & (-mean - least <= np.maximum(-begin, 0.0))
        right &= ~self._angles | (np.abs(way) < NEAR)
        regular &= right.all(0)

    def _expected(
        self, seen: Times, passed: Values, stamped: Values, history: History
    ) -> tuple[Values, Values, Times, Values]:
        """Time until the next sample is judged, the part of it for judging, and the memory of long intervals."""
        settings = self._settings
        gap = np.where((passed < stamped) & (stamped <= settings.stale_s), stamped, passed)
        second, since, longest = second_largest(seen, gap, SETTLING * settings.stale_s * NS_PER_S, history.longest)
        most = np.maximum(np.where(second == 0.0, gap, second), settings.least_gap_s)
        judging = np.maximum(settings.judging_s, np.minimum(most, JUDGING_S))
        return most + judging, judging, since, longest

    def _until_rest(self, speed: Values, free_s: Values) -> Values:
        free, gain, fastest = free_s, self._gain, self._fastest
        faster = (fastest - speed) / gain
        short = faster >= free
        way = np.where(
            short,
            (speed + 0.5 * gain * free) * free,
            (speed + 0.5 * gain * faster) * faster + fastest * (free - faster),
        )
        last = np.where(short, speed + gain * free, fastest)
        past = speed >= fastest
        way, last = np.where(past, speed * free, way), np.where(past, speed, last)
        rest: Values = way + 0.5 * last * last / self._brake
        return rest


def _raised(forward: Values, backward: Values, suspected: Suspicions) -> tuple[Values, Values]:
    """Bounds of the speeds where a joint whose position may be frozen may move as the message says."""
    if not suspected.rates:
        return forward, backward
    rows, rates = list(suspected.rates), np.array(list(suspected.rates.values())).T
    forward, backward = forward.copy(), backward.copy()
    forward[:, rows] = np.maximum(forward[:, rows], rates)
    backward[:, rows] = np.maximum(backward[:, rows], -rates)
    return forward, backward
