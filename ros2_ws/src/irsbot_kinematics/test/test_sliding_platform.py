"""Parts of the guarantees of platforms on slides: rails that are off, turns of struts and rods, ways of rods."""

from __future__ import annotations

from functools import cache
from itertools import product
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from postures import ROBOTS, some_postures

import irsbot_kinematics as irs
from irsbot_kinematics import Posture
from irsbot_kinematics.bounds.quadratics import numbers
from irsbot_kinematics.mechanism import Coordinate
from irsbot_kinematics.mechanisms.sliding_platform import _rail_errors as rail_errors

Array = NDArray[np.float64]

NAMES = ("rails2", "rails3", "rpr3")
every_platform = pytest.mark.parametrize("name", NAMES)


@cache
def postures(name: str) -> list[Posture]:
    """In random places of the joints, with either sign of det A."""
    modes = ROBOTS[name].mechanism.assembly_modes[:2]
    return some_postures(ROBOTS[name], 12, seed=5, least=0.02, modes=modes)


@pytest.mark.parametrize("travel", [0.0, 0.1])
@pytest.mark.parametrize("away", [-2.0, -0.6, 0.0, 0.5, 1.5])
@pytest.mark.parametrize("place", [0.004, 0.04])
def test_a_rail_is_off_by_no_more_than_its_worst_ends_put_it_and_by_about_as_much(
    place: float, away: float, travel: float
) -> None:
    """Ends on circles about where they belong, carriages counted from the middle of the rail that is there."""
    rail, size = Coordinate("slide", "m", -0.1, 0.7), 0.8
    turn = np.deg2rad(np.arange(0.0, 360.0, 10.0))
    first, last = (end.ravel() for end in np.meshgrid(*2 * (place * np.exp(1j * turn),)))
    along = (size + last - first) / np.abs(size + last - first)
    q = 0.3 + away + travel * np.linspace(-1.0, 1.0, 5)[:, None]
    off = np.abs(0.3 + 0.5 * (first + last) + (q - 0.3) * along - q).max()
    shift, turned = rail_errors(rail, 0.3 + away, travel, place)
    tilt = np.abs(np.angle(along)).max()
    beyond = max(2.0 * (abs(away) + travel) / size, 1.0)
    assert off <= shift <= off * np.hypot(1.0, beyond) / beyond * (1.0 + 6.0 * place / size)
    assert tilt <= turned <= (1.0 + 3.0 * place / size) * tilt


def test_nothing_is_known_of_a_rail_whose_ends_may_nearly_meet() -> None:
    rail = Coordinate("slide", "m", -0.2, 0.8)
    assert np.isfinite(rail_errors(rail, 0.0, 0.0, 0.249)).all()
    assert rail_errors(rail, 0.0, 0.0, 0.25) == (np.inf, np.inf)
    assert rail_errors(rail, 0.0, 0.0, np.nan) == (np.inf, np.inf)


@every_platform
def test_rods_and_struts_turn_by_no_more_than_their_rate_and_at_the_end_of_the_ball_by_as_much(name: str) -> None:
    """A rod on a rail turns with the distance h of its end from the rail, asin(h/L); a strut of which half is left has
    turned by asin(1/2)."""
    mechanism, step = ROBOTS[name].mechanism, 1e-7
    for at in postures(name):
        ball, rate = mechanism.turn_rate(at)
        assert ball == pytest.approx(0.5 * min(at.reach))
        rates = []
        for rail, q, (rx, ry, _) in zip(mechanism.rails, at.joints, at.screws, strict=True):
            if rail is None:
                rates.append(np.arcsin(0.5) / (0.5 * q))
            else:
                h = rail.rod * abs(rail.way[0] * ry - rail.way[1] * rx) + ball
                rates.append((np.arcsin((h + step) / rail.rod) - np.arcsin((h - step) / rail.rod)) / (2.0 * step))
        assert rate == pytest.approx(max(rates), rel=1e-5)
    assert mechanism.turn_rate(at._replace(reach=(0.1, 0.0, 0.1))) == (0.0, np.inf)


@every_platform
def test_a_strut_keeps_its_length_but_for_its_travel_and_its_error_and_has_no_sine_to_lose(name: str) -> None:
    mechanism, travel, slack = ROBOTS[name].mechanism, (0.1, 0.02, 0.3), 0.01
    for at in postures(name):
        limbs = iter(mechanism.limb_floors(at, travel, slack, ()))
        sines = mechanism.sine_floors(at, travel, 0.2, slack)
        rows = zip(mechanism.rails, mechanism.joints, at.joints, travel, at.type1, sines, strict=True)
        for rail, joint, q, t, sine, floor in rows:
            if rail is None:
                lengths = q + np.linspace(-t - slack, t + slack, 201)
                assert next(limbs) == pytest.approx(np.clip(lengths / joint.upper, 0.0, 1.0).min(), abs=1e-12)
                assert floor == 1.0
            else:
                turn = 0.2 + rail_errors(joint, q, 0.0, np.sqrt(2.0) * slack)[1]
                angles = np.arcsin(sine) + turn * np.linspace(-1.0, 1.0, 201)
                assert floor == pytest.approx(max(np.sin(angles.min()), 0.0), abs=1e-9)
        assert not list(limbs)
        assert mechanism.sine_floors(at, travel, 0.2) == mechanism.sine_floors(at, travel, 0.2, 0.0)
        assert (
            mechanism.limb_floors(at._replace(joints=(9.0,) * 3), (0.0,) * 3, 0.0, ()) == (1.0,) * mechanism.limb_count
        )


@pytest.mark.parametrize("name", ["rails2", "rails3"])
@pytest.mark.parametrize("size", [1e-3, 0.05, 0.4])
def test_sines_over_changes_of_the_rods_are_those_of_the_worst_corner(name: str, size: float) -> None:
    """|w.u| of the rod as a vector, over the longest rod: at a corner of what the joints do to it, with the rest of
    either coordinate along the rail. Rails that are off turn on top."""
    mechanism, rng, slack = ROBOTS[name].mechanism, np.random.default_rng(9), 2e-3
    signs = np.array(list(product((-1.0, 1.0), repeat=3)))
    for at in postures(name):
        lengths = [q if rail is None else rail.rod for rail, q in zip(mechanism.rails, at.joints, strict=True)]
        ways, rests = size * rng.normal(size=(3, 3, 2)), size * rng.uniform(size=(3, 2))
        longest = [length * (1.0 + 0.1 * k) for k, length in enumerate(lengths)]
        rods = np.zeros((3, 2, numbers(3, 3)))
        rods[..., 0], rods[..., 1:4], rods[..., -1] = np.array(at.screws)[:, :2], ways.transpose(0, 2, 1), rests
        met = SimpleNamespace(rods=(np.array(lengths)[:, None, None] * rods).tolist(), longest=longest)
        exact, off = (mechanism.sines_over(at, (0.0,) * 3, met, s) for s in (0.0, slack))
        rows = zip(mechanism.rails, mechanism.joints, at.screws, ways, rests, lengths, longest, strict=True)
        for k, (rail, joint, r, way, rest, length, far) in enumerate(rows):
            if rail is None:
                assert exact[k] == off[k] == 1.0
                continue
            along = (r[:2] + signs @ way) @ rail.way * np.sign(np.dot(r[:2], rail.way))
            least = max(along.min() - np.abs(rail.way) @ rest, 0.0) * length / far
            assert exact[k] == pytest.approx(least, abs=1e-12)
            turn = rail_errors(joint, joint.lower, 0.0, np.sqrt(2.0) * slack)[1]
            assert off[k] == pytest.approx(max(np.sin(np.arcsin(least) - turn), 0.0), abs=1e-12)


LONG = {"limits": (-3.0, -1.0), "L": (0.1, 2.0, 0.1)}


@pytest.mark.parametrize(("name", "changes"), [("rails2", {}), ("rails3", {}), ("rpr3", {}), ("rails3", LONG)])
def test_the_size_of_a_platform_is_about_that_of_everything_stretched_out(name: str, changes: dict[str, Any]) -> None:
    mechanism, far = irs.make_robot(name, **changes).mechanism, 0.0
    for (x, y), rail, (bx, by), joint in zip(
        mechanism.feet, mechanism.rails, mechanism.corners, mechanism.joints, strict=True
    ):
        for q in (joint.lower, joint.upper):
            far = max(far, np.hypot(x, y) + abs(q) + (rail.rod if rail else 0.0) + np.hypot(bx, by))
    assert far * (1.0 - 1e-12) <= mechanism.size_m < 1.4 * far


@every_platform
def test_a_platform_names_its_struts_and_slides_and_begins_in_its_first_modes(name: str) -> None:
    kinds = {"rails2": ("strut_1", "slide_2", "slide_3"), "rails3": ("slide_1", "slide_2", "slide_3")}
    mechanism = type(ROBOTS[name].mechanism)(ROBOTS[name].mechanism.geometry)
    assert tuple(joint.name for joint in mechanism.joints) == kinds.get(name, ("strut_1", "strut_2", "strut_3"))
    assert mechanism.usual_working_mode == mechanism.working_modes[0]
    assert sorted(mechanism.assembly_modes, key=lambda mode: (abs(mode), -mode)) == list(mechanism.assembly_modes)
    assert set(mechanism.assembly_modes) == {sign * rank for sign in (1, -1) for rank in (1, 2, 3)}
    assert mechanism.usual_assembly_mode == mechanism.assembly_modes[0]


@every_platform
@pytest.mark.parametrize("slack", [0.0, 1e-4])
def test_what_rods_demand_is_the_way_of_joints_along_them_and_the_errors_of_both_ends(name: str, slack: float) -> None:
    """A strut that is longer by D pushes by D + D^2/(2 length) at most; a carriage takes its rod along by the cosine.
    Errors are those of the worst signs; a rail's are measured on a rail."""
    mechanism, travel = ROBOTS[name].mechanism, (0.003, 0.005, 0.001)
    places = np.array(list(product((-slack, slack), repeat=2)))
    place = np.hypot(*places.T).max()
    apart = max(np.hypot(*(one - other)) for one in places for other in places)
    found = mechanism.geometry_errors(slack)
    np.testing.assert_allclose(found, (apart, slack, place), atol=1e-15)
    for at in postures(name):
        asked, exact = mechanism.travel_of(at, travel, slack), mechanism.rods_of(at, travel, slack)
        paths, lengths = [], []
        rows = zip(mechanism.rails, mechanism.joints, at.joints, travel, asked.drives, at.screws, exact, strict=True)
        for rail, joint, q, t, drive, (rx, ry, _), rod in rows:
            if rail is None:
                ends, longer = apart, t + slack
                assert drive == pytest.approx(longer + longer**2 / (2.0 * q) + ends, rel=1e-12)
                assert (rod.near, rod.growth) == ((0.0, 0.0), t)
                paths.append(ends)
            else:
                ends = place + (rail_errors(joint, q, t, place)[0] if slack else 0.0)
                assert drive == pytest.approx(abs(rx * rail.way[0] + ry * rail.way[1]) * t + slack + ends, rel=1e-12)
                assert np.hypot(*rod.near) == pytest.approx(t)
                assert rod.growth == 0.0
                paths.append(t + ends)
            assert (rod.aside, rod.growth_aside) == pytest.approx((ends, slack), abs=1e-15)
            lengths.append(q if rail is None else rail.rod)
        assert asked.path == pytest.approx(max(paths), rel=1e-12)
        assert asked.rod == min(lengths)


def test_a_strut_without_length_has_no_bound() -> None:
    at = postures("rpr3")[0]
    asked = ROBOTS["rpr3"].mechanism.travel_of(at._replace(joints=(0.0, 0.3, 0.3)), (1e-3,) * 3, 0.0)
    assert asked.drives[0] == np.inf
    assert asked.rod == 0.0


@pytest.mark.parametrize("name", ["rrr3", "rrr3_base", "ruu4", *NAMES])
def test_sizes_of_a_turning_platform_are_those_of_its_corners_and_its_task_is_open(name: str) -> None:
    mechanism = ROBOTS[name].mechanism
    rng = np.random.default_rng(3)
    limits = np.array([(max(joint.lower, -np.pi), min(joint.upper, np.pi)) for joint in mechanism.joints]).T
    solved = (
        mechanism.posture(tuple(q), mechanism.usual_assembly_mode) for q in rng.uniform(*limits, (500, limits.shape[1]))
    )
    at = next(at for at in solved if at.status == irs.Status.SOLVED)
    corners = np.array(at.attachments)
    assert mechanism.radius == pytest.approx(np.hypot(*corners.T).max())
    assert mechanism.diameter == pytest.approx(np.hypot(*(corners[:, None] - corners).transpose(2, 0, 1)).max())
    assert {(axis.lower, axis.upper) for axis in mechanism.task} == {(-np.inf, np.inf)}
