"""Maps against closed forms of the sheet, against single postures, and against the loci's own equations."""

from __future__ import annotations

import math

import numpy as np
import pytest

import irsbot_kinematics as irs
from irsbot_kinematics.analysis.rectangle import Limits, largest_rectangle
from irsbot_kinematics.analysis.workspace_maps import (
    Box,
    joint_map,
    reachable_box,
    workspace_map,
)
from irsbot_kinematics.numerics.arithmetic import ARRAYS

LOCUS_TOL = 1e-7
"""1: |sin| on a published locus: a point rounded at 1e-16 m at the boundary leaves the square root of it."""


def test_the_free_rectangle_is_that_of_the_closed_form() -> None:
    """Sheet section 11: max over w of 2 w (sqrt((l1 + l2eq)^2 - (w + |b0|)^2) - (l2eq - l1)) = .7197 at w = .698."""
    mechanism = irs.make_robot("irsbot2").mechanism
    found = largest_rectangle(mechanism, Limits(0.0, 0.0, 0.0), (1, -1))
    w = np.linspace(0.5, 0.9, 40001)
    closed = 2.0 * w * (np.sqrt(1.2**2 - (w + 0.014567765) ** 2) - 0.45)
    assert closed.max() == pytest.approx(0.7197, abs=5e-5)  # the printed number
    assert 0.995 * closed.max() < found.area <= closed.max()


def test_the_reached_area_is_that_of_the_circles() -> None:
    """Both legs reach: two annuli with radii .45 and 1.2 about (-+b0, 0), counted on a grid four times as fine."""
    mechanism = irs.make_robot("irsbot2").mechanism
    found = workspace_map(mechanism, (1, -1), reachable_box(mechanism), (401, 401))
    x, z = np.meshgrid(np.linspace(-1.2, 1.2, 1601), np.linspace(-1.2, 1.2, 1601))
    far = [np.hypot(x - foot, z) for foot in (-0.0145677650, 0.0145677650)]
    inside = np.logical_and.reduce([(r <= 1.2) & (r >= 0.45) for r in far])
    assert found.area == pytest.approx(inside.sum() * 0.0015**2, rel=2e-3)


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_a_map_at_a_turn_that_is_no_number_is_refused(bad: float) -> None:
    mechanism = irs.make_robot("rpr3").mechanism
    with pytest.raises(irs.BadInput, match="must be finite"):
        workspace_map(mechanism, (-1, -1, -1), Box((0.0, 0.3), (0.0, 0.3), (bad,)), (5, 5))


def test_a_map_agrees_with_single_postures() -> None:
    robot = irs.make_robot("irsbot2_beta45")
    found = workspace_map(robot.mechanism, (1, -1), Box((-0.4, 0.4), (-0.95, -0.6), ()), (9, 8))
    for row, z in enumerate(found.second):
        for column, x in enumerate(found.first):
            single = robot.evaluate(robot.inverse((x, z), (1, -1)))
            assert found.type1[row, column] == pytest.approx(min(single.type1_margin), abs=1e-12)
            assert found.type2[row, column] == pytest.approx(single.type2_margin, abs=1e-12)
            assert found.constraint[row, column] == pytest.approx(single.constraint_margin, abs=1e-12)
            assert found.assembly[row, column] == single.assembly_mode


@pytest.mark.parametrize("name", ["irsbot2", "irsbot2_beta45", "irsbot2_csc", "five_bar"])
def test_margins_vanish_on_every_locus(name: str) -> None:
    mechanism = irs.make_robot(name).mechanism
    seen = 0
    for mode in mechanism.working_modes:
        for curve in mechanism.loci(mode):
            points = curve.points[np.isfinite(curve.points).all(axis=1)]
            if not len(points):
                continue
            joints, reach = mechanism.inverse(ARRAYS, tuple(points.T), mode)
            screws = mechanism.legs(ARRAYS, joints, tuple(points.T)).screws
            if curve.kind == "type2":
                det = screws[0][0] * screws[1][1] - screws[0][1] * screws[1][0]
                assert np.abs(det).max() < LOCUS_TOL
            else:
                assert np.abs(np.minimum(*reach)).max() < LOCUS_TOL
            seen += len(points)
    assert seen > 1000, "no loci: the fixture proves nothing"


def test_type_2_arcs_below_the_base_are_those_of_the_sheet() -> None:
    """Sheet section 11, beta = 45 deg, mode (+,-): z in [-0.514, -0.373] and [-1.136, -0.995]."""
    mechanism = irs.make_robot("irsbot2_beta45").mechanism
    arcs = [curve.points for curve in mechanism.loci((1, -1)) if curve.kind == "type2"]
    ranges = sorted((np.nanmin(a[:, 1]), np.nanmax(a[:, 1])) for a in arcs if np.isfinite(a).any())
    assert ranges == [pytest.approx((-1.136, -0.995), abs=6e-4), pytest.approx((-0.514, -0.373), abs=6e-4)]


def test_small_margins_of_a_map_lie_at_a_locus() -> None:
    """No sample contradicts the loci: cos alpha grows away from an arc at least as fast as this design's gap does."""
    mechanism = irs.make_robot("irsbot2_beta45").mechanism
    found = workspace_map(mechanism, (1, -1), Box((-0.9, 0.9), (-1.15, -0.2), ()), (500, 500))
    curves = np.concatenate([curve.points for curve in mechanism.loci((1, -1))])
    curves = curves[np.isfinite(curves).all(axis=1)]
    rows, columns = np.nonzero(found.type2 < 0.02)
    assert len(rows) > 50
    for z, x in zip(found.second[rows], found.first[columns], strict=True):
        assert np.hypot(curves[:, 0] - x, curves[:, 1] - z).min() < 0.02


def test_the_constraint_point_of_the_example_is_on_the_map() -> None:
    """Sheet W3: reached at P = (.106562932, -.189123749)."""
    mechanism = irs.make_robot("irsbot2_csc").mechanism
    found = np.array([at for mode in mechanism.working_modes for at in mechanism.constraint_points(mode)])
    away = np.hypot(found[:, 0] - 0.106562932, found[:, 1] + 0.189123749)
    assert away.min() < 1e-8


def test_ranges_that_are_none_are_refused() -> None:
    mechanism = irs.make_robot("irsbot2").mechanism
    for box, nodes in (
        (Box((0.1, 0.1), (-1.0, 0.0), ()), (10, 10)),
        (Box((math.nan, 0.1), (-1.0, 0.0), ()), (10, 10)),
        (Box((0.0, 0.1), (-1.0, 0.0), (0.3,)), (10, 10)),
        (Box((0.0, 0.1), (-1.0, 0.0), ()), (1, 10)),
    ):
        with pytest.raises(irs.BadInput):
            workspace_map(mechanism, (1, -1), box, nodes)


def test_a_joint_map_agrees_with_single_postures() -> None:
    robot = irs.make_robot("irsbot2_beta45")
    found = joint_map(robot.mechanism, -1, Box((-3.0, 3.0), (-3.0, 3.0), ()), (13, 11))
    solved = 0
    for row, second in enumerate(found.second):
        for column, first in enumerate(found.first):
            try:
                single = robot.evaluate((first, second), -1)
            except irs.NotAssembled:
                assert np.isnan(found.type2[row, column])
                continue
            solved += 1
            assert found.type1[row, column] == pytest.approx(min(single.type1_margin), abs=1e-12)
            assert found.type2[row, column] == pytest.approx(single.type2_margin, abs=1e-12)
            assert found.constraint[row, column] == pytest.approx(single.constraint_margin, abs=1e-12)
    assert solved > 20
