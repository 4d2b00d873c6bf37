"""Approaches at speed: the robot must stand before any stop limit is crossed.

A ramp moves all joints at constant rates, 10 to 100 % of their limits, from a random good posture towards a stop limit.
The supervisor receives one sample per period, each with a small delay. When its verdict is STOP, every joint keeps its
rate for the latency and then brakes with its own deceleration. Then the margins are evaluated along the whole path.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from math import nan
from typing import NamedTuple

import numpy as np

from irsbot_kinematics import Robot
from irsbot_msgs_py.records import JointSample, Level
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.configuration.loading import read_settings
from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.core.supervisor import Supervisor
from irsbot_supervisor.validation.harness.oracle import (
    MARGINS,
    ROUNDING,
    Array,
    good_postures,
    limits,
    margins_along,
    supervised,
)
from irsbot_supervisor.validation.harness.rows import Job, Row, Tally

NAME = "approach"
MUST = "the robot stands before its stop margin is crossed: 100 %"

SLOWEST = 0.1
"""1: least speed of a ramp, as a share of the velocity limits."""
LATENCY_S = 0.05
"""s: longest latency of the drives."""
AGES_S = (0.0, 0.0005, 0.003)
"""s from stamp to arrival."""
BURSTS = (1, 1, 1, 4, 16)
"""Numbers of samples that arrive together, with the last of them."""
APART_S = 1e-6
"""s between the arrivals of two samples of a burst."""
BEGIN_NS = 10**15
PERIOD_S = 0.001
SEARCH_S = 3.0
"""s: how long a ramp is followed in search of a stop limit."""
SEARCH_STEPS = 600
RUN_UP_S = 0.05
"""s: longest time between the begin of a run and the last moment for a stop, at first."""
EARLIER = 1.5
"""Factor by which that time grows until the run is allowed once its sample interval is known."""
MOST_TRIED = 200
"""1: largest number of directions that are tried for each ramp."""
FINE_STEPS = 500
"""Number of points along a run at which its margins are evaluated: about 0.5 ms apart."""
STARTS = 32
"""Number of postures that are searched at once."""


class Ramp(NamedTuple):
    """Joints at constant rates; a stop limit is crossed unless the robot is stopped."""

    start: Array  # rad or m
    rates: Array  # rad/s or m/s
    latency_s: float
    age_s: float  # of every sample on arrival
    phase_s: float  # of the first sample
    burst: int  # samples that arrive together

    def stamp_s(self, k: int) -> float:
        """s at which sample k is read."""
        return self.phase_s + k * PERIOD_S

    def read(self, k: int, settings: Settings) -> tuple[float, ...]:
        """(n,) joint positions of sample k, in whole steps of the encoders."""
        step = settings.encoder_resolution
        return tuple((np.round((self.start + self.rates * self.stamp_s(k)) / step) * step).tolist())

    def arrival_s(self, k: int) -> float:
        """s at which sample k arrives."""
        first = k // self.burst * self.burst
        return self.phase_s + (first + self.burst - 1) * PERIOD_S + self.age_s + (k - first) * APART_S

    @property
    def learning_s(self) -> list[float]:
        """s at which the sample interval is known: the second sample or the third burst."""
        return [self.arrival_s(k * self.burst) for k in range(2 if self.burst == 1 else 3)]

    def at(self, times: Array, brake_s: float, brakes: Array) -> Array:
        """(N, n) joint positions when the joints brake from `brake_s` on."""
        braking = np.minimum(np.maximum(times - brake_s, 0.0)[:, None], np.abs(self.rates) / brakes)
        going = np.minimum(times, brake_s)[:, None]
        way = self.rates * (going + braking) - 0.5 * np.sign(self.rates) * brakes * braking**2
        return np.asarray(self.start + way)


def run(job: Job) -> Row:
    """The row: a case is a ramp, the same number for every robot."""
    tally = Tally(NAME, job)
    names = job.robots or supervised()
    spares: list[float] = []
    for k, name in enumerate(names):
        rng = np.random.default_rng([job.seed, k])
        settings, robot = read_settings(name)
        done, wanted = 0, -(-job.amount // len(names))
        for ramp, seen_s in random_ramps(robot, settings, wanted, rng):
            done += 1
            spare = spare_of(ramp, seen_s, settings, robot)
            kind = MARGINS[int(spare.argmin())]
            unsafe = f"{name}: {kind} margin {-spare.min():.2e} below its limit" if not spare.min() >= -ROUNDING else ""
            tally.case(unsafe, "" if seen_s is not None else f"{name}: never told to stop")
            spares.append(float(spare.min()))
        if done < wanted:
            tally.many(0, 1, f"{name}: only {done} of {wanted} ramps were allowed once their sample interval was known")
    tally.figures["least margin above its stop limit"] = min(spares, default=nan)
    tally.figures["median of the same"] = float(np.median(spares)) if spares else nan
    tally.figures["robots"] = len(names)
    return tally.row()


def random_ramps(
    robot: Robot, settings: Settings, number: int, rng: np.random.Generator
) -> Iterator[tuple[Ramp, float | None]]:
    """Ramps that meet a stop limit, and the times at which a sample of them leads to STOP; fewer than this number if
    there are too few.

    A ramp begins so early that it is still allowed when the sample interval is known. A stop before that is in time by
    construction: see `_is_fair`. Where drives with a long latency are too fast to go on from anywhere, there is none.
    """
    speeds, brakes = np.array(settings.velocity_limit), np.array(settings.deceleration_limit)
    stop = limits(settings, "stop")
    times = np.linspace(0.0, SEARCH_S, SEARCH_STEPS)
    found = tried = 0
    while found < number and tried < MOST_TRIED * number:
        for start in good_postures(robot, settings, min(STARTS, number), rng):
            share = rng.uniform(-1.0, 1.0, len(speeds))
            rates = speeds * share / np.abs(share).max() * rng.uniform(SLOWEST, 1.0)
            crossed = (margins_along(robot, settings, start + times[:, None] * rates) < stop).any(axis=1)
            latency_s, age_s = rng.uniform(0.0, LATENCY_S), float(rng.choice(AGES_S))
            burst = int(rng.choice(BURSTS))
            needed_s = latency_s + age_s + burst * PERIOD_S + (np.abs(rates) / brakes).max()
            run_up_s = RUN_UP_S + 2 * (burst - 1) * PERIOD_S
            ahead_s, phase_s = rng.uniform(0.0, run_up_s), rng.uniform(0.0, PERIOD_S)
            tried += 1
            while crossed.any() and (begin_s := times[np.argmax(crossed)] - needed_s - ahead_s) > 0.0:
                ramp = Ramp(start + rates * begin_s, rates, latency_s, age_s, phase_s, burst)
                if _is_fair(ramp, settings, robot):
                    seen_s = stop_time(ramp, replace(settings, latency_s=latency_s), robot)
                    if seen_s is None or seen_s > ramp.learning_s[-1]:
                        yield ramp, seen_s
                        found += 1
                        break
                ahead_s *= EARLIER
            if found == number:
                return


def _is_fair(ramp: Ramp, settings: Settings, robot: Robot) -> bool:
    """True if the run can be stopped from its first sample until the sample interval is known, and crosses a limit if
    it is not stopped. Joints that brake each by itself leave the straight path; and if labels are not invariant, a run
    may begin in another branch than the one in which it was found."""
    in_time = [spare_of(ramp, learning_s, settings, robot) for learning_s in ramp.learning_s]
    return bool((np.array(in_time) >= 0.0).all() and (spare_of(ramp, None, settings, robot) < 0.0).any())


def stop_time(ramp: Ramp, settings: Settings, robot: Robot) -> float | None:
    """Time at which a sample leads to STOP, s; None if none does."""
    supervisor = Supervisor(settings, robot)
    names, rates = settings.joint_names, tuple(ramp.rates.tolist())
    for k in range(round(SEARCH_S / PERIOD_S)):
        stamp_ns, seen_ns = round(ramp.stamp_s(k) * NS_PER_S), round(ramp.arrival_s(k) * NS_PER_S)
        times = BEGIN_NS + stamp_ns, BEGIN_NS + seen_ns, NS_PER_S + seen_ns
        # A run begins in motion, when the verdict is still UNKNOWN for a while: the level of the sample itself counts.
        state = supervisor.step(JointSample(*times, names, ramp.read(k, settings), rates)).state
        if state is not None and state.level >= Level.STOP:
            return ramp.arrival_s(k)
    return None


def spare_of(ramp: Ramp, seen_s: float | None, settings: Settings, robot: Robot) -> Array:
    """(4,) distance of each margin to its stop limit until the robot stands, if it is stopped at a time."""
    brakes = np.array(settings.deceleration_limit)
    brake_s = SEARCH_S if seen_s is None else seen_s + ramp.latency_s
    times = np.linspace(0.0, brake_s + (np.abs(ramp.rates) / brakes).max(), FINE_STEPS)
    # The first sample determines the branch: where labels are not invariant it may be another one than at the start.
    begin = robot.mechanism.posture(ramp.read(0, settings), settings.assembly_mode)
    found = margins_along(robot, settings, ramp.at(times, brake_s, brakes), begin)
    return np.asarray(found.min(axis=0) - limits(settings, "stop"))
