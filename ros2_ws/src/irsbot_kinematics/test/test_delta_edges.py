"""Linear Delta robots at the edges of what they know: far slides, slides in one point, rails of every direction."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest

import irsbot_kinematics as irs
from irsbot_kinematics import Status
from irsbot_kinematics.mechanism import Mechanism
from irsbot_kinematics.mechanisms.linear_delta import LinearDelta, LinearDeltaGeometry
from irsbot_kinematics.numerics.arithmetic import FLOATS
from irsbot_kinematics.numerics.tolerances import FARTHEST
from irsbot_kinematics.skeleton import bars

AXES = [tuple(sign * float(i == k) for i in range(3)) for k in range(3) for sign in (1.0, -1.0)]
SLANTED = [(0.6, 0.0, 0.8), (0.0, 0.6, 0.8), (0.6, 0.8, 0.0), (-0.8, 0.36, 0.48), (0.3, -0.8, 0.5)]


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("farthest", [0, 1, 2])
@pytest.mark.parametrize("name", ["triaglide", "uranesx"])
def test_one_slide_beyond_the_farthest_place_has_no_pose_whatever_the_others_are(
    name: str, farthest: int, sign: float
) -> None:
    """The slides are next to one another on parallel rails, and the loops close."""
    mechanism = irs.make_robot(name).mechanism
    near = [FARTHEST - 0.1, FARTHEST - 0.15, FARTHEST - 0.25]
    assert mechanism.posture(tuple(sign * q for q in near), 1).status != Status.INVALID
    far = [FARTHEST + 0.2 if k == farthest else q for k, q in enumerate(near)]
    assert mechanism.posture(tuple(sign * q for q in far), 1).status == Status.INVALID


@pytest.mark.parametrize("apart", [1e-10, 3e-10, 1e-12, 1e-160])
def test_slides_that_are_apart_by_less_than_can_be_told_have_no_pose(apart: float) -> None:
    """They make a regular triangle, so that the rods could meet; but in its plane every direction is rounding."""
    mechanism = irs.make_robot("orthoglide").mechanism
    q = (apart, apart, apart)
    for assembly in (1, -1):
        one_piece, shared = mechanism.posture(q, assembly), Mechanism.posture(mechanism, q, assembly)
        assert one_piece.status == shared.status == Status.SINGULAR
        assert np.isnan(one_piece.pose).all()


@pytest.mark.parametrize("along", [*AXES, *SLANTED])
def test_a_drawing_and_the_inverse_belong_to_the_posture_for_rails_of_every_direction(
    along: tuple[float, float, float],
) -> None:
    others = np.linalg.svd(np.array([along]))[2][1:].tolist()
    ways = [along, *map(tuple, others)]
    origins = [(0.1, 0.0, 0.05), (0.3, 0.2, 0.1), (0.0, -0.1, 0.2)]
    geometry = LinearDeltaGeometry(0.9, (-0.2, 0.4), *sum(zip(origins, ways, strict=True), ()))
    mechanism, drawn = LinearDelta(geometry), 0
    skeleton = mechanism.skeleton()
    for q in np.random.default_rng(41).uniform(-0.2, 0.4, (10, 3)).tolist():
        at = mechanism.posture(tuple(q), 1)
        if at.status != Status.SOLVED:
            continue
        joints, reach = mechanism.inverse(FLOATS, at.pose, at.working_mode)
        assert joints == pytest.approx(q, abs=1e-9)
        assert reach == pytest.approx(at.reach, abs=1e-9)
        positions = skeleton.closing(tuple(q), at.pose) | dict(zip(skeleton.drives, q, strict=True))
        for number, ((origin, way), rail, slide) in enumerate(zip(mechanism.rails, skeleton.rails, q, strict=True), 1):
            (rod,) = [bar for bar in bars(skeleton, positions) if bar.link == f"rod_{number}"]
            np.testing.assert_allclose(rod.start, np.array(origin) + slide * np.array(way), atol=1e-12)
            np.testing.assert_allclose(rod.end, at.pose, atol=1e-12)
            ends = [np.array(origin) + limit * np.array(way) for limit in geometry.limits]
            np.testing.assert_allclose(rail, ends, atol=1e-12)
            drawn += 1
    assert drawn > 5


def test_all_signs_are_named_once_and_the_usual_ones_are_among_them() -> None:
    """Ahead of or behind the platform on each rail; one label on either side of the slides' plane."""
    for name in ("orthoglide", "hybridglide", "triaglide", "uranesx", "linear_delta"):
        mechanism = irs.make_robot(name).mechanism
        assert sorted(mechanism.assembly_modes) == [-1, 1]
        assert mechanism.usual_assembly_mode in mechanism.assembly_modes
        assert mechanism.usual_working_mode in mechanism.working_modes
        modes = sorted(mechanism.working_modes)
        assert len(modes) == 8
        assert all(a < b for a, b in pairwise(modes))
        assert {sign for mode in modes for sign in mode} == {-1, 1}


@pytest.mark.parametrize("wrong", [{"L": 0.0}, {"limits": (1.0, 1.0)}])
def test_a_rod_without_length_and_a_rail_without_range_are_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(irs.InvalidGeometry, match=r"> 0, got 0$" if "L" in wrong else "got 1 against 1$"):
        irs.make_robot("orthoglide", **wrong)
