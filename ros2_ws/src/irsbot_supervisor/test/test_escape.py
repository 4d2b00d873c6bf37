"""The way out of a stop, against directions at random and differences of margins."""

from __future__ import annotations

import numpy as np
import pytest
from supervised import settings_of

from irsbot_kinematics import Mechanism, Posture, Status
from irsbot_msgs_py.records import Cause, Finding, Level
from irsbot_supervisor.core.escape import LEAST_GROWTH, NEARLY, NO_ESCAPE, escape_of
from irsbot_supervisor.core.margins import MARGIN_CAUSES, margins_of, margins_of_legs, slopes
from irsbot_supervisor.core.stopping import limits_of
from irsbot_supervisor.sim.closed_loop import GuidedRobot
from irsbot_supervisor.validation.harness.oracle import Array, good_postures, joint_ranges, margins, margins_along

Q = (2.618, 2.618)

AT_REST_BEATS = 20
"""Heartbeats after which a robot stands, and is OK if nothing stops it."""


def finding(cause: Cause, level: Level = Level.STOP) -> Finding:
    return Finding(cause, level, 0.1, 0.2, "1", "")


def growth(ways: Array, directions: Array) -> Array:
    """Least share of the directions (N, n) along unit vectors (K, n)."""
    return np.asarray((directions @ (ways / np.linalg.norm(ways, axis=1)[:, None]).T).min(axis=1))


def asymmetric() -> Posture:
    """Every margin of it has a slope."""
    return settings_of("irsbot2")[1].mechanism.posture((Q[0] + 0.1, Q[1]), -1)


@pytest.mark.parametrize("kind", range(3), ids=["type1", "type2", "constraint"])
def test_slopes_are_derivatives_of_margins(kind: int) -> None:
    """Against the difference of fourth order with ten times the step."""
    mechanism, at, step = settings_of("irsbot2")[1].mechanism, asymmetric(), 1e-3

    def margin(joint: int, away: float) -> float:
        joints = tuple(q + away * (j == joint) for j, q in enumerate(at.joints))
        return margins_of(mechanism.track(joints, at))[kind]

    near = [margin(joint, step) - margin(joint, -step) for joint in range(2)]
    far = [margin(joint, 2.0 * step) - margin(joint, -2.0 * step) for joint in range(2)]
    derivatives = (8.0 * np.array(near) - far) / (12.0 * step)
    assert np.abs(derivatives).max() > 0.01
    assert slopes(mechanism, at, kind) == pytest.approx(derivatives, rel=1e-4, abs=1e-7)


@pytest.mark.parametrize(
    ("found", "causes"),
    [
        ([finding(Cause.POSITION)], Cause.POSITION),
        ([finding(Cause.REACTION), finding(Cause.POSITION | Cause.BRAKING)], Cause.POSITION),
        ([finding(Cause.TYPE1, Level.WARN), finding(Cause.POSITION)], Cause.POSITION),
        ([finding(Cause.TYPE1 | Cause.BRAKING)], Cause.TYPE1),
        ([finding(Cause.TYPE2 | Cause.BRAKING), finding(Cause.TYPE2)], Cause.TYPE2),
        ([finding(Cause.CONSTRAINT), finding(Cause.POSITION)], Cause.CONSTRAINT | Cause.POSITION),
    ],
)
def test_the_way_out_names_the_causes_that_it_serves(found: list[Finding], causes: Cause) -> None:
    _settings, robot = settings_of("irsbot2")
    at, into_range = asymmetric(), (1.0, -1.0)
    out = escape_of(robot.mechanism, at, found, into_range)
    assert out.causes == causes
    assert np.hypot(*out.direction) == pytest.approx(1.0)
    if out.causes & Cause.POSITION:
        assert np.dot(out.direction, into_range) > 0.0
    ahead = robot.mechanism.track(tuple(np.add(at.joints, np.multiply(1e-3, out.direction))), at)
    for kind, cause in enumerate(MARGIN_CAUSES):
        if out.causes & cause:
            assert margins_of(ahead)[kind] > margins_of(at)[kind]


@pytest.mark.parametrize("found", [[], [finding(Cause.REACTION)], [finding(Cause.POSITION, Level.WARN)]])
def test_where_nothing_is_known_to_help_there_is_no_way_out(found: list[Finding]) -> None:
    _settings, robot = settings_of("irsbot2")
    assert escape_of(robot.mechanism, robot.mechanism.posture(Q, -1), found, (1.0, 0.0)) == NO_ESCAPE


def test_a_joint_range_does_not_lead_towards_a_margin_that_stops() -> None:
    """Where both cannot be served, the margin is."""
    _settings, robot = settings_of("irsbot2")
    at = asymmetric()
    steepest = np.array(slopes(robot.mechanism, at, 1))
    found = [finding(Cause.POSITION), finding(Cause.TYPE2)]
    out = escape_of(robot.mechanism, at, found, tuple((-steepest).tolist()))
    assert out.causes == Cause.TYPE2
    assert out.direction == pytest.approx(steepest / np.linalg.norm(steepest))


@pytest.mark.parametrize("share", [0.3, 0.5, 0.6])
def test_a_joint_range_that_lies_between_the_opposites_of_two_margins_is_left_out(share: float) -> None:
    """The three have no direction in common, though no two of them are opposite."""
    mechanism, at = settings_of("irsbot2")[1].mechanism, asymmetric()
    found = [finding(Cause.TYPE1), finding(Cause.CONSTRAINT)]
    out = escape_of(mechanism, at, found, (0.0, 0.0))
    assert out.causes == Cause.TYPE1 | Cause.CONSTRAINT
    one, other = (np.array(slopes(mechanism, at, kind)) for kind in (0, 2))
    against = -share * one / np.linalg.norm(one) - (1.0 - share) * other / np.linalg.norm(other)
    assert escape_of(mechanism, at, [*found, finding(Cause.POSITION)], tuple(against.tolist())) == out


def ascents(mechanism: Mechanism, at: Posture, kind: int) -> Array:
    """(K, n) one-sided gradients of a margin in the legs that are near to be the worst."""
    here = np.array(margins_of_legs(at)[kind])
    legs = np.flatnonzero(here <= (1.0 + NEARLY) * here.min())
    steps = 1e-6 * np.eye(len(at.joints))
    ahead = [margins_of_legs(mechanism.track(tuple((at.joints + step).tolist()), at))[kind] for step in steps]
    return ((np.array(ahead) - here) / 1e-6)[:, legs].T


@pytest.mark.parametrize("name", ["irsbot2", "five_bar", "rrr3", "orthoglide", "ruu4", "rails2"])
def test_all_margins_that_stop_grow_and_no_other_direction_serves_the_worst_of_them_better(name: str) -> None:
    settings, robot = settings_of(name)
    rng, served = np.random.default_rng(4), 0
    directions = rng.normal(size=(20_000, len(settings.velocity_limit)))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    for q in good_postures(robot, settings, 10, rng).tolist():
        at = robot.mechanism.posture(tuple(q), settings.assembly_mode)
        kinds = [kind for kind, legs in enumerate(margins_of_legs(at)) if legs and np.isfinite(legs).all()]
        ways = {kind: ascents(robot.mechanism, at, kind) for kind in kinds}
        kinds = [kind for kind in kinds if (np.linalg.norm(ways[kind], axis=1) > 1e-6).all()]
        together = np.vstack([ways[kind] for kind in kinds])
        best = growth(together, directions).max()
        out = escape_of(robot.mechanism, at, [finding(MARGIN_CAUSES[kind]) for kind in kinds], (0.0,) * len(q))
        if best > 1.1 * LEAST_GROWTH:
            assert out.causes == sum(MARGIN_CAUSES[kind] for kind in kinds)
            assert growth(together, np.array([out.direction]))[0] >= best - 1e-3
            served += len(together) > 1
        for kind in kinds:
            if out.causes & MARGIN_CAUSES[kind]:
                worst = slopes(robot.mechanism, at, kind)
                assert np.dot(worst, out.direction) >= 0.9 * LEAST_GROWTH * np.linalg.norm(worst)
    assert served, "no posture has a direction for all: the fixture proves nothing"


@pytest.mark.parametrize(
    ("name", "joints"),
    [
        ("rails2", (0.297843, 0.277615, 0.277583)),
        ("ruu4", (-0.069172, -0.069813, -0.064438, -0.070447)),
        ("rrr3_base", (2.30762, 1.93265, 2.04327)),
        ("irsbot2_beta45", (-1.587, -1.5547)),
    ],
)
def test_only_margins_that_grow_are_named(name: str, joints: tuple[float, ...]) -> None:
    """Next to a Type 2 singularity there is a posture on one side alone; where two legs are equal, both count."""
    settings, robot = settings_of(name)
    at = robot.mechanism.posture(joints, settings.assembly_mode)
    out = escape_of(robot.mechanism, at, [finding(cause) for cause in MARGIN_CAUSES], (0.0,) * len(joints))
    assert bool(out.causes) == bool(out.direction)
    ahead = robot.mechanism.track(tuple(np.add(joints, np.multiply(2e-5, out.direction)).tolist()), at)
    for kind, cause in enumerate(MARGIN_CAUSES):
        if out.causes & cause:
            assert margins_of(ahead)[kind] > margins_of(at)[kind]


@pytest.mark.parametrize("name", ["orthoglide", "linear_delta", "rrr3"])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_margin_falls_towards_where_there_is_no_posture(name: str, sign: float) -> None:
    """At the last posture that the first joint reaches, a margin beyond counts as 0."""
    settings, robot = settings_of(name)
    mechanism, mode = robot.mechanism, settings.assembly_mode
    first, *others = good_postures(robot, settings, 1, np.random.default_rng(0))[0].tolist()

    def at(q: float) -> Posture:
        return mechanism.posture((q, *others), mode)

    inner = outer = first
    while at(outer).status == Status.SOLVED:
        inner, outer = outer, outer + 0.02 * sign
    for _ in range(40):
        middle = 0.5 * (inner + outer)
        inner, outer = (middle, outer) if at(middle).status == Status.SOLVED else (inner, middle)
    for kind in (0, 1):
        assert sign * slopes(mechanism, at(inner), kind)[0] < 0.0


def stuck(name: str) -> GuidedRobot:
    """A robot that stands beyond a stop limit, but not at a singularity."""
    settings, robot = settings_of(name)
    low, high = joint_ranges(robot)
    places = np.random.default_rng(1).uniform(low, high, (20_000, len(low)))
    found, stop = margins(robot, settings, places), np.array(limits_of(settings, "stop"))
    beyond = (found > 0.4 * stop).all(axis=1) & (found < 0.8 * stop).any(axis=1)
    for place in places[beyond].tolist():  # some are in another working mode
        guided = GuidedRobot(robot, settings, tuple(place))
        for _ in range(AT_REST_BEATS):
            guided.drift()
        if guided.now.level == Level.STOP:
            return guided
    raise AssertionError("no place is beyond a limit")


@pytest.mark.parametrize("name", ["irsbot2", "five_bar", "orthoglide", "triaglide"])
def test_a_robot_that_follows_the_way_out_can_be_reset_where_it_ends(name: str) -> None:
    """All along, the margins that stop it grow."""
    guided = stuck(name)
    settings, robot = guided.settings, guided.supervisor.robot
    assert "still there" in guided.reset()
    at = robot.mechanism.posture(guided.drives.now.position, settings.assembly_mode)
    ways, speed = [], np.array(settings.velocity_limit)
    while out := guided.supervisor.escape.direction:
        if len(ways) % 10 == 0:
            here = np.array(guided.drives.now.position)
            now, ahead = margins_along(robot, settings, np.array([here, here + 1e-4 * np.array(out)]), at)
            for kind, cause in enumerate(MARGIN_CAUSES):
                if guided.supervisor.escape.causes & cause:
                    assert ahead[kind] > now[kind]
        ways.append(out)
        guided.beat(tuple((speed * out).tolist()))
        assert len(ways) < 800, "it does not end"
    assert np.ptp(np.array(ways), axis=0).max() > 1e-4, "always the same direction"
    for _ in range(AT_REST_BEATS):
        guided.drift()
    assert guided.reset() == ""
