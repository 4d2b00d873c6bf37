"""Settings that contradict themselves are refused with both numbers; what could work is not."""

from __future__ import annotations

from dataclasses import asdict, replace
from math import pi

import numpy as np
import pytest
from supervised import settings_of

import irsbot_kinematics as irs
from irsbot_kinematics import Status
from irsbot_supervisor.configuration import feasibility as limits
from irsbot_supervisor.configuration import stoppable_speed as room
from irsbot_supervisor.configuration.feasibility import settings_from
from irsbot_supervisor.configuration.loading import shipped_values
from irsbot_supervisor.core.settings import InvalidSettings
from irsbot_supervisor.core.stopping import limits_of

SHIPPED = [name for name in irs.robots() if shipped_values(irs.make_robot(name))]


def refused(robot: str = "irsbot2", **changes) -> str:
    with pytest.raises(InvalidSettings) as caught:
        settings_of(robot, **changes)
    return str(caught.value)


def margins(robot: irs.Robot, path: np.ndarray) -> np.ndarray:
    """(N, 4) margins along joint positions, from the public evaluation: -1 where not assembled."""
    found = robot.evaluate_many(path)
    limb = found.limb_margin.min(axis=1) if found.limb_margin.shape[1] else np.full(len(path), np.inf)
    constraint = np.where(np.isnan(found.constraint_margin), np.inf, found.constraint_margin)
    columns = np.column_stack((found.type1_margin.min(axis=1), found.type2_margin, constraint, limb))
    return np.where((found.status == Status.SOLVED)[:, None], columns, -1.0)


def test_a_stop_distance_longer_than_any_margin_is_refused_with_both_numbers():
    """0.01 s at 12 rad/s and 12^2/(2 * 20) rad of braking are 3.72 rad. No crank of this robot may turn that far:
    from straight to folded its Type 1 margin passes 0 within half a turn of crank against rod."""
    stated = refused(deceleration_limit=20.0)
    assert "needs 3.72 rad to stop from velocity_limit (12.0; deceleration_limit 20.0, latency_s 0.01)" in stated
    assert "_stop (0." in stated
    within = float(stated.split("within ")[1].split(" rad")[0])
    assert 0.5 < within < pi
    speed = float(stated.split(f"{within} rad: ")[1].split(" rad/s")[0])
    assert speed * 0.01 + speed**2 / 40.0 == pytest.approx(within, rel=0.01)  # the two are rounded to three digits


@pytest.mark.parametrize("name", ["irsbot2", "five_bar", "orthoglide", "rrr3", "rrr3_base", "linear_delta"])
def test_the_speed_that_a_refusal_calls_possible_is_accepted_and_a_little_more_is_not(name):
    settings, _robot = settings_of(name)
    fast = [20.0 * speed for speed in settings.velocity_limit]
    stated = refused(name, velocity_limit=fast)
    possible = float(stated.rsplit(": ", 1)[1].split(" ")[0])
    first = int(stated.split("'")[1].rsplit("_", 1)[1]) - 1
    slow = [0.98 * possible if k == first else 1e-3 for k in range(len(fast))]
    assert settings_of(name, velocity_limit=slow)
    slow[first] = 1.1 * possible
    assert "can be stopped" in refused(name, velocity_limit=slow)


@pytest.mark.parametrize("name", irs.robots())
def test_the_stoppable_speed_holds_along_the_whole_stopping_path(name):
    settings, robot = settings_of(name)
    n, mechanism = len(robot.mechanism.joints), robot.mechanism
    patterns = limits.single_joint_patterns(0, n)
    found = room.find_stoppable_speed(settings, mechanism, room.candidates(settings, mechanism), patterns, most=8.0)
    assert found.share > 1.0, "shipped settings leave room"
    ways = np.linspace(0.0, 1.0, 200)[:, None] * np.array([found.travel, [-way for way in found.travel]])[:, None, :]
    for way in ways:
        path = np.array(found.at.joints) + way
        if mechanism.label_is_invariant:
            assert (margins(robot, path) >= np.array(limits_of(settings, "stop"))).all()
    speed, brake = found.share * settings.velocity_limit[0], settings.deceleration_limit[0]
    assert found.travel[0] == pytest.approx(speed * (settings.latency_s + 0.5 * speed / brake), rel=1e-12)


def test_a_stop_limit_above_the_largest_margin_is_refused_with_both_numbers():
    """sigma_y^2 = sum over both legs of 2 (c s fx/N)^2, and c |fx| <= N: sigma_y is at most 2 sin(10 deg) = 0.347."""
    stated = refused(constraint_stop=0.5, constraint_warn=0.5)
    assert "constraint_stop (0.5, largest constraint margin 0.34" in stated
    assert "type1_stop" not in stated


def test_errors_that_take_a_margin_away_are_named():
    stated = refused(geometry_tolerance_m=0.1)
    assert "geometry_tolerance_m 0.1 alone" in stated
    assert "_stop (0." in stated


def test_every_shipped_robot_could_run_half_as_fast_again_with_all_joints_at_once():
    """Limits are refused joint by joint; the shipped ones leave room for any combination, though."""
    for name in SHIPPED:
        settings, robot = settings_of(name)
        n = len(robot.mechanism.joints)
        corners = [tuple(1.0 if k >> j & 1 else -1.0 for j in range(n)) for k in range(2**n)]
        places = room.candidates(settings, robot.mechanism)
        assert room.find_stoppable_speed(settings, robot.mechanism, places, corners, most=1.25).share == 1.25, name


def test_a_change_that_contradicts_other_settings_is_refused_in_the_call():
    settings, robot = settings_of()
    for change in ({"deceleration_limit": (20.0, 400.0)}, {"latency_s": 0.5}, {"type2_stop": 0.83, "type2_warn": 0.9}):
        with pytest.raises(InvalidSettings):
            settings_from({**asdict(settings), **change}, robot)
    assert settings_from(asdict(settings), robot) == settings


def test_modes_in_which_the_robot_is_hardly_ever_found_are_not_judged():
    """The usual Orthoglide has no posture with these signs at all; what the supervision says there decides."""
    settings, robot = settings_of("orthoglide", working_mode=[1, 1, -1])
    assert len(room.postures(settings, robot.mechanism).joints) < limits.FEWEST
    assert limits.infeasibilities(replace(settings, velocity_limit=(1e4,) * 3), robot.mechanism) == []


def test_postures_are_found_once_per_geometry_and_modes():
    first, robot = settings_of()
    again, other = settings_of(type1_stop=0.1)
    assert robot.mechanism is not other.mechanism
    assert room.postures(first, robot.mechanism) is room.postures(again, other.mechanism)
    five_bar = settings_of("five_bar")
    assert room.postures(five_bar[0], five_bar[1].mechanism) is not room.postures(first, robot.mechanism)
