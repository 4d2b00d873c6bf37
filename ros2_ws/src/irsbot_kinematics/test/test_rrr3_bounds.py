"""What the guarantees of the 3-RRR are made of, on the drawing: ways of rods, sines of elbows, links of two lengths."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from numpy.typing import NDArray
from postures import some_postures

import irsbot_kinematics as irs
from irsbot_kinematics import Posture
from irsbot_kinematics.mechanism import Mechanism

Array = NDArray[np.float64]

ROBOT = irs.make_robot("rrr3")
MECHANISM = ROBOT.mechanism
LINK = 0.40


def test_one_sample_needs_the_shared_equations_only_where_nothing_can_be_said(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple[float, ...]] = []
    shared = Mechanism.posture
    regular = some_postures(ROBOT, 40, seed=1, least=1e-3)

    def counted(self: Mechanism, joints: tuple[float, ...], assembly: int) -> Posture:
        asked.append(joints)
        return shared(self, joints, assembly)

    monkeypatch.setattr(Mechanism, "posture", counted)
    for at in regular:
        assert MECHANISM.posture(at.joints, at.assembly_mode).pose == at.pose
    assert not asked
    outside = [(np.nan, 1.0, 1.0), (0.1, 0.1, 3.0), (1.0, 4.0, 1.0), (np.pi, 1.0, 1.0)]
    for q in outside:
        MECHANISM.posture(q, 1)
    assert asked == outside


def test_parts_of_a_posture_are_the_sizes_of_the_columns_of_the_adjugate() -> None:
    for at in some_postures(ROBOT, 40, seed=1, least=1e-3):
        columns = np.linalg.inv(at.screws) * np.linalg.det(at.screws)
        sizes = [*np.hypot(columns[0], columns[1]), *np.abs(columns[2])]
        np.testing.assert_allclose(at.parts, sizes, atol=1e-12)


@pytest.mark.parametrize("slack", [0.0, 1e-4])
@pytest.mark.parametrize("shift", [1, 2])
def test_legs_named_another_way_have_the_same_posture_and_bounds(slack: float, shift: int) -> None:
    """Base and platform turned by a third are themselves, with the legs named anew."""
    rng, promised, along = np.random.default_rng(7), 0, np.deg2rad(120.0 * shift)
    there = np.array([[np.cos(along), -np.sin(along)], [np.sin(along), np.cos(along)]])
    for at in some_postures(ROBOT, 60, seed=7, least=0.01):
        turned = MECHANISM.posture(tuple(np.roll(at.joints, shift).tolist()), at.assembly_mode)
        np.testing.assert_allclose(turned.pose, [*(there @ at.pose[:2]), at.pose[2]], atol=1e-9)
        assert turned.det == pytest.approx(at.det, abs=1e-9)
        for field in ("levers", "reach", "limb", "cos_pressure"):
            np.testing.assert_allclose(getattr(turned, field), np.roll(getattr(at, field), shift), atol=1e-9)
        travel = 10.0 ** rng.uniform(-4.0, -1.5) * rng.uniform(0.0, 1.0, 3)
        here, other = (
            MECHANISM.certified_bounds(one, np.roll(travel, by).tolist(), slack)
            for one, by in ((at, 0), (turned, shift))
        )
        promised += here.type2 > 0.0
        assert other.type2 == pytest.approx(here.type2, abs=1e-8)
        np.testing.assert_allclose(other.type1, np.roll(here.type1, shift), atol=1e-9)
        np.testing.assert_allclose(other.limb, np.roll(here.limb, shift), atol=1e-9)
    assert promised > 20


def test_what_a_rod_demands_is_the_way_of_its_length_and_hardly_more() -> None:
    """Legs nearly stretched, where 2 l cos(q/2) bends most. A rod that is longer by D and points anywhere gets |a| <= D
    along itself and D^2/(2 rod) at most on top of it."""
    robot = irs.make_robot("rrr3", l=0.126)
    at, travel = robot.posture(robot.inverse((0.001, -0.0005, 0.02)), 1), np.array([0.3, 0.2, 0.1])
    shares = np.linspace(-1.0, 1.0, 2001)[:, None]
    lengths = 2.0 * 0.126 * np.cos(0.5 * (np.array(at.joints) + shares * travel))
    now = lengths[1000]
    longer = np.abs(lengths - now).max(axis=0)
    asked = robot.mechanism.travel_of(at, travel.tolist(), 0.0)
    wanted = longer + longer**2 / (2.0 * now.min())
    assert asked.rod == pytest.approx(now.min(), rel=1e-9)
    assert asked.path == 0.0
    assert np.all(asked.drives >= wanted)
    np.testing.assert_allclose(asked.drives, wanted, rtol=0.01)


def test_errors_of_the_geometry_are_those_of_the_worst_leg() -> None:
    """Both places of a leg off in x and y, both links longer or shorter; a stretched leg feels all of a link."""
    s = 1e-4
    base, platform = (np.array(list(product((-s, s), repeat=2))) for _ in range(2))
    ends = max(np.hypot(*(one - other)) for one in base for other in platform)
    found = MECHANISM.geometry_errors(s)
    assert found.ends == pytest.approx(ends)
    assert found.arm == pytest.approx(np.hypot(*platform.T).max())
    links = LINK + np.array([(-s, -s), (-s, s), (s, s)])
    longest = max(abs(np.hypot(a + b * np.cos(0.0), b * np.sin(0.0)) - 2.0 * LINK) for a, b in links)
    assert found.length == pytest.approx(longest)
    at, travel = some_postures(ROBOT, 1, seed=1, least=0.02)[0], [0.02, 0.01, 0.03]
    exact, off = (MECHANISM.travel_of(at, travel, slack) for slack in (0.0, s))
    more = np.subtract(off.drives, exact.drives)
    assert off.path - exact.path == pytest.approx(ends)
    assert np.all(more >= ends + longest)
    for rod, wrong in zip(MECHANISM.rods_of(at, travel, 0.0), MECHANISM.rods_of(at, travel, s), strict=True):
        assert wrong.aside - rod.aside == pytest.approx(ends)
        assert wrong.growth_aside - rod.growth_aside == pytest.approx(longest)
    np.testing.assert_allclose(more, ends + longest, rtol=0.1)


@pytest.mark.parametrize("travel", [0.0, 1e-3, 0.05, 0.3])
def test_floors_of_sines_are_what_the_worst_elbow_has(travel: float) -> None:
    """|sin(q/2)| and |cos(q/2)| over q - t..q + t: to the square of t the floor is it, but for a share 1 - sine of
    t^2/8."""
    for at in some_postures(ROBOT, 60, seed=1):
        half = 0.5 * (np.array(at.joints) + travel * np.linspace(-1.0, 1.0, 2001)[:, None])
        floors = [*MECHANISM.sine_floors(at, (travel,) * 3, 0.0), *MECHANISM.limb_floors(at, (travel,) * 3, 0.0, ())]
        least = np.concatenate([np.abs(np.sin(half)).min(axis=0), np.abs(np.cos(half)).min(axis=0)])
        now = np.array([*at.type1, *at.limb])
        assert np.all(floors <= least + 1e-12)
        looser = (1.0 - now) * travel**2 / 8.0 + travel**3 / 48.0
        assert np.all(least - floors <= looser + 1e-6)


@pytest.mark.parametrize("slack", [1e-3, 0.02, 0.1, 0.3])
def test_floors_of_sines_are_those_of_the_worst_pair_of_links(slack: float) -> None:
    """The lever a b sin(q)/rho over the shorter link, on a grid of links that are off by the slack."""
    first, second = np.meshgrid(*2 * (LINK + slack * np.linspace(-1.0, 1.0, 41),))
    for at in some_postures(ROBOT, 30, seed=1):
        floors = MECHANISM.sine_floors(at, (0.0,) * 3, 0.0, slack)
        limbs = MECHANISM.limb_floors(at, (0.0,) * 3, slack, floors)
        for q, floor, limb in zip(at.joints, floors, limbs, strict=True):
            rho = np.sqrt(first**2 + second**2 + 2.0 * first * second * np.cos(q))
            lever = np.abs(first * second * np.sin(q)) / rho
            assert floor == pytest.approx((lever / np.minimum(first, second)).min(), rel=1e-9)
            assert limb == pytest.approx((rho / (first + second)).min(), rel=1e-9)


@pytest.mark.parametrize("slack", [LINK, 1.5 * LINK])
def test_no_sine_is_left_of_links_that_may_have_no_length(slack: float) -> None:
    at = some_postures(ROBOT, 1, seed=1, least=0.02)[0]
    assert MECHANISM.sine_floors(at, (0.0,) * 3, 0.0, slack) == (0.0,) * 3


def test_rods_turn_within_the_ball_by_no_more_than_their_rate_and_a_folded_leg_has_no_ball() -> None:
    """A rod of which half is left after a move of its end across it has turned by asin(1/2)."""
    limited = set()
    for at in some_postures(ROBOT, 60, seed=1):
        rods = 2.0 * LINK * np.array(at.limb)
        ball, rate = MECHANISM.turn_rate(at)
        assert ball == pytest.approx(min(*at.reach, rods.min() / 2.0))
        assert rate * rods.min() / 2.0 == pytest.approx(np.arcsin(0.5))
        limited.add(min(at.reach) < rods.min() / 2.0)
    assert limited == {True, False}
    at = some_postures(ROBOT, 1, seed=1)[0]
    assert MECHANISM.turn_rate(at._replace(reach=(2.0 * LINK,) * 3)) == (0.0, np.inf)
    folded = MECHANISM.travel_of(at._replace(reach=(2.0 * LINK,) * 3), (1e-3,) * 3, 0.0)
    assert (folded.rod, min(folded.drives)) == (0.0, np.inf)
