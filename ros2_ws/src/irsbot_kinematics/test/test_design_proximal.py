"""Proximal design space: the sheet's worked table, the printed formulas, and the arms of the robot in space."""

from __future__ import annotations

import irsbot2_3d as space
import numpy as np
import pytest

import irsbot_kinematics as irs
from irsbot_kinematics.design import (
    PARAMETERS,
    QUESTIONS,
    ZONES,
    Designs,
    Kind,
    evaluate_printed_zones,
    evaluate_questions,
    find_seats,
    in_zone,
    reachability,
    singular_postures,
)
from irsbot_kinematics.design.proximal import Lengths, holds, slack
from irsbot_kinematics.mechanisms.irsbot2_space.geometry import Irsbot2Geometry

SHEET = 5e-9
SHEET_FOUR = 5e-5
ROUNDING_M = 1e-12
EXAMPLE = {"a1": 0.3, "a2": 0.05, "beta": np.pi / 4, "p": 0.04, "l2eq": 0.15}
"""[S0] (71)."""

# l1, b, printed Z_a, printed (45), Z_a, psi opposite never, psi equal never, Z_I1, Z_I2, Z_wps, strict
WORKED = [
    (0.05, 0.01, True, True, False, False, True, True, True, False, False),
    (0.10, 0.05, True, True, True, False, True, True, True, False, False),
    (0.10, 0.25, True, True, True, True, False, True, True, True, False),
    (0.05, 0.35, True, True, True, True, True, True, True, True, True),
    (0.20, 0.20, True, True, True, False, False, False, False, False, False),
    (0.30, 0.05, True, True, True, False, False, True, False, False, False),
]


def example(l1, b):
    return Designs.columns({**EXAMPLE, "l1": l1, "b": b})


def geometry(robot):
    return irs.make_robot(robot).mechanism.geometry


def random_geometries(number, seed):
    """Robots that can be assembled, of all sizes of arms against rods and base."""
    rng = np.random.default_rng(seed)
    for _ in range(number):
        beta, a1 = rng.uniform(0.1, 1.4), rng.uniform(0.1, 0.5)
        a2 = a1 * rng.uniform(0.1, 0.9)
        p = a2 * np.sin(beta) * 10.0 ** rng.uniform(-1.0, 1.0)
        l2eq = (a1 - a2) * np.sin(beta) * 10.0 ** rng.uniform(-0.5, 1.0)
        l1 = l2eq * 10.0 ** rng.uniform(-0.5, 0.5)
        b0 = rng.uniform(0.0, 1.0) * (l1 + l2eq)
        yield Irsbot2Geometry(l1, l2eq, p + a1 * np.sin(beta) + b0, p, a1, a2, beta, rng.uniform(-0.2, 0.2))


@pytest.mark.parametrize("row", WORKED, ids=lambda row: f"l1={row[0]}, b={row[1]}")
def test_every_row_of_the_worked_table(row):
    l1, b, *expected = row
    found, stated = evaluate_questions(example(l1, b)), evaluate_printed_zones(example(l1, b))
    got = [
        stated["a"],
        stated["wac"],
        in_zone("a", found),
        holds("opposite", found["opposite"]),
        holds("equal", found["equal"]),
        holds("I1", found["I1"]),
        holds("I2", found["I2"]),
        in_zone("wps", found),
        in_zone("strict", found),
    ]
    assert [bool(flag) for flag in got] == expected


def test_the_numbers_of_the_papers_example():
    d = example(0.1, 0.1)
    place = find_seats(d)
    assert float(d.s1g) == pytest.approx(0.252132034, abs=SHEET)
    assert float(place["I1"].centre) == pytest.approx(0.3394, abs=SHEET_FOUR)
    assert float(place["I1"].height) ** 2 == pytest.approx(0.0149, abs=SHEET_FOUR)
    assert float(place["I2"].centre) == pytest.approx(0.1416, abs=SHEET_FOUR)
    assert float(place["I2"].height) ** 2 == pytest.approx(0.0103, abs=SHEET_FOUR)
    assert float(d.l2eq + d.s1g) == pytest.approx(0.4021, abs=SHEET_FOUR)
    assert float(d.s1g - d.l2eq) == pytest.approx(0.1021, abs=SHEET_FOUR)


def test_the_printed_zone_of_the_example_contains_singular_designs():
    """About 35 % of its area reaches psi_I = psi_II + pi, 30 % psi_I = psi_II, and 12 % cannot be assembled."""
    l1, b = np.meshgrid((np.arange(400) + 0.5) / 1000.0, (np.arange(800) + 0.5) / 1000.0)
    d = example(l1, b)
    found, area = evaluate_questions(d), evaluate_printed_zones(d)["wps"]
    assembled = holds("assembled", found["assembled"])
    opposite = assembled & ~holds("opposite", found["opposite"])
    equal = assembled & ~holds("equal", found["equal"])
    shares = [np.mean(flags[area]) for flags in (opposite, equal, ~assembled)]
    assert shares == pytest.approx([0.35, 0.30, 0.12], abs=0.005)


def test_the_printed_reach_of_single_postures_is_exact_but_for_its_ends():
    """(56), (57) with the square root wherever it is real; the ends belong to what is reached."""
    l1, b = np.meshgrid(np.linspace(0.13, 0.5, 300), np.linspace(0.001, 0.9, 300))
    d = example(l1, b)
    found, place = evaluate_questions(d), find_seats(d)
    for name in ("I1", "I2"):
        half = np.sqrt(l1**2 - place[name].height ** 2)
        outside = (b < place[name].centre - half) | (b > place[name].centre + half)
        assert np.array_equal(holds(name, found[name]), outside)


@pytest.mark.parametrize(("l2eq", "kind", "name"), [(0.09, Kind.CASE_2, "II"), (0.30, Kind.CASE_3, "III")])
def test_cases_2_and_3_of_the_sheet_need_the_same_arms(l2eq, kind, name):
    g = Irsbot2Geometry(l1=0.3, l2eq=l2eq, b=0.1, p=0.01, a1=0.2, a2=0.05, beta=np.pi / 4)
    needed = evaluate_questions(Designs.of(g))[name].larger[0]
    assert 2.0 * needed == pytest.approx(0.104706352, abs=SHEET)
    for posture in singular_postures(g):
        if posture.kind is kind:
            assert reachability(g, posture).slack == pytest.approx(needed - g.l1, abs=ROUNDING_M)
    assert not in_zone("csc", evaluate_questions(Designs.of(g)))[0]


def test_the_seats_are_where_the_elbows_of_the_robot_in_space_have_to_be():
    """hypot(b - centre, height) is half the distance that the arms have to bridge: B_II - B_I minus A_II - A_I."""
    names = {
        Kind.CASE_2: ("II",),
        Kind.CASE_3: ("III",),
        Kind.C1A: ("C1a",),
        Kind.C1B: ("C1b",),
        Kind.CASE_1: ("I1", "I2"),
    }
    seen = set()
    for g in random_geometries(300, seed=3):
        d, found = space.Design(**vars(g)), evaluate_questions(Designs.of(g))
        for posture in singular_postures(g):
            legs = [space.leg(d, k, 0.0, posture.psi[k]) for k in (0, 1)]
            elbows = [at.B - space.platform_point(d, k, at) for k, at in enumerate(legs)]
            bridge = elbows[1] - elbows[0] - np.array([2.0 * g.b, 0.0, 0.0])
            half = 0.5 * float(np.linalg.norm(bridge))
            assert any(found[name].larger[0] == pytest.approx(half, abs=1e-9) for name in names[posture.kind])
            assert reachability(g, posture).slack == pytest.approx(half - g.l1, abs=1e-9)
            seen.add(posture.kind)
    assert seen == set(Kind)


def test_the_arms_hold_every_posture_that_is_listed_as_held():
    """In space: both legs put the platform at the same point, and the law of cosines gives the same q in that mode."""
    held = 0
    for g in random_geometries(150, seed=4):
        d = space.Design(**vars(g))
        for posture in singular_postures(g):
            for place in reachability(g, posture).placements:
                points = [space.platform_point(d, k, space.leg(d, k, place.joints[k], posture.psi[k])) for k in (0, 1)]
                expected = np.array([place.pose[0], 0.0, place.pose[1]])
                assert np.abs(np.array(points) - expected).max() < 1e-9
                assert place.height == pytest.approx(place.pose[1] + g.e, abs=ROUNDING_M)
                if 0 not in place.working_mode:
                    q = space.motors(d, *place.pose, place.working_mode)
                    assert np.abs(np.exp(1j * np.array(q)) - np.exp(1j * np.array(place.joints))).max() < 1e-6
                held += 1
    assert held > 400


def test_the_papers_constraint_singularity_is_held_at_the_pose_of_the_sheet():
    g = geometry("irsbot2_csc")
    postures = [posture for posture in singular_postures(g) if posture.kind is Kind.CASE_1]
    places = [place for posture in postures for place in reachability(g, posture).placements]
    place = min(places, key=lambda place: abs(place.joints[0] - 1.959445438))
    assert place.pose == pytest.approx((0.106562932, -0.189123749), abs=SHEET)
    assert place.joints == pytest.approx((1.959445438, 0.155916281), abs=SHEET)
    assert place.working_mode == (1, -1)
    assert place.assembly_mode == 0


def test_the_default_robot_holds_c1a_only_at_the_poses_of_the_sheet():
    g = geometry("irsbot2")
    found = {}
    for posture in singular_postures(g):
        for place in reachability(g, posture).placements:
            assert posture.kind is Kind.C1A
            assert place.pose[0] == pytest.approx(0.0, abs=ROUNDING_M)
            found.setdefault(place.working_mode, []).append(place.pose[1])
    assert set(found) == {(1, -1), (-1, 1)}
    assert sorted(found[-1, 1]) == pytest.approx([-1.1881, -0.4564], abs=SHEET_FOUR)
    assert sorted(found[1, -1]) == pytest.approx([0.4564, 1.1881], abs=SHEET_FOUR)


def test_arms_above_the_elbows_hold_c1a_at_every_angle():
    """b = s2g: E_I E_II is as long as A_I A_II, so that the arms stay parallel."""
    g = Irsbot2Geometry(l1=0.3, l2eq=0.5, b=0.05 + 0.05 * np.sin(0.7), p=0.05, a1=0.2, a2=0.05, beta=0.7)
    for posture in singular_postures(g):
        if posture.kind is Kind.C1A:
            assert reachability(g, posture).anywhere
    assert not in_zone("strict", evaluate_questions(Designs.of(g)))[0]


def test_touching_a_singularity_counts_as_reaching_it_and_just_closing_as_assembled():
    touching = Lengths(np.array([0.25]), np.array([0.25]))
    for name in QUESTIONS:
        assert bool(holds(name, touching)[0]) is (name == "assembled")


@pytest.mark.parametrize(("shift", "free"), [(1e-9, True), (-1e-9, False)])
def test_a_posture_is_out_of_reach_as_soon_as_the_arms_are_too_short(shift, free):
    lengths = {"l1": 0.25, "l2eq": 0.5, "p": 0.0625, "a1": 0.25, "a2": 0.125, "beta": 0.5}
    found = evaluate_questions(Designs.columns({**lengths, "b": 0.0625 + 0.125 * np.sin(0.5) + 0.25 + shift}))
    assert bool(holds("C1a", found["C1a"])) is free


def test_the_zones_are_nested_and_the_slack_has_the_sign_of_the_answer():
    rng = np.random.default_rng(6)
    d = Designs.columns({**EXAMPLE, "l1": rng.uniform(0.01, 0.5, 5000), "b": rng.uniform(0.01, 0.8, 5000)})
    found = evaluate_questions(d)
    assert set(found) == set(QUESTIONS)
    inside = {zone: in_zone(zone, found) for zone in ZONES}
    for smaller, larger in (("strict", "wps"), ("wps", "z"), ("wps", "wac"), ("z", "a"), ("z", "csc"), ("csc", "i")):
        assert not np.any(inside[smaller] & ~inside[larger])
    for zone, flags in inside.items():
        assert np.array_equal(flags, slack(zone, found) > 0.0)


def test_no_pose_of_the_strict_design_comes_near_a_singularity():
    """Section 9 of the sheet, by scan of the robot in space: cos alpha >= 0.236, kappa >= 0.21 in all modes."""
    g = geometry("irsbot2_strict")
    assert in_zone("strict", evaluate_questions(Designs.of(g)))[0]
    d = space.Design(**vars(g))
    q = np.linspace(-np.pi, np.pi, 240, endpoint=False)
    cosines, margins = [], []
    for assembly in (-1, 1):
        with np.errstate(invalid="ignore"):
            psi_1, psi_2, *_ = space.posture(d, q[:, None], q[None, :], assembly)
        assert np.isfinite(psi_1).all(), "the strict design assembles at every joint position"
        cosines.append(np.abs(np.sin(psi_1 - psi_2)).min())
        margins.append(space.kappa(d, psi_1.ravel(), psi_2.ravel()).min())
    assert min(cosines) == pytest.approx(0.236, abs=0.001)
    assert min(margins) > 0.21


def test_columns_broadcast_and_keep_their_order():
    d = Designs.columns({**EXAMPLE, "l1": [0.1, 0.2], "b": [[0.3], [0.4]]})
    assert all(getattr(d, name).shape == (2, 2) for name in PARAMETERS)
    assert d.b[1, 0] == 0.4
    with pytest.raises(irs.BadInput, match="columns"):
        Designs.columns({**EXAMPLE, "l1": 0.1})
