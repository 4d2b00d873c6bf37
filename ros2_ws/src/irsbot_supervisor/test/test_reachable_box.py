"""How far joints get until they stand, against simulated drives: the worst one, and any other within the limits."""

from __future__ import annotations

from dataclasses import replace
from math import inf, isfinite, isnan, nan

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from supervised import settings_of

from irsbot_supervisor.core.estimation.estimate import Speeds
from irsbot_supervisor.core.reachable_box import ReachableBox, position_error
from irsbot_supervisor.core.settings import Settings

Array = np.ndarray
limits = st.fixed_dictionaries(
    {
        "fastest": st.floats(0.5, 30.0),
        "gain": st.floats(5.0, 500.0),
        "brake": st.floats(5.0, 500.0),
        "free_s": st.floats(0.0, 0.1),
    }
)


def settings_with(fastest: float, gain: float, brake: float, **changes) -> Settings:
    each = {"velocity_limit": (fastest,) * 2, "acceleration_limit": (gain,) * 2, "deceleration_limit": (brake,) * 2}
    return replace(settings_of()[0], **each, **changes)


def driven(v: float, wishes: Array, brakes: Array, fastest: float, gain: float, brake: float, free_s: float) -> Array:
    """(K, N) positions, from 0, of joints that speed up by `wishes` (K, N; share of `gain`, the sign is the direction)
    for the free time, and then brake with `brakes` (K, N; rad/s2, at least `brake`). Where a wish goes against the
    motion, the joint slows down with `brakes`. Exact, but a little short where a joint becomes as fast as it can."""
    count = len(wishes)
    h = max(free_s, 1e-6) / count
    speed, q, track = np.full(wishes.shape[1], v), np.zeros(wishes.shape[1]), []
    for k in range(count):
        end = speed + wishes[k] * gain * h
        slower = np.sign(speed) * np.maximum(np.abs(speed) - brakes[k] * h, 0.0)
        end = np.clip(np.where(wishes[k] * speed < 0.0, slower, end), -fastest, fastest)
        q = q + 0.5 * (speed + end) * h
        speed = end
        track.append(q)
    for k in range(count):  # at rest at the end of this, or later, by which the way is only underestimated
        h = fastest / brake / count
        end = np.sign(speed) * np.maximum(np.abs(speed) - brakes[k] * h, 0.0)
        q = q + np.where(end == 0.0, 0.5 * speed * np.abs(speed) / brakes[k], 0.5 * (speed + end) * h)
        speed = end
        track.append(q)
    return np.array(track)


@given(limits, st.floats(0.0, 1.0))
def test_the_way_until_rest_is_that_of_the_worst_drive(limit, share):
    """Full acceleration for all the time there is, then the least braking: 500 steps each."""
    limit = dict(limit)
    free_s, v = limit.pop("free_s"), share * limit["fastest"]
    reach = ReachableBox(settings_with(**limit))
    (ahead, _), (back, _) = reach.until_rest(Speeds((v, 0.0), (0.0, v)), free_s)
    ones = np.ones((500, 1))
    worst = driven(v, ones, limit["brake"] * ones, free_s=free_s, **limit)[-1, 0]
    assert ahead == pytest.approx(worst, rel=5e-3, abs=1e-6)
    assert back == pytest.approx(
        driven(0.0, ones, limit["brake"] * ones, free_s=free_s, **limit)[-1, 0], rel=5e-3, abs=1e-6
    )
    (_, other), (_, behind) = reach.until_rest(Speeds((v, 0.0), (0.0, v)), free_s)
    assert (other, behind) == (back, ahead)


@pytest.mark.parametrize("seed", range(30))
def test_no_joint_moves_farther_than_the_bound_until_the_brakes_act(seed):
    """It speeds up with any share of what it can, slows down as hard as it likes, turns round, and brakes at least as
    hard as configured; anywhere on the way."""
    rng = np.random.default_rng(seed)
    fastest, share, free_s = rng.uniform(0.5, 30.0), rng.uniform(), rng.uniform(1e-4, 0.1)
    limit = {"fastest": fastest, "gain": rng.uniform(5.0, 500.0), "brake": rng.uniform(5.0, 500.0)}
    changes = rng.integers(1, 60)
    wishes = np.repeat(rng.choice([-1.0, 0.0, 1.0, 1.0], (-(-300 // changes), 60)), changes, axis=0)[:300]
    brakes = limit["brake"] * rng.uniform(1.0, 1.0 + 20.0 * (seed % 2), (300, 60))
    for v in (share * fastest, -share * fastest):
        track = driven(v, wishes, brakes, free_s=free_s, **limit)
        speeds = Speeds((max(v, 0.0), fastest), (max(-v, 0.0), fastest))
        (ahead, any_ahead), (back, any_back) = ReachableBox(settings_with(**limit)).until_rest(speeds, free_s)
        assert track.max() <= ahead + 1e-9
        assert -track.min() <= back + 1e-9
        assert ahead <= any_ahead
        assert back <= any_back
        going, going_back = ReachableBox(settings_with(**limit)).going(speeds, free_s)
        assert track[:300].max() <= going[0] + 1e-9
        assert -track[:300].min() <= going_back[0] + 1e-9
        assert np.abs(np.diff(track[:300], axis=0)).sum(axis=0).max() <= ReachableBox(settings_with(**limit)).longest(
            free_s
        )[0] * (1.0 + 1e-9)


@given(limits, st.floats(0.0, 1.0), st.floats(0.0, 0.5), st.floats(0.0, 0.1))
def test_more_speed_and_more_time_never_make_a_way_shorter(limit, share, more, later_s):
    limit = dict(limit)
    free_s, v = limit.pop("free_s"), share * limit["fastest"]
    reach, faster = ReachableBox(settings_with(**limit)), min(v + more, limit["fastest"])
    least = reach.until_rest(Speeds((v, v), (v, v)), free_s)[0][0]
    assert reach.until_rest(Speeds((faster, v), (v, v)), free_s)[0][0] >= least
    assert reach.until_rest(Speeds((v, v), (v, v)), free_s + later_s)[0][0] >= least - 1e-15
    assert reach.stop_s(Speeds((v, v), (v, v)), free_s + later_s) >= reach.stop_s(Speeds((v, 0.0), (0.0, 0.0)), free_s)


def test_at_rest_the_way_is_that_of_the_sheet():
    """a T^2/2 + (a T)^2/(2d): 57.6 mrad for 400 rad/s2 and 12 ms."""
    settings = settings_with(12.0, 400.0, 400.0)
    assert ReachableBox(settings).until_rest(Speeds((0.0,) * 2, (0.0,) * 2), 0.012)[0] == pytest.approx([0.0576] * 2)


@given(limits, st.floats(0.0, 1.0))
def test_a_stop_lasts_until_the_fastest_joint_stands(limit, share):
    limit = dict(limit)
    free_s, v = limit.pop("free_s"), share * limit["fastest"]
    last = min(v + limit["gain"] * free_s, limit["fastest"])
    found = ReachableBox(settings_with(**limit)).stop_s(Speeds((0.0, v), (0.0, 0.0)), free_s)
    assert found == pytest.approx(free_s + last / limit["brake"])


@given(limits, st.floats(-1.0, 1.0), st.floats(0.0, 1.0), st.floats(0.0, 1.0), st.floats(1.0, 20.0))
def test_joints_that_keep_their_rates_are_between_the_ends_of_each_part_of_their_path(
    limit, share, first, braked, harder
):
    """They brake at any time of the part, at least as hard as configured; the hardly braking and the latest reach the
    far end."""
    limit = dict(limit)
    last_s, v = limit.pop("free_s"), share * limit["fastest"]
    first_s = first * last_s
    braked_s = first_s + braked * (last_s - first_s)
    (low, _), (high, _) = ReachableBox(settings_with(**limit)).following((v, 0.0), first_s, last_s)
    going = v * np.linspace(first_s, braked_s, 50)
    stops = [going[-1] + v * abs(v) / (2.0 * k * limit["brake"]) for k in (1.0, harder)]
    for met in (going, np.linspace(going[-1], stops[0], 50), np.linspace(going[-1], stops[1], 50)):
        assert low - 1e-12 <= met.min() <= met.max() <= high + 1e-12
    latest = v * last_s + v * abs(v) / (2.0 * limit["brake"])
    assert sorted((v * first_s, latest)) == pytest.approx([low, high], abs=1e-12)


def test_a_joint_that_is_beyond_its_limit_goes_on_as_it_is():
    reach = ReachableBox(settings_with(2.0, 100.0, 10.0))
    assert reach.until_rest(Speeds((5.0, 0.0), (0.0, 0.0)), 0.1)[0][0] == pytest.approx(0.5 + 1.25)
    assert reach.stop_s(Speeds((5.0, 0.0), (0.0, 0.0)), 0.1) >= 0.1 + 0.5


@pytest.mark.parametrize("bad", [nan, inf, 1e200, 1e308])
@pytest.mark.parametrize("free_s", [0.0, 0.01])
def test_a_speed_that_is_none_gets_any_distance(bad, free_s):
    """Infinite, no number, or farther than any joint goes; in both directions, and of either joint."""
    reach = ReachableBox(settings_of()[0])
    for speeds in (Speeds((bad, 0.0), (0.0, 0.0)), Speeds((0.0, bad), (0.0, 0.0)), Speeds((0.0, 0.0), (0.0, bad))):
        forward, backward = reach.until_rest(speeds, free_s)
        assert not sum(forward) + sum(backward) < 1e200


@pytest.mark.parametrize("bad", [nan, inf])
def test_a_time_that_is_none_takes_a_joint_any_distance(bad):
    for v in (0.0, 3.0, 12.0, 13.0):
        forward, _ = ReachableBox(settings_of()[0]).until_rest(Speeds((v, v), (v, v)), bad)
        assert all(isnan(way) or not isfinite(way) for way in forward)


def test_errors_are_half_a_step_the_offset_and_the_motion_during_the_jitter():
    settings = settings_with(12.0, 400.0, 400.0, encoder_resolution=2e-3, encoder_offset=1e-2, stamp_jitter_s=1e-4)
    assert position_error(settings) == pytest.approx(0.011)
    assert ReachableBox(settings).errors == pytest.approx((0.011 + 1.2e-3,) * 2)
