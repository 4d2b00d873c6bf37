"""Slow motion after a stop and during a bypass: velocities and positions have to agree."""

from __future__ import annotations

from math import nan

import pytest
from bypassed import BEYOND, bypass, stopped
from estimates import accepted, estimator, good, moving, watch
from supervised import BOUNDARY, approach, feed, joints_of, newest, ready, sample, settings_of

from irsbot_msgs_py.records import Level
from irsbot_supervisor.core.estimation.estimate import Estimate
from irsbot_supervisor.core.pace import Pace

LIMITS = {"recovery_share": 0.1, "standstill_speed": 0.02, "velocity_limit": [2.0, 5.0]}


def pace_after(estimates: list[Estimate]) -> Pace:
    settings, robot = settings_of("irsbot2", **LIMITS)
    pace = Pace(settings, robot.mechanism.joints)
    for estimate in estimates:
        pace.look(estimate)
    return pace


def moved(rates, stated, end_ms: int = 120) -> list[Estimate]:
    return [good(one) for one in watch(estimator(**LIMITS), moving(rates, stated, 0, end_ms))]


@pytest.mark.parametrize("joint", [0, 1])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_slow_is_the_recovery_share_of_the_fastest_and_what_counts_as_standstill(joint: int, sign: float):
    estimates, rates = moved((0.0, 0.0), (0.0, 0.0)), [0.0, 0.0]
    pace, limit = pace_after(estimates), 0.1 * LIMITS["velocity_limit"][joint]
    for extra, slow in ((0.019, True), (0.021, False), (nan, False)):
        rates[joint] = sign * (limit + extra)
        assert pace.is_slow(estimates[-1]._replace(velocity=tuple(rates))) == slow


@pytest.mark.parametrize("joint", [0, 1])
@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("share", "slow"), [(0.95, True), (1.2, False)])
def test_positions_count_whatever_the_message_says_of_velocities(joint: int, sign: float, share: float, slow: bool):
    rates = [0.0, 0.0]
    rates[joint] = sign * (share * 0.1 * LIMITS["velocity_limit"][joint] + share * 0.02)
    estimates = moved(rates, (0.0, 0.0))
    assert pace_after(estimates).is_slow(estimates[-1]._replace(velocity=(0.0, 0.0))) == slow


def test_nothing_is_known_before_the_first_interval_is_over_unless_the_robot_stands():
    rates = (0.1, 0.0)
    estimates = moved(rates, rates)
    assert [pace_after(estimates[:n]).is_slow(estimates[n - 1]) for n in (1, 40, 52)] == [False, False, True]
    resting = moved((0.0, 0.0), (0.0, 0.0))
    assert pace_after(resting[-1:]).is_slow(resting[-1])
    assert not pace_after(resting[:10]).is_slow(resting[9])


def test_the_mean_speed_over_a_silence_shows_nothing():
    filter_ = estimator(**LIMITS)
    estimates = [good(one) for one in watch(filter_, moving((0.1, 0.0), (0.1, 0.0), 0, 60))]
    after = good(filter_.update(accepted(300, (0.006, 1.0), (0.1, 0.0))))
    assert pace_after(estimates).is_slow(estimates[-1])
    assert not pace_after([*estimates, after]).is_slow(after)


@pytest.mark.parametrize("rate", [0.55, 0.9, 1.5])
@pytest.mark.parametrize("reported", [1.0, 0.0], ids=["true", "zeros"])
def test_a_bypass_ends_when_a_joint_is_faster_than_slow_whatever_the_message_says(rate: float, reported: float):
    """0.05 of 12 rad/s, and 0.02 rad/s that count as standstill."""
    supervisor, joints = stopped()
    assert supervisor.step(bypass(1)).refusal == ""
    goal = joints_of(supervisor, BEYOND[0], -0.9)
    way = [b - a for a, b in zip(joints, goal, strict=True)]
    unit = [w / max(map(abs, way)) for w in way]
    levels = []
    for ms in range(2, 160):
        at = [a + 1e-3 * rate * (ms - 1) * u for a, u in zip(joints, unit, strict=True)]
        supervisor.step(sample(ms, at, [reported * rate * u for u in unit]))
        levels.append(supervisor.view is not None and bool(supervisor.view.judgement.bypassed))
    assert levels[-1] == (rate < 0.6)
    assert levels[0] or reported


@pytest.mark.parametrize(("rate", "share"), [(0.5, 0.05), (1.0, 0.0)])
def test_a_stop_is_left_slowly_by_the_positions_too(rate: float, share: float):
    """The message says that the robot stands."""
    supervisor, q = ready(pose=BOUNDARY)
    steps = feed(supervisor, [approach(q, ms, (-6.0, 0.0)) for ms in range(1, 75)])
    assert newest(steps).level == Level.STOP
    start, found = approach(q, 74, (-6.0, 0.0)).position, []
    for ms in range(75, 300):
        at = (start[0] + 1e-3 * rate * (ms - 74), start[1])
        step = supervisor.step(sample(ms, at))
        found += [step.verdict] if step.verdict is not None else []
    assert (found[-1].level, found[-1].speed_scale) == (Level.STOP, share)
