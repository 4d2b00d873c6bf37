"""Parts of the guarantees of the planar loop: triangles whose sides are off, distances to arcs, errors of feet."""

from __future__ import annotations

from itertools import product
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from postures import some_postures
from singular_points import parallel_rods

import irsbot_kinematics as irs
from irsbot_kinematics.mechanisms.planar_pair import _least_sine as least_sine
from irsbot_kinematics.mechanisms.planar_pair import _opening as opening

Array = NDArray[np.float64]

FIVE_BAR = irs.make_robot("five_bar").mechanism
SHARES = np.linspace(-1.0, 1.0, 9)


def sides(rod: float, error: float, low: float, high: float) -> tuple[Array, Array, Array]:
    """Both rods and the distance of their near ends, on a grid."""
    a, b, d = np.meshgrid(rod + error * SHARES, rod + error * SHARES, np.linspace(low, high, 41))
    return a, b, d


@pytest.mark.parametrize("error", [0.0, 1e-3, 0.02])
@pytest.mark.parametrize(("low", "high"), [(0.2, 0.5), (0.6, 1.2), (1.0, 1.4), (0.9, 1.5)])
def test_the_least_sine_between_two_rods_is_that_of_the_worst_triangle(low: float, high: float, error: float) -> None:
    """Law of cosines. Where near ends are far apart the short rods are worst, and the bound is exact; else all but the
    square of the error is."""
    a, b, d = sides(0.8, error, low, high)
    cosine = (a * a + b * b - d * d) / (2.0 * a * b)
    worst = np.sqrt(1.0 - cosine * cosine).min()
    found = least_sine(low, high, 0.8, error)
    assert found <= worst + 1e-12
    assert worst - found <= 4.0 * (error / low) ** 2 + 1e-9


@pytest.mark.parametrize("error", [0.0, 1e-4, 2e-3])
@pytest.mark.parametrize(("low", "d", "high"), [(0.25, 0.3, 0.33), (0.6, 0.7, 0.9), (1.0, 1.3, 1.32), (1.3, 1.4, 1.45)])
def test_a_rod_opens_by_what_the_worst_triangle_says(low: float, d: float, high: float, error: float) -> None:
    """The angle between rod a and the line of the near ends, against that of equal rods d apart."""
    a, b, apart = sides(0.8, error, low, high)
    angle = np.arccos((a * a + apart * apart - b * b) / (2.0 * a * apart))
    worst = np.abs(angle - np.arccos(0.5 * d / 0.8)).max()
    found = opening(d, low, high, 0.8, error)
    assert found >= worst - 1e-12
    assert found - worst <= 5.0 * error + 1e-9


def test_an_opening_beyond_every_triangle_is_the_largest_there_is() -> None:
    """Near ends that may be closer than the errors of the rods: the angle is anything up to a half turn. Far
    apart, with long rods, they may be in line."""
    now = np.arccos(0.5 * 0.3 / 0.8)
    assert opening(0.3, 0.01, 0.31, 0.8, 0.02) == pytest.approx(np.pi - now)
    assert opening(1.55, 1.54, 1.58, 0.8, 0.02) == pytest.approx(np.arccos(0.5 * 1.55 / 0.8))


@pytest.mark.parametrize("error", [1e-3, 0.03])
@pytest.mark.parametrize(("r", "move"), [(0.5, 0.01), (0.7, 0.05), (0.9, 0.02), (1.1, 0.01), (0.9, 0.3)])
def test_the_floor_of_a_type_1_sine_is_that_of_the_worst_triangle_of_crank_and_rod(
    r: float, move: float, error: float
) -> None:
    g = FIVE_BAR.geometry
    a, b, far = np.meshgrid(g.l1 + error * SHARES, g.l2 + error * SHARES, np.linspace(r - move, r + move, 201))
    cosine = (far * far - a * a - b * b) / (2.0 * a * b)
    worst = np.sqrt(np.maximum(1.0 - cosine * cosine, 0.0)).min()
    assert FIVE_BAR._sine_floor(r, move, error) == pytest.approx(worst, abs=1e-9)


@pytest.mark.parametrize("slack", [1e-6, 1e-3])
@pytest.mark.parametrize("travel", [(0.0, 0.0), (2e-3, 5e-3)])
def test_the_type_2_bound_of_an_inexact_five_bar_is_that_of_its_worst_triangle(
    travel: tuple[float, float], slack: float
) -> None:
    """Elbows go by the cranks' travel and by the errors of motor and crank, rods are off by the slack."""
    g, ends = FIVE_BAR.geometry, (1.0 + np.sqrt(2.0)) * slack
    for at in some_postures(irs.make_robot("five_bar"), 30, seed=4, least=0.1):
        path = g.l1 * sum(travel) + 2.0 * ends
        a, b, d = sides(g.l2, slack, at.gaps[1] - path, at.gaps[1] + path)
        cosine = (a * a + b * b - d * d) / (2.0 * a * b)
        bound = FIVE_BAR.certified_bounds(at, travel, slack)
        assert bound.type2 == pytest.approx(
            np.sqrt(1.0 - cosine * cosine).min(), abs=1e-9 + 4.0 * (slack / d.min()) ** 2
        )


@pytest.mark.parametrize("name", ["five_bar", "irsbot2_beta45"])
def test_a_slack_that_tends_to_nothing_leaves_at_least_the_bounds_of_the_exact_machine(name: str) -> None:
    """The exact ones are of the ways of the elbows alone; here the better of two bounds of a turn counts."""
    robot = irs.make_robot(name)
    mechanism = robot.mechanism
    for at in some_postures(robot, 60, seed=4, least=0.1):
        exact, nearly = (mechanism.certified_bounds(at, (4e-3, 9e-3), slack) for slack in (0.0, 1e-13))
        assert nearly.type2 == pytest.approx(exact.type2, abs=1e-9)
        assert np.all(np.array(nearly.type1) >= np.array(exact.type1) - 1e-9)
        assert not nearly.constraint < exact.constraint - 1e-9


@pytest.mark.parametrize("lengths", [{}, {"l1": 0.3, "b": 0.1}, {"l1": 0.2, "b": 0.25}])
def test_the_clearance_of_a_five_bar_whose_rods_are_never_in_line_is_exact(lengths: dict[str, float]) -> None:
    """The nearer of the boundary and the curve of parallel rods of the working mode, scanned."""
    robot = irs.make_robot("five_bar", **lengths)
    mechanism = robot.mechanism
    g, number = mechanism.geometry, 8000
    drawn: Any = SimpleNamespace(b0=g.b, l1=g.l1, l2eq=g.l2, e=0.0)
    curve = parallel_rods(drawn, number)
    psi = np.tile(np.linspace(-np.pi, np.pi, number, endpoint=False), max(len(curve.x) // number, 1))
    signs = np.sign(np.sin(curve.q - psi[: len(curve.q), None])).astype(int)
    by_curve = 0
    for at in some_postures(robot, 400, seed=4):
        of_mode = (signs == at.working_mode).all(axis=1)
        away = np.hypot(curve.x[of_mode] - at.pose[0], curve.z[of_mode] - at.pose[1]).min(initial=np.inf)
        by_curve += away < min(at.reach)
        assert mechanism.clearance(at) == pytest.approx(min(*at.reach, away), abs=2.0 * np.pi * g.l2 / number)
    assert by_curve > 15 or g.b > g.l1


@pytest.mark.parametrize("name", ["irsbot2", "irsbot2_csc", "five_bar"])
def test_the_clearance_of_a_mirrored_posture_is_the_same(name: str) -> None:
    robot = irs.make_robot(name)
    mechanism = robot.mechanism
    for at in some_postures(robot, 40, seed=4, least=0.02):
        image = tuple((np.pi - np.array(at.joints[::-1])).tolist())
        met = [mechanism.posture(image, label) for label in mechanism.assembly_modes]
        mirrored = min(met, key=lambda one: np.hypot(one.pose[0] + at.pose[0], one.pose[1] - at.pose[1]))
        assert mechanism.clearance(mirrored) == pytest.approx(mechanism.clearance(at), abs=1e-9)


def test_the_foot_of_a_leg_has_no_bound_where_its_arm_may_point_along_an_axis() -> None:
    for beta in (0.2, 1.4):
        robot = irs.make_robot("irsbot2", beta=beta, b=0.45)
        mechanism = robot.mechanism
        edge = mechanism.geometry.a1 * min(beta, 0.5 * np.pi - beta)
        assert np.isfinite(mechanism.foot_error(0.999 * edge))
        assert mechanism.foot_error(1.001 * edge) == np.inf
        at = some_postures(robot, 1, seed=4, least=0.05)[0]
        assert mechanism.parts_left(at, 0.0, 1.001 * edge) == (0.0, 0.0, *at.parts[2:])
        assert mechanism.parts_left(at, 0.0, 1e-12) == pytest.approx(at.parts, abs=1e-9)


@pytest.mark.parametrize(("b", "drop"), [(0.2, 0.0), (0.05, 0.1), (0.2, -0.15)])
def test_poses_lie_in_the_ranges_of_the_workspace_and_nearly_fill_them(b: float, drop: float) -> None:
    mechanism = irs.make_robot("irsbot2", b=b, e=drop).mechanism
    robot, grid = irs.Robot(mechanism), np.linspace(-1.6, 1.6, 161)
    places = np.array(list(product(grid, grid)))
    _, status, _ = robot.inverse_many(places, (1, -1))
    inside = places[status == irs.Status.SOLVED]
    (left, right), (bottom, top) = mechanism.workspace_ranges()
    wide, deep = mechanism.symmetric_extent()
    x, z = inside.T
    assert left <= x.min() <= x.max() <= right
    assert bottom <= z.min() <= z.max() <= top
    np.testing.assert_allclose([left, right, bottom, top], [x.min(), x.max(), z.min(), z.max()], atol=0.05)
    assert wide >= np.abs(x).max()
    assert deep <= min(z.min(), -z.max())
    np.testing.assert_allclose([wide, deep], [np.abs(x).max(), -np.abs(z).max()], atol=0.12)
