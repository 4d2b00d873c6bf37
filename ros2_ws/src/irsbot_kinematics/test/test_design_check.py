"""The verdict on a design: what it says, why, where, and what would have to move."""

from __future__ import annotations

from dataclasses import asdict, replace

import numpy as np
import pytest

import irsbot_kinematics as irs
from irsbot_kinematics.design import (
    ERRATA,
    PARAMETERS,
    QUESTIONS,
    ZONES,
    Designs,
    check,
    evaluate_questions,
    in_zone,
    moves,
)
from irsbot_kinematics.design.proximal import holds
from irsbot_kinematics.mechanisms.irsbot2_space.geometry import Irsbot2Geometry

MODES = ((1, -1), (-1, 1), (1, 1), (-1, -1))
PAST = 1e-9
"""Relative step past a bound: far above rounding, far below what decides anything else."""


def geometry(robot, **lengths):
    return irs.make_robot(robot, **lengths).mechanism.geometry


def changed(g, **lengths):
    return Irsbot2Geometry(**{**asdict(g), **lengths})


def test_the_strict_preset_is_free_in_every_zone_and_mode():
    verdict = check(geometry("irsbot2_strict"))
    assert verdict.free
    assert all(verdict.zones.values())
    assert not verdict.failed()
    assert not verdict.met()
    assert all(verdict.free_in(mode) for mode in MODES)


def test_the_default_robot_is_free_in_its_usual_mode_below_the_motors_only():
    verdict = check(geometry("irsbot2"))
    assert not verdict.free
    assert verdict.zones["wps"], "the paper would call it free"
    assert {finding.name for finding in verdict.failed()} == {"equal", "C1a"}
    free = {(mode, below) for mode in MODES for below in (True, False) if verdict.free_in(mode, below)}
    assert free == {((1, -1), True), ((-1, 1), False)}
    assert not verdict.free_in((1, -1))


def test_the_default_robot_loses_its_free_half_when_the_half_base_turns_negative():
    """Section 11 of the sheet: b0 > 0 below beta = 12.02 deg."""
    assert check(geometry("irsbot2", beta=np.radians(12.0))).free_in((1, -1), below=True)
    assert not check(geometry("irsbot2", beta=np.radians(12.1))).free_in((1, -1), below=True)


def test_the_arcs_of_the_beta_45_preset_are_those_of_the_sheet():
    parts = [
        part
        for part in check(geometry("irsbot2_beta45")).loci
        if part.working_mode == (1, -1) and part.below and not part.opposite
    ]
    heights = sorted((part.z_low, part.z_high) for part in parts)
    assert np.array(heights) == pytest.approx(np.array([(-1.136, -0.995), (-0.514, -0.373)]), abs=1e-3)


@pytest.mark.parametrize("robot", ["irsbot2", "irsbot2_beta45", "irsbot2_csc"])
def test_the_parts_of_the_type_2_loci_are_those_of_a_joint_grid(robot):
    """Brute force: where the distance of the elbows passes 2 l2eq (or 0) between two nodes, take mode and side."""
    g = geometry(robot)
    q = np.linspace(-np.pi, np.pi, 1441)
    found = {}
    for q_1 in q[:-1]:
        elbow_1, elbow_2 = -g.b0 + g.l1 * np.exp(-1j * q_1), g.b0 + g.l1 * np.exp(-1j * q)
        apart = elbow_2 - elbow_1
        past = np.flatnonzero(np.diff(np.sign(np.abs(apart) - 2.0 * g.l2eq)))
        psi_1 = -np.angle(apart[past])
        for q_2, psi, middle in zip(q[past], psi_1, 0.5 * (elbow_1 + elbow_2[past]), strict=True):
            normalised_levers = np.sin(q_1 - psi), -np.sin(q_2 - psi)
            if np.abs(normalised_levers).min() > 0.02 and abs(middle.imag) > 0.01:
                mode = tuple(int(sign) for sign in np.sign(normalised_levers))
                found.setdefault((mode, bool(middle.imag < 0.0)), []).append(middle.imag - g.e)
    parts = {}
    for part in check(g).loci:
        if part.opposite:
            low, high = parts.get((part.working_mode, part.below), (np.inf, -np.inf))
            parts[part.working_mode, part.below] = min(low, part.z_low), max(high, part.z_high)
    assert set(found) == set(parts)
    assert bool(parts) is (robot == "irsbot2_csc")
    for key, heights in found.items():
        assert (min(heights), max(heights)) == pytest.approx(parts[key], abs=0.02)


def test_a_posture_on_the_boundary_of_two_modes_counts_for_both():
    verdict = check(geometry("irsbot2"))
    posture, where = verdict.postures[0]
    edge = replace(where, placements=(replace(where.placements[0], working_mode=(0, -1), height=-0.5),))
    verdict = replace(verdict, postures=((posture, edge),), loci=())
    taken = {(mode, below) for mode in MODES for below in (True, False) if not verdict.free_in(mode, below)}
    assert taken == {((1, -1), True), ((-1, -1), True)}


def test_a_posture_that_holds_everywhere_leaves_no_mode_free():
    g = Irsbot2Geometry(l1=0.3, l2eq=0.5, b=0.05 + 0.05 * np.sin(0.7), p=0.05, a1=0.2, a2=0.05, beta=0.7)
    verdict = replace(check(g), loci=())
    assert verdict.met() == ()
    assert not any(verdict.free_in(mode, below) for mode in MODES for below in (True, False))


@pytest.mark.parametrize("robot", ["irsbot2", "irsbot2_beta45", "irsbot2_csc", "irsbot2_strict"])
@pytest.mark.parametrize("zone", ["strict", "wps", "z", "wac"])
def test_the_verdict_changes_exactly_at_the_nearest_bounds(robot, zone):
    g = geometry(robot)
    free = check(g, zone).free
    for move in moves(g, zone):
        step = np.sign(move.then - move.now) * PAST
        columns = {name: [getattr(g, name)] * 2 for name in PARAMETERS}
        columns[move.parameter] = [move.then * (1.0 - step), move.then * (1.0 + step)]
        found = evaluate_questions(Designs.columns(columns))
        assert in_zone(zone, found).tolist() == [free, not free]
        assert holds(move.question, found[move.question]).tolist() == [free, not free]


def test_nothing_nearer_changes_the_verdict():
    g = geometry("irsbot2_strict")
    for move in moves(g, "strict"):
        tried = np.linspace(2.0 * move.now - move.then, move.then, 10_001)[1:-1]
        columns = {name: tried if name == move.parameter else getattr(g, name) for name in PARAMETERS}
        d = Designs.columns(columns)
        assert in_zone("strict", evaluate_questions(d.where(d.valid))).all()


def test_the_nearest_bounds_of_the_strict_preset_in_closed_form():
    """|b0| > l1 and l2eq > |b0| + l1 with b0 = 0.295285: the others follow from them."""
    g = geometry("irsbot2_strict")
    found = moves(g, "strict")
    then = {move.parameter: move.then for move in found}
    assert then["b"] == pytest.approx(g.b - g.b0 + g.l1, abs=1e-12)
    assert then["l1"] == pytest.approx(g.b0, abs=1e-12)
    assert then["l2eq"] == pytest.approx(g.b0 + g.l1, abs=1e-12)
    assert then["p"] == pytest.approx(g.p + g.b0 - g.l1, abs=1e-12)
    relative = [abs(move.relative) for move in found]
    assert relative == sorted(relative)
    assert found[0].parameter == "b"


def test_the_flow_of_a_design_without_cases_skips_to_the_fifth_step():
    assert [step.number for step in check(geometry("irsbot2")).flow] == [1, 2, 5]
    assert [step.number for step in check(geometry("irsbot2_csc")).flow] == [1, 3, 4, 5]


def test_the_flow_ends_in_the_answers_of_the_zones():
    for robot in ("irsbot2", "irsbot2_csc", "irsbot2_strict"):
        verdict = check(geometry(robot))
        answer = {step.number: step.answer for step in verdict.flow}
        assert answer[5] == verdict.zones["strict"]
        if 2 in answer:
            assert answer[2] == verdict.zones["wac"]
        else:
            assert (answer[3], answer[4]) == (verdict.zones["z"], verdict.zones["wps"])


def test_every_failed_question_has_both_values():
    for finding in check(geometry("irsbot2_csc")).failed():
        assert f"{finding.larger:.6g} against {finding.smaller:.6g} m" in finding.why
        assert QUESTIONS[finding.name].inequality in finding.why


def test_a_leg_that_can_vanish_is_never_free():
    g = Irsbot2Geometry(l1=0.05, l2eq=0.125, b=0.9, p=0.5, a1=0.5, a2=0.25, beta=float(np.arcsin(0.5)))
    d = Designs.of(g)
    exact = changed(g, l2eq=float(d.D[0]), b=float(d.s1g[0]) + 0.06)
    verdict = check(exact, "csc")
    assert not verdict.free
    assert "legs" in {finding.name for finding in verdict.failed()}


def test_an_unknown_zone_is_refused_with_the_known_ones():
    with pytest.raises(irs.BadInput, match=", ".join(ZONES)):
        check(geometry("irsbot2"), "nonsense")


@pytest.mark.parametrize(
    ("lengths", "words"),
    [
        ({"a2": 0.5}, "a1 > a2, got 0.42 against 0.5"),
        ({"a2": 0.42}, "a1 > a2, got 0.42 against 0.42"),
        ({"beta": 0.0}, "beta > 0, got 0"),
        ({"beta": np.pi / 2}, "beta < pi/2, got 1.57079633 against 1.57079633"),
        ({"l1": -0.1}, "l1 > 0, got -0.1"),
        ({"p": float("nan")}, "must be finite, got nan"),
        ({"b": 0.05 + 0.42 * np.sin(np.radians(10.0))}, "b0"),
        ({"b": 9.0}, "assembly), got 8.87706777 against 1.2"),
    ],
)
def test_designs_that_no_machine_can_have_are_refused_with_the_inequality_and_both_values(lengths, words):
    with pytest.raises(irs.InvalidGeometry) as refusal:
        geometry("irsbot2", **lengths)
    assert words in str(refusal.value)
    columns = {**asdict(geometry("irsbot2")), **lengths}
    columns.pop("e")
    if "b" not in lengths or lengths["b"] < 1.0:  # assembly is a question of the design space, not of validity
        assert not Designs.columns(columns).valid


def test_every_erratum_has_place_statement_and_correction():
    for erratum in ERRATA.values():
        assert all(erratum)
        assert erratum.printed != erratum.correct
