"""Certified margins over what a robot can reach until it stands, against postures from the batch solver."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import product
from math import inf, nan

import numpy as np
import pytest
from supervised import settings_of

import irsbot_kinematics as irs
from irsbot_supervisor.campaign.reachable import errors, reach
from irsbot_supervisor.campaign.truth import good_postures, joint_ranges, margins, margins_along, supervised
from irsbot_supervisor.core.assess import margins_of
from irsbot_supervisor.core.estimation.estimate import Speeds
from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.core.stopping import (
    HALVINGS,
    MORE_HALVINGS,
    BoxBounds,
    StoppingPredictor,
    limits_of,
    spare_of,
)

Array = np.ndarray
every_robot = pytest.mark.parametrize("name", irs.robots())
shipped = cache(settings_of)


@cache
def postures(name: str, number: int = 12, least: float = 0.05) -> list[irs.Posture]:
    """Random postures in the usual assembly mode with all margins above `least`, over the whole joint range."""
    (settings, robot), rng = shipped(name), np.random.default_rng(7)
    low, high = joint_ranges(robot)
    Q = rng.uniform(low, high, (120 * number, len(low)))
    good = np.flatnonzero(margins(robot, settings, Q).min(axis=1) > least)[:number]
    assert len(good) >= number // 2, f"{len(good)} postures of {robot}: the fixture proves nothing"
    return [robot.mechanism.posture(tuple(Q[i].tolist()), settings.assembly_mode) for i in good]


def speeds_of(rng: np.random.Generator, settings: Settings, share: float) -> Speeds:
    most = share * np.array(settings.velocity_limit)
    return Speeds(tuple(rng.uniform(0.0, most)), tuple(rng.uniform(0.0, most)))


def box_of(settings: Settings, at: irs.Posture, speeds: Speeds, ahead_s: float) -> tuple[Array, Array]:
    """The box of the theorem, by the oracle of the campaign."""
    horizon_s, error = ahead_s + settings.latency_s, errors(settings)
    ahead, back = (reach(np.array([side]), horizon_s, settings)[0] for side in speeds)
    return np.array(at.joints) - back - error, np.array(at.joints) + ahead + error


def met(name: str, settings: Settings, at: irs.Posture, low: Array, high: Array, rng: np.random.Generator) -> Array:
    """(4,) smallest margins at the corners of a box and at random points in it."""
    robot, n = shipped(name)[1], len(low)
    inner = 60 if robot.mechanism.labels_hold else 6
    shares = np.vstack((np.array(list(product((0.0, 1.0), repeat=n))), rng.uniform(size=(inner, n))))
    points = low + shares * (high - low)
    if robot.mechanism.labels_hold:
        return margins(robot, settings, points).min(axis=0)
    return np.min([margins_along(robot, settings, q[None], at)[0] for q in points], axis=0)


# --- never above what is met -------------------------------------------------------------------------------------


@every_robot
@pytest.mark.parametrize(("ask", "slack_m"), [("predict", 0.0), ("once", 0.0), ("wanted", 0.0), ("predict", 1e-4)])
def test_no_margin_in_the_reachable_box_is_below_its_bound(name, ask, slack_m):
    """Also where what is proved is taken from the box of an earlier sample: the robot goes on by small steps."""
    settings, robot = shipped(name)
    settings = replace(settings, encoder_offset=2e-4, geometry_tolerance_m=slack_m)
    rng, predictor = np.random.default_rng(3), StoppingPredictor(settings, robot.mechanism)
    told = 0
    for at in postures(name):
        speeds = speeds_of(rng, settings, rng.choice([0.0, 0.1, 0.5]))
        for _ in range(2):
            ahead_s = float(rng.choice([0.0, 0.002, 0.01]))
            if ask == "wanted":
                floor = predictor.predict(at, speeds, ahead_s, limits_of(settings, "stop"))
            else:
                floor = getattr(predictor, ask)(at, speeds, ahead_s)
            low, high = box_of(settings, at, speeds, ahead_s)
            least = met(name, settings, at, low, high, rng)
            there = np.isfinite(margins_of(at))
            assert (np.isinf(floor) == ~there).all()
            assert (np.array(floor)[there] <= least[there] + 1e-9).all(), f"{floor} where {least} is met"
            told += min(floor) > 0.0
            step = tuple((np.array(at.joints) + rng.normal(0.0, 1e-3, len(low))).tolist())
            at = robot.mechanism.track(step, at)
            if at.status != irs.Status.SOLVED:
                break
    assert told >= 2, "nothing is ever told: the fixture proves nothing"


@pytest.mark.parametrize("name", supervised())
def test_robots_in_good_postures_are_not_stopped_for_a_bound_alone(name):
    """At rest, 2 ms ahead: where all that is met is 1.5 times the warning limit, or 0.5."""
    settings, robot = shipped(name)
    rng, predictor, bites = np.random.default_rng(5), StoppingPredictor(settings, robot.mechanism), 0
    speeds = Speeds(*((0.0,) * len(settings.velocity_limit),) * 2)
    for q in good_postures(robot, settings, 12, rng).tolist():
        at = robot.mechanism.posture(tuple(q), settings.assembly_mode)
        least = met(name, settings, at, *box_of(settings, at, speeds, 0.002), rng)
        if (least >= np.minimum(1.5 * np.array(limits_of(settings, "warn")), 0.5)).all():
            bites += 1
            assert spare_of(predictor.predict(at, speeds, 0.002), limits_of(settings, "stop")) >= 0.0
    assert bites >= 4, "the fixture proves nothing"


# --- what makes a bound smaller ----------------------------------------------------------------------------------


def fresh(name: str, at: irs.Posture, speeds: Speeds, ahead_s: float, **changes) -> Array:
    """The quickest bound, which grows with nothing that makes the box larger."""
    settings, robot = shipped(name)
    predictor = StoppingPredictor(replace(settings, **{"latency_s": 1e-3, **changes}), robot.mechanism)
    return np.array(predictor.predict(at, speeds, ahead_s, (-inf,) * 4))


@every_robot
def test_longer_times_higher_speeds_and_larger_errors_never_raise_a_bound(name):
    settings, _ = shipped(name)
    rng, lower = np.random.default_rng(4), 0
    for at in postures(name, least=0.2)[:6]:
        slow = speeds_of(rng, settings, 0.02)
        fast = Speeds(*(tuple(2.0 * np.array(side)) for side in slow))
        base = fresh(name, at, slow, 0.002)
        for worse in (
            fresh(name, at, slow, 0.006),
            fresh(name, at, fast, 0.002),
            fresh(name, at, slow, 0.002, latency_s=5e-3),
            fresh(name, at, slow, 0.002, encoder_offset=1e-3),
            fresh(name, at, slow, 0.002, encoder_resolution=2e-3),
            fresh(name, at, slow, 0.002, stamp_jitter_s=1e-3),
            fresh(name, at, slow, 0.002, deceleration_limit=tuple(0.5 * np.array(settings.deceleration_limit))),
        ):
            assert (worse <= base + 1e-12).all()
            lower += (worse[:2] < base[:2]).any()
    assert lower >= 8, "nothing made a bound smaller: the fixture proves nothing"


def test_a_robot_whose_arm_is_longer_than_it_should_be_is_within_the_bounds():
    settings, robot = shipped("irsbot2")
    wrong = 1e-3
    settings = replace(settings, geometry_tolerance_m=wrong)
    predictor, rng = StoppingPredictor(settings, robot.mechanism), np.random.default_rng(8)
    rest, geometry = Speeds((0.0,) * 2, (0.0,) * 2), robot.mechanism.geometry
    for at in postures("irsbot2"):
        floor = np.array(predictor.predict(at, rest, 0.002))
        low, high = box_of(settings, at, rest, 0.002)
        points = low + rng.uniform(size=(100, 2)) * (high - low)
        for size in (wrong, -wrong):
            other = irs.make_robot("irsbot2", l1=geometry.l1 + size)
            least = margins(other, settings, points).min(axis=0)
            assert (floor <= least + 1e-9).all()


# --- bounded work, and proofs that are used again ------------------------------------------------------------------


class Counted:
    """A mechanism that counts the boxes that are bounded."""

    def __init__(self, mechanism: irs.Mechanism) -> None:
        self._mechanism, self.boxes = mechanism, 0

    def __getattr__(self, name):
        return getattr(self._mechanism, name)

    def guarantee(self, *args):
        self.boxes += 1
        return self._mechanism.guarantee(*args)


@every_robot
def test_the_work_for_one_sample_is_bounded_however_near_a_limit_the_robot_is(name):
    """The box as it is, and per limit a wider one and itself: each begins as one box, and every cut makes two."""
    settings, robot = shipped(name)
    counted, whole = Counted(robot.mechanism), 2 ** len(robot.mechanism.joints)
    most = 1 + 2 * (1 + 2 * HALVINGS * whole) + 2 * (1 + 2 * MORE_HALVINGS * whole)
    rng, cut = np.random.default_rng(6), 0
    # Limits between what is met and what is proved are those that all cuts are spent on.
    for at in postures(name, 24):
        now = np.where(np.isfinite(margins_of(at)), margins_of(at), 1.0)
        limits = {
            f"{kind}_{which}": float(share * value)
            for kind, value in zip(("type1", "type2", "constraint", "limb"), now, strict=True)
            for which, share in (("warn", 0.95), ("stop", 0.9))
        }
        predictor = StoppingPredictor(replace(settings, **limits), counted)
        for share in (0.02, 0.2):
            counted.boxes = 0
            predictor.predict(at, speeds_of(rng, settings, share), 0.002)
            assert counted.boxes <= most
            cut += counted.boxes > 5
    assert cut >= 3, "nothing was cut: the fixture proves nothing"


def near_a_limit(name: str) -> tuple[Settings, irs.Robot, irs.Posture]:
    """Settings under which the quickest box does not do, but a cut one does."""
    settings, robot = shipped(name)
    rest = Speeds(*((0.0,) * len(settings.velocity_limit),) * 2)
    for at in postures(name, least=0.3):
        quick = StoppingPredictor(settings, robot.mechanism).predict(at, rest, 0.002, (0.0,) * 4)
        for more in (0.002, 0.01, 0.03):
            limit = {f"{kind}_warn": min(quick[:2]) + more for kind in ("type1", "type2")}
            changed = replace(settings, hysteresis=0.0, **limit)
            later = replace(changed, latency_s=1.5 * settings.latency_s)  # of a wider box, too
            found = StoppingPredictor(later, robot.mechanism).predict(at, rest, 0.002)
            if min(found[:2]) >= min(limit.values()):
                return changed, robot, at
    raise AssertionError("no such posture: the fixture proves nothing")


@pytest.mark.parametrize("name", ["irsbot2", "orthoglide", "rrr3"])
@pytest.mark.parametrize("ask", ["predict", "once"])
def test_what_was_proved_serves_boxes_that_lie_in_it_and_no_others(name, ask):
    settings, robot, at = near_a_limit(name)
    n, counted = len(at.joints), Counted(robot.mechanism)
    predictor, rest = StoppingPredictor(settings, counted), Speeds(*((0.0,) * len(at.joints),) * 2)
    floor = getattr(predictor, ask)(at, rest, 0.002)
    counted.boxes = 0
    assert getattr(predictor, ask)(at, rest, 0.002) == floor
    assert counted.boxes <= 1, "the same box is proved already"  # the quickest look
    for far in (0.3, 3.0):
        low, high = box_of(settings, at, rest, 0.002)
        for sign in (-1.0, 1.0):
            moved = tuple((np.array(at.joints) + sign * far * (high - low) * (np.arange(n) == 0)).tolist())
            there, counted.boxes = robot.mechanism.track(moved, at), 0
            anew = StoppingPredictor(settings, counted)
            other = getattr(predictor, ask)(there, rest, 0.002)
            assert other == getattr(anew, ask)(there, rest, 0.002), "a box that is not contained is bounded by itself"
    counted.boxes = 0
    getattr(predictor, ask)(at, Speeds(*(settings.velocity_limit,) * 2), 0.002)
    assert counted.boxes >= 2, "a larger box is none that was proved"


def test_new_settings_forget_what_was_proved():
    from supervised import configure, ready, sample

    supervisor, q = ready(pose=(0.9, -0.6))
    before = supervisor.step(sample(0, q)).state.stop_margin
    supervisor.step(configure(1, supervisor, encoder_offset=2e-3, geometry_tolerance_m=1e-3))
    assert supervisor.step(sample(2, q)).state.stop_margin < before


@every_robot
def test_what_is_not_proved_is_not_told(name):
    """Limits of 1 cannot be proved, and what is told is still met."""
    settings, robot = shipped(name)
    rng = np.random.default_rng(2)
    strict = replace(settings, **{f"{kind}_{which}": 1.0 for kind in ("type1", "type2") for which in ("warn", "stop")})
    predictor = StoppingPredictor(strict, robot.mechanism)
    for at in postures(name)[:4]:
        speeds = speeds_of(rng, settings, 0.1)
        least = met(name, settings, at, *box_of(settings, at, speeds, 0.002), rng)
        floor = predictor.predict(at, speeds, 0.002)
        there = np.isfinite(margins_of(at))
        assert min(floor[:2]) < 1.0
        assert (np.array(floor)[there] <= least[there] + 1e-9).all()


@pytest.mark.parametrize("name", ["irsbot2_beta45", "rrr3_base"])
def test_a_box_across_a_singularity_promises_nothing_of_it(name):
    settings, robot = shipped(name)
    most = Speeds(*(settings.velocity_limit,) * 2)
    for at in postures(name):
        floor = StoppingPredictor(settings, robot.mechanism).predict(at, most, 1.0)
        assert min(floor[:2]) <= 0.0


# --- what is not known ----------------------------------------------------------------------------------------------


@every_robot
@pytest.mark.parametrize("bad", [nan, inf, 1e308, 1e200])
@pytest.mark.parametrize("ask", ["predict", "once"])
def test_speeds_that_are_none_promise_nothing(name, bad, ask):
    """All margins that there are fall to 0, and no others."""
    settings, robot = shipped(name)
    at = postures(name)[0]
    n, there = len(at.joints), np.isfinite(margins_of(at))
    for joint in range(n):
        one = tuple(bad if k == joint else 0.1 for k in range(n))
        for speeds in (Speeds(one, (0.0,) * n), Speeds((0.0,) * n, one)):
            floor = np.array(getattr(StoppingPredictor(settings, robot.mechanism), ask)(at, speeds, 0.002))
            assert (floor[there] == 0.0).all()
            assert np.isinf(floor[~there]).all()


@pytest.mark.parametrize("bad", [nan, inf, 1e300])
@pytest.mark.parametrize("name", ["five_bar", "irsbot2", "orthoglide", "ruu4"])
def test_a_time_without_end_promises_nothing(name, bad):
    settings, robot = shipped(name)
    at, n = postures(name)[0], len(settings.velocity_limit)
    for ask in ("predict", "once"):
        floor = getattr(StoppingPredictor(settings, robot.mechanism), ask)(at, Speeds((0.0,) * n, (0.0,) * n), bad)
        assert min(floor) == 0.0
        assert not np.isnan(floor).any()


@pytest.mark.parametrize("bad", [nan, inf, 1e308])
@pytest.mark.parametrize("name", ["five_bar", "irsbot2", "orthoglide", "ruu4"])
def test_rates_that_are_none_promise_nothing_of_a_steady_way(name, bad):
    settings, robot = shipped(name)
    at = postures(name)[0]
    floor = StoppingPredictor(settings, robot.mechanism).along(
        at, (bad,) * len(at.joints), 0.002, limits_of(settings, "stop")
    )
    assert min(floor) <= 0.0
    assert not np.isnan(floor).any()


@pytest.mark.parametrize("bad", [nan, inf])
def test_a_box_that_is_none_holds_nothing(bad):
    _settings, robot = shipped("irsbot2")
    at = postures("irsbot2")[0]
    floor = BoxBounds(robot.mechanism, 0.0).least(at, (bad, 0.0), (bad, 0.1), (((0.1,) * 4, 4),))
    assert min(floor) <= 0.0
    assert not np.isnan(floor).any()
