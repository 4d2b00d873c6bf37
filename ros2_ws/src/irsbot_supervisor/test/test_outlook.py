"""The braking path against an integration of its own, and its certified margins against what is met along it."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import pairwise, product
from math import inf, nan

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from supervised import settings_of

import irsbot_kinematics as irs
from irsbot_kinematics import Status
from irsbot_supervisor.core.assess import margins_of
from irsbot_supervisor.core.outlook import Foresight, limits_of
from irsbot_supervisor.settings_file import shipped_values

Array = np.ndarray
every_robot = pytest.mark.parametrize("name", irs.robots())
ALL_CUT = {f"{kind}_warn": 1.0 for kind in ("type1", "type2", "constraint", "limb")}
"""Warnings that are never satisfied: the braking path is cut as often as it may be."""

AHEAD = st.sampled_from([0.0, 0.001, 0.02])


shipped = cache(settings_of)


def foresight(name: str, **changes) -> tuple[Foresight, irs.Robot]:
    settings, robot = shipped(name)
    settings = replace(settings, **changes)  # unchecked: the path holds for limits that no robot could keep, too
    return Foresight(settings, robot.mechanism), robot


def posture(robot: irs.Robot, *pose: float) -> irs.Posture:
    joints = tuple(robot.inverse(pose).tolist())
    return robot.mechanism.posture(joints, robot.mechanism.usual_assembly_mode)


@cache
def postures(name: str, number: int, least: float) -> list[irs.Posture]:
    """Random postures in the usual assembly mode with all margins above `least`, over the whole joint range."""
    robot, rng = shipped(name)[1], np.random.default_rng(7)
    mechanism = robot.mechanism
    low = np.array([max(j.lower, -np.pi) if j.is_angle else j.lower for j in mechanism.joints])
    high = np.array([min(j.upper, np.pi) if j.is_angle else j.upper for j in mechanism.joints])
    Q = rng.uniform(low, high, (60 * number, len(low)))
    good = np.flatnonzero(worst(robot, Q).min(axis=1) > least)[:number]
    assert len(good) >= number // 2, f"{len(good)} postures of {robot}: the fixture proves nothing"
    return [mechanism.posture(tuple(Q[i].tolist()), mechanism.usual_assembly_mode) for i in good]


def worst(robot: irs.Robot, Q: Array) -> Array:
    """(N, 4) smallest margins of each kind, -1 where not assembled, infinite where the robot has none."""
    found = robot.evaluate_many(Q)
    solved = (found.status == Status.SOLVED)[:, None]
    limb = found.limb_margin.min(axis=1) if found.limb_margin.shape[1] else np.full(len(Q), np.inf)
    constraint = np.where(np.isnan(found.constraint_margin), np.inf, found.constraint_margin)
    columns = np.column_stack((found.type1_margin.min(axis=1), found.type2_margin, constraint, limb))
    return np.where(solved, columns, -1.0)


def worst_along(robot: irs.Robot, path: Array, at: irs.Posture) -> Array:
    """`worst` on a path that begins next to a posture: where labels do not hold its branch is followed."""
    if robot.mechanism.labels_hold:
        return worst(robot, path)
    rows = []
    for q in path.tolist():
        at = robot.mechanism.track(tuple(q), at)
        if at.status != Status.SOLVED:
            return np.array([*rows, (-1.0,) * 4])
        rows.append(margins_of(at))
    return np.array(rows)


def integrated(q: Array, v: Array, a: Array, brake: Array, latency_s: float, times: Array) -> Array:
    """(len(times), n) joint positions: constant acceleration for the latency, then each joint slows down until it
    stands. The velocity of each joint, written down as a function of time, is summed up by the trapezoidal rule."""
    fine = np.linspace(0.0, times[-1], 8001)  # a kink costs brake * step^2 / 8, 3e-8 at most
    end = v + a * latency_s
    braked = np.maximum(np.abs(end)[:, None] - brake[:, None] * np.maximum(fine - latency_s, 0.0), 0.0)
    rate = np.where(fine < latency_s, v[:, None] + a[:, None] * fine, np.sign(end)[:, None] * braked)
    steps = 0.5 * (rate[:, 1:] + rate[:, :-1]) * np.diff(fine)
    way = np.concatenate((np.zeros((len(v), 1)), np.cumsum(steps, axis=1)), axis=1)
    return q + np.column_stack([np.interp(times, fine, column) for column in way])


# --- the path ---------------------------------------------------------------------------------------------------


@given(
    rates=st.tuples(st.floats(-12.0, 12.0), st.floats(-12.0, 12.0)),
    gains=st.tuples(st.floats(0.0, 400.0), st.floats(0.0, 400.0)),
    latency_s=st.floats(0.0, 0.05),
    ahead_s=AHEAD,
    brakes=st.tuples(st.floats(20.0, 1000.0), st.floats(20.0, 1000.0)),
)
def test_the_braking_path_is_the_integral_of_what_the_drives_do(rates, gains, latency_s, ahead_s, brakes):
    """While they speed up, or go on as they are."""
    seer, robot = foresight("irsbot2", latency_s=latency_s, deceleration_limit=brakes)
    at = posture(robot, 0.0, -0.85)
    speeding = tuple(gain if rate >= 0.0 else -gain for rate, gain in zip(rates, gains, strict=True))
    v, a, brake, delay_s = np.array(rates), np.array(speeding), np.array(brakes), latency_s + ahead_s
    way = seer.way(at, rates, ahead_s, speeding)
    travel = way.travel
    end = v + a * delay_s
    assert way.stop_s == pytest.approx(delay_s + (np.abs(end) / brake).max(), abs=1e-12)
    assert travel == pytest.approx(0.5 * (v + end) * delay_s + end * np.abs(end) / (2.0 * brake), abs=1e-12)
    times = np.linspace(0.0, max(way.stop_s, 1e-6), 9)
    expected = integrated(np.array(at.joints), v, a, brake, delay_s, times)
    for time_s, joints in zip(times, expected, strict=True):
        assert seer.position(way, time_s) == pytest.approx(joints, abs=2e-6)


@given(
    rates=st.tuples(st.floats(-12.0, 12.0), st.floats(-12.0, 12.0)),
    gains=st.tuples(st.floats(-400.0, 400.0), st.floats(-400.0, 400.0)),
    share=st.floats(0.0, 1.0),
    latency_s=st.floats(1e-4, 0.05),
)
def test_slowing_down_and_turning_round_are_within_the_reach_and_near_the_chords(rates, gains, share, latency_s):
    """Of every joint by itself, whatever share of its slowing down lasts."""
    seer, robot = foresight("irsbot2", latency_s=latency_s, encoder_resolution=0.0, encoder_offset=0.0)
    at = posture(robot, 0.0, -0.85)
    v, a = np.array(rates), np.array(gains)
    brake = np.array(shipped("irsbot2")[0].deceleration_limit)
    way = seer.way(at, rates, 0.0, gains)
    steady = seer.way(at, rates, 0.0, tuple(np.where(v * a < 0.0, 0.0, a)))
    reach = np.array(seer.reach(rates, gains, latency_s))
    times = np.linspace(0.0, max(way.stop_s, steady.stop_s), 400)
    lasting = np.where(v * a < 0.0, share * a, a)
    assert (
        np.abs(integrated(np.array(at.joints), v, lasting, brake, latency_s, times) - at.joints) <= reach + 1e-6
    ).all()
    path = integrated(np.array(at.joints), v, a, brake, latency_s, times)
    for begin, end in pairwise(sorted([*np.linspace(0.0, way.stop_s, 6), latency_s])):
        part = (times >= begin) & (times <= end)
        first, last = np.array(seer.position(way, begin)), np.array(seer.position(way, end))
        along = (times[part] - begin)[:, None] / max(end - begin, 1e-12)
        off = np.abs(path[part] - (first + along * (last - first)))
        assert (off <= np.array(seer.bend(way, begin, end)) + 2e-6).all()


def test_a_sample_that_is_late_counts_like_latency():
    late, robot = foresight("irsbot2", latency_s=0.01)
    prompt, _ = foresight("irsbot2", latency_s=0.03)
    at = posture(robot, 0.1, -0.9)
    assert late.foresee(at, (6.0, -4.0), 0.02) == prompt.foresee(at, (6.0, -4.0), 0.0)


# --- certified margins ------------------------------------------------------------------------------------------


def checked(
    name: str, at: irs.Posture, rates, ahead_s: float, error: Array, seer: Foresight, gains: Array
) -> tuple[Array, Array]:
    """The certified floor and the smallest margins met on the densely sampled braking path, if the joints are wrong
    by `error` and go on with the accelerations `gains`. Raises AssertionError where the floor is not below."""
    settings, robot = shipped(name)
    brake = np.array(settings.deceleration_limit)
    times = np.linspace(0.0, seer.way(at, tuple(rates), ahead_s, tuple(gains)).stop_s, 200)
    path = integrated(np.array(at.joints) + error, np.array(rates), gains, brake, settings.latency_s + ahead_s, times)
    met = worst_along(robot, path, at).min(axis=0)
    floor = np.array(seer.foresee(at, tuple(rates), ahead_s, acceleration=tuple(gains)))
    assert not np.isnan(floor).any()
    there = np.isfinite(margins_of(at))  # a margin that the robot does not have is infinite, assembled or not
    assert np.isinf(floor[~there]).all()
    kept = floor[there] <= np.maximum(met[there], 0.0) + 1e-6
    assert kept.all(), f"{name}: promised {floor}, met {met} from {at.joints} {rates}"
    return floor, met


@pytest.mark.parametrize("name", [name for name in irs.robots() if shipped_values(irs.make_robot(name))])
def test_nobody_is_stopped_for_a_bound_alone_where_the_braking_path_is_well_within_the_warning_limits(name):
    rng, bites = np.random.default_rng(3), 0
    settings, robot = shipped(name)
    seer = Foresight(settings, robot.mechanism)
    stop, enough = np.array(limits_of(settings, "stop")), 1.5 * np.array(limits_of(settings, "warn"))
    for at in postures(name, 30, float(settings.type2_warn)):
        for speed in (0.3, 0.6, 1.0):
            rates = speed * rng.uniform(-1.0, 1.0, len(at.joints)) * settings.velocity_limit
            floor, met = checked(name, at, rates, 0.001, np.zeros(len(at.joints)), seer, np.zeros(len(at.joints)))
            if (met >= np.minimum(enough, 0.75)).all():
                bites += 1
                assert (floor >= stop).all(), f"{rates} from {at.joints}: {floor} where {met} is met"
    assert bites >= 20, "the fixture proves nothing"


@every_robot
def test_the_work_for_one_sample_is_bounded_however_near_a_limit_the_robot_is(name, monkeypatch):
    """While the outlook computes the robot goes on. Counted over approaches that need all cuts, with joints that slow
    down, so that both ways are looked at: 2 stretches and 2 more for each cut, and the postures between them."""
    settings, robot = shipped(name)
    cuts = 4 + 10
    seer, kind = Foresight(settings, robot.mechanism), type(robot.mechanism)
    calls = {"track": 0, "guarantee": 0, "guarantee_along": 0}

    def counted(what):
        original = getattr(kind, what)

        def call(self, *args):
            calls[what] += 1
            return original(self, *args)

        return call

    for what in calls:
        monkeypatch.setattr(kind, what, counted(what))
    rng, most, cut = np.random.default_rng(4), np.array(settings.velocity_limit), 0
    for at in postures(name, 60, 0.02):
        for share in (0.1, 0.3, 1.0):
            rates = share * rng.uniform(-1.0, 1.0, len(most)) * most
            for what in calls:
                calls[what] = 0
            gains = tuple(-0.5 * np.sign(rates) * settings.deceleration_limit)
            seer.foresee(at, tuple(rates), 0.002, acceleration=gains)
            assert calls["guarantee"] <= 1 + calls["guarantee_along"]  # courses may be bounded as boxes
            assert calls["guarantee_along"] <= 2 * (2 + 2 * cuts)
            assert calls["track"] <= 2 * (2 + 2 * cuts + cuts + 2)
            cut += calls["guarantee_along"] > 8
    assert cut >= 3, "no way was cut: the fixture proves nothing"


@every_robot
def test_a_joint_that_turns_round_to_where_it_was_is_cut_as_finely_as_one_that_goes_on(name):
    """After the latency it is where it began and as fast as then: begin and end of the stretch say nothing of it."""
    rng, asked = np.random.default_rng(9), 0
    settings, robot = shipped(name)
    seer = Foresight(settings, robot.mechanism)
    brake = np.array(settings.deceleration_limit)
    gains = rng.choice([-1.0, 1.0], len(brake)) * brake
    rates = -0.5 * gains * (settings.latency_s + 0.001)
    for at in postures(name, 40, 0.02):
        floor, met = checked(name, at, rates, 0.001, np.zeros(len(brake)), seer, gains)
        steady = seer.foresee(at, tuple(rates), 0.001)
        stop = np.array(limits_of(settings, "stop"))
        if (np.minimum(met, steady) > 1.2 * stop).all():
            asked += 1
            assert (floor >= stop).all(), f"from {at.joints}: {floor} where {met} is met"
    assert asked >= 5, "the fixture proves nothing"


@every_robot
@pytest.mark.parametrize("changes", [{}, ALL_CUT], ids=["shipped", "cut"])
def test_no_margin_on_the_braking_path_is_below_its_certified_floor(name, changes):
    """Random postures over the whole range, random velocities up to the limit, some of them with accelerations; and
    the floor is worth something: where nothing comes near on the way, it is not 0."""
    rng = np.random.default_rng(5)
    error = 2e-4
    seer, _robot = foresight(name, encoder_offset=error - 0.5e-5, **changes)
    limits = np.array(shipped(name)[0].velocity_limit)
    useful, near = [], 0
    for at in postures(name, 40, 0.02):
        rates = rng.uniform(-1.0, 1.0, len(limits)) * limits * 10.0 ** rng.uniform(-2.0, 0.0)
        wrong = rng.choice([-error, 0.0, error], len(limits))
        gains = rng.choice([0.0, 0.0, 0.5]) * rng.uniform(-1.0, 1.0, len(limits)) * shipped(name)[0].deceleration_limit
        floor, met = checked(name, at, rates, rng.choice([0.0, 0.005]), wrong, seer, gains)
        finite = np.isfinite(met)
        if (met[finite] > 0.2).all() and not gains.any():
            useful.append((floor[finite] / met[finite]).min())
        near += (met < 0.1).any()
    assert len(useful) >= 5, "no way is free: the fixture proves nothing"
    assert near >= 1, "nothing comes near: the fixture proves nothing"
    assert np.median(useful) > 0.5, f"the floor promises too little: {np.median(useful):.2f} of what is met"


@every_robot
def test_a_robot_at_rest_keeps_its_margins_but_for_the_error_of_its_encoders(name):
    seer, robot = foresight(name, encoder_resolution=0.0, **ALL_CUT)
    for at in postures(name, 40, 0.02)[:20]:
        floor = np.array(seer.foresee(at, (0.0,) * len(at.joints), 0.0))
        now = worst(robot, np.array([at.joints]))[0]
        assert (floor <= now + 1e-12).all()
        assert (floor[np.isfinite(now)] >= now[np.isfinite(now)] - 1e-6).all()


@given(speed=st.floats(2.0, 12.0), ahead_s=AHEAD, z=st.floats(-0.62, -0.48))
def test_a_way_that_leads_across_parallel_rods_promises_nothing_of_type_2_although_its_end_looks_good(
    speed, ahead_s, z
):
    """Symmetric arms of irsbot2_beta45 swing towards each other: the elbows meet where b0 + l1 cos q2 = 0, and part
    again in the other order. Between, the rods were parallel, and no posture at the end tells."""
    seer, robot = foresight("irsbot2_beta45")
    at = posture(robot, 0.0, z)
    geometry = robot.mechanism.geometry

    def elbow(q2: float) -> float:
        return geometry.b0 + geometry.l1 * np.cos(q2)

    rates = (speed, -speed) if elbow(at.joints[1]) > 0.0 else (-speed, speed)
    assume(elbow(at.joints[1] + seer.way(at, rates, ahead_s).travel[1]) * elbow(at.joints[1]) < 0.0)
    assert seer.foresee(at, rates, ahead_s)[1] == 0.0


# --- what is not known ------------------------------------------------------------------------------------------


@every_robot
@pytest.mark.parametrize("bad", [nan, inf, -inf, 1e308, 1e200])
def test_velocities_that_are_no_velocities_promise_nothing(name, bad):
    seer, _robot = foresight(name)
    at = max(postures(name, 40, 0.02), key=lambda one: min(one.cos_pressure))
    for joint in range(len(at.joints)):
        rates = tuple(bad if k == joint else 0.1 for k in range(len(at.joints)))
        floor = seer.foresee(at, rates, 0.0)
        assert [value for value in floor if value < inf] == [0.0] * (4 - floor.count(inf))
        assert floor[0] == floor[1] == 0.0


def test_a_latency_without_end_promises_nothing():
    seer, robot = foresight("irsbot2")
    at = posture(robot, 0.0, -0.85)
    for ahead_s in (inf, nan, 1e300):
        assert max(seer.foresee(at, (1.0, 1.0), ahead_s)[:2]) == 0.0


@pytest.mark.parametrize("name", [n for n in irs.robots() if n.startswith("irsbot2")])
def test_the_constraint_margin_of_an_irsbot2_is_a_number_wherever_it_is_assembled(name):
    """NaN there means to the supervisor that the robot has no such margin, and nothing is compared."""
    robot = irs.make_robot(name)
    rng = np.random.default_rng(11)
    turn = np.arange(-np.pi, np.pi, np.pi / 6)
    for q in [*product(turn, turn), *rng.uniform(-np.pi, np.pi, (500, 2))]:
        for assembly in robot.mechanism.assembly_modes:
            at = robot.mechanism.posture(tuple(map(float, q)), assembly)
            if at.status == Status.SOLVED:
                assert 0.0 <= at.constraint <= 1.5
                floor = robot.mechanism.guarantee(at, (0.05, 0.05)).constraint
                assert 0.0 <= floor <= at.constraint + 1e-12


@pytest.mark.parametrize("rate", [1.0, inf, nan])
@pytest.mark.parametrize("name", ["five_bar", "irsbot2", "orthoglide"])
def test_a_margin_that_a_robot_does_not_have_is_never_a_reason(name: str, rate: float):
    """Where nothing can be bounded, all margins that there are fall to 0, and no others."""
    settings, robot = shipped(name)
    at = postures(name, 20, 0.3)[0]
    floors = Foresight(settings, robot.mechanism).foresee(at, (rate,) * len(at.joints), 100.0)
    there = [True, True, at.constraint == at.constraint, bool(at.limb)]
    assert [floor == 0.0 for floor in floors] == there
    assert [floor == inf for floor in floors] == [not here for here in there]
