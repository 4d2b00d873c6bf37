"""Mechanisms of the user's own: chains of tubes and revolutes, against hand formulas and against the two families."""

from __future__ import annotations

import numpy as np
import pytest
import yaml
from irsbot2_3d import Design, leg

import irsbot_kinematics as irs
from irsbot_kinematics import stiffness
from irsbot_kinematics.stiffness import InvalidDesign, SingularPosture

TUBE = {"outer": "60 mm", "inner": "50 mm", "material": "aluminium"}
Y = [0, 1, 0]


@pytest.fixture
def load(tmp_path):
    """Loads a mapping as a design file."""

    def run(**stated):
        path = tmp_path / "own.yaml"
        path.write_text(yaml.safe_dump({"family": "chains", "sections": {"tube": TUBE}, "platform": "P"} | stated))
        return stiffness.load(path)

    return run


def as_list(place):
    return [float(value) for value in place]


def test_one_tube_is_a_cantilever(load):
    design = load(points={"unit": "mm", "A": [0, 0, 0], "P": [375, 0, 0]}, legs=[[{"tube": ["A", "P", "tube"]}]])
    C = stiffness.tube_compliance(stiffness.Tube(0.06, 0.05, 0.375, "aluminium"))
    assert np.allclose(stiffness.compliance(design), C, rtol=1e-9, atol=1e-15)
    assert np.allclose(stiffness.matrix(design) @ C, np.eye(6), atol=1e-8)
    assert stiffness.mass(design) == pytest.approx(2700 * np.pi / 4 * (0.06**2 - 0.05**2) * 0.375)


def test_two_tubes_in_series_are_one_long_tube(load):
    points = {"unit": "m", "A": [0.1, 0.2, 0.3], "M": [0.2, 0.4, 0.1], "P": [0.3, 0.6, -0.1]}
    broken = load(points=points, legs=[[{"tube": ["A", "M", "tube"]}, {"tube": ["M", "P", "tube"]}]])
    whole = load(points=points, legs=[[{"tube": ["A", "P", "tube"]}]])
    assert np.allclose(stiffness.compliance(broken), stiffness.compliance(whole), rtol=1e-8, atol=1e-16)


def test_chains_in_parallel_add_their_stiffness_also_within_a_chain(load):
    points = {"unit": "m", "A": [0, 0, 0], "B": [0, 0.3, 0], "P": [0.4, 0, 0.1], "Q": [0.5, 0.1, 0]}
    one = [{"tube": ["A", "Q", "tube"]}, {"tube": ["Q", "P", "tube"]}]
    two = [{"tube": ["B", "P", "tube"]}, {"revolute": ["P", [0, 0, 1]]}]
    together = load(points=points, legs=[one, two])
    alone = [stiffness.matrix(load(points=points, legs=[chain])) for chain in (one, two)]
    assert np.allclose(stiffness.matrix(together), alone[0] + alone[1], rtol=1e-9, atol=1e-6)
    nested = load(points=points, legs=[[{"parallel": [one, two]}]])
    assert np.allclose(stiffness.matrix(nested), stiffness.matrix(together), rtol=1e-9, atol=1e-6)


def test_a_revolute_in_a_strut_takes_a_rank_and_names_what_it_frees(load):
    points = {"unit": "m", "A": [0, 0, 0], "P": [0.4, 0, 0]}
    hinged = load(points=points, legs=[[{"tube": ["A", "P", "tube"]}, {"revolute": ["P", Y]}]])
    K = stiffness.matrix(hinged)
    assert hinged.rank == 5
    assert np.linalg.matrix_rank(K, tol=1e-9 * np.abs(K).max()) == 5
    with pytest.raises(SingularPosture, match="5 independent wrenches"):
        stiffness.compliance(hinged)
    moved = stiffness.deflection(hinged, (), (0.0, 10.0, 0.0, 0.0, 0.0, 0.0))
    assert moved[1] == pytest.approx(10.0 * stiffness.Tube(0.06, 0.05, 0.4, "aluminium").terms.bend)
    with pytest.raises(SingularPosture, match="nothing balances"):
        stiffness.deflection(hinged, (), (0.0, 0.0, 0.0, 0.0, 1.0, 0.0))


def irsbot2_as_chains(design, pose):
    """The robot of a preset written as a user would: points from an independent model of the geometry in space."""
    g = design.geometry
    q = irs.Robot(design.mechanism).inverse(pose)
    psi = [
        np.arctan2(-(pose[1] + g.e + g.l1 * np.sin(t)), pose[0] + s * g.b0 - g.l1 * np.cos(t))
        for s, t in ((1, q[0]), (-1, q[1]))
    ]
    d3 = Design(g.l1, g.l2eq, g.b, g.p, g.a1, g.a2, g.beta, g.e)
    up = design.parallelogram * np.array([design.direction[0], 0.0, design.direction[1]])
    points, legs = {"unit": "m", "P": [float(pose[0]), 0.0, float(pose[1])]}, []
    for k in (0, 1):
        at = leg(d3, k, q[k], psi[k])
        places = {"A": at.A, "B": at.B, "C": at.A + up, "D": at.B + up, "e": at.B - np.array([0.0, 0.0, g.e])}
        side = np.array([0.0, 0.5 * design.spacing, 0.0])
        places |= {"A+": at.A + side, "B+": at.B + side, "A-": at.A - side, "B-": at.B - side}
        places |= {f"E{j}": at.E[j] for j in (0, 1)} | {f"F{j}": at.F[j] for j in (0, 1)}
        points |= {f"{name}{k}": as_list(place) for name, place in places.items()}
        ends = ("",) if design.bars == 1 else ("+", "-")
        bars = [[{"tube": [f"A{i}{k}", f"B{i}{k}", "proximal"]}, {"revolute": [f"B{i}{k}", Y]}] for i in ends]
        tie = [{"revolute": [f"C{k}", Y]}, {"tube": [f"C{k}", f"D{k}", "parallel"]}, {"revolute": [f"D{k}", Y]}]
        rods = [
            [
                {"tube": [f"e{k}", f"E{j}{k}", "elbow"]},
                *({"revolute": [f"E{j}{k}", as_list(axis)]} for axis in (at.e1[j], at.e2[j])),
                {"tube": [f"E{j}{k}", f"F{j}{k}", "distal"]},
                *({"revolute": [f"F{j}{k}", as_list(axis)]} for axis in (at.e2[j], at.e1[j])),
            ]
            for j in (0, 1)
        ]
        legs.append([{"parallel": [*bars, tie]}, {"parallel": rods}])
    sections = {
        kind: {"outer": f"{s.outer!r} m", "inner": f"{s.inner!r} m", "material": s.material.name}
        for kind, s in design.sections.items()
    }
    return {"points": points, "legs": legs, "sections": sections}


@pytest.mark.parametrize("name", ["irsbot2_table2", "irsbot2_table4"])
@pytest.mark.parametrize("pose", [(0.0, -0.8), (0.3, -0.75), (-0.35, -0.9)])
def test_an_irsbot2_written_as_chains_is_the_irsbot2(load, name, pose):
    design = stiffness.load(name)
    stated = irsbot2_as_chains(design, pose)
    own = load(**stated)
    K, k = stiffness.matrix(design, pose), stiffness.matrix(own)
    assert np.abs(K - k).max() < 1e-8 * np.abs(K).max()
    C, c = stiffness.compliance(design, pose), stiffness.compliance(own)
    assert np.abs(C - c).max() < 1e-8 * np.abs(C).max()
    assert stiffness.mass(own) == pytest.approx(stiffness.mass(design), rel=1e-12)


def test_the_modules_of_the_irsbot2_have_the_ranks_of_the_sheet(load):
    """Sheet section 10: sub-chain ji 2, K_sp 4, K_para 6; actuators released: x0 and z0 of P free."""
    stated = irsbot2_as_chains(stiffness.load("irsbot2_table2"), (0.1, -0.8))
    para, distal = stated["legs"][0]
    assert load(**stated | {"legs": [distal["parallel"][0]]}).rank == 2
    assert load(**stated | {"legs": distal["parallel"]}).rank == 4
    assert load(**stated | {"legs": para["parallel"]}).rank == 6
    assert load(**stated | {"legs": [stated["legs"][0]]}).rank == 4
    assert load(**stated).rank == 6
    for chain in stated["legs"]:
        bar = chain[0]["parallel"][0]
        bar.insert(0, {"revolute": [bar[0]["tube"][0], Y]})
    released = stiffness.matrix(load(**stated))
    for free in (0, 2):
        assert np.abs(released[:, free]).max() < 1e-8 * np.abs(released).max()
    assert load(**stated).rank == 4


def test_chains_are_the_same_body_wherever_they_stand(load):
    """All points turned and moved, and another platform point."""
    stated = irsbot2_as_chains(stiffness.load("irsbot2_table4"), (0.2, -0.85))
    rng = np.random.default_rng(4)
    R = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    R *= np.sign(np.linalg.det(R))
    r = rng.normal(size=3)

    def turned(links):
        if isinstance(links, list):
            return [turned(entry) for entry in links]
        (kind, value), *_ = links.items()
        if kind == "revolute":
            return {kind: [value[0], as_list(R @ np.array(value[1]))]}
        return links if kind == "tube" else {kind: turned(value)}

    points = {
        name: place if name == "unit" else as_list(R @ np.array(place) + r) for name, place in stated["points"].items()
    }
    K = stiffness.matrix(load(**stated))
    there = stiffness.matrix(load(**stated | {"points": points, "legs": turned(stated["legs"])}))
    assert np.abs(there - stiffness.turned(K, R)).max() < 1e-8 * np.abs(K).max()
    Q = np.add(stated["points"]["P"], [0.1, 0.2, -0.3])
    moved = load(**stated | {"points": stated["points"] | {"Q": as_list(Q)}, "platform": "Q"})
    assert np.abs(stiffness.matrix(moved) - stiffness.moved(K, (0.1, 0.2, -0.3))).max() < 1e-8 * np.abs(K).max()


@pytest.mark.parametrize(
    ("changes", "stated"),
    [
        ({"points": {"A": [0, 0, 0], "P": [1, 0, 0]}}, "points have no unit"),
        ({"points": {"unit": "in", "A": [0, 0, 0], "P": [1, 0, 0]}}, "unit of length"),
        ({"points": {"unit": "m", "A": [0, 0], "P": [1, 0, 0]}}, r"points.A must be \[x, y, z\]"),
        ({"points": {"unit": "m", "A": [1, 0, 0], "P": [1, 0, 0]}}, "tube A to P: a tube needs a length > 0"),
        ({"platform": "R"}, "no platform point 'R'"),
        ({"legs": [[{"tube": ["A", "B", "tube"]}]]}, "no point 'B'"),
        ({"legs": [[{"tube": ["A", "P", "pipe"]}]]}, "no section 'pipe'"),
        ({"legs": [[{"spring": 1}]]}, r"legs\[0\]\[0\] must be \{tube"),
        ({"legs": [[{"revolute": ["P", [0, 0, 0]]}]]}, "axis of the revolute at 'P' needs a length > 0"),
        ({"legs": []}, "legs must be a list of chains"),
        ({"colour": "red"}, "unknown key 'colour'"),
    ],
)
def test_a_chain_that_cannot_be_is_refused_in_one_line(load, changes, stated):
    good = {"points": {"unit": "m", "A": [0, 0, 0], "P": [1, 0, 0]}, "legs": [[{"tube": ["A", "P", "tube"]}]]}
    load(**good)
    with pytest.raises(InvalidDesign, match=stated) as refusal:
        load(**good | changes)
    assert "\n" not in str(refusal.value)
    assert "own.yaml" in str(refusal.value)


def test_a_chain_without_a_tube_is_no_spring(load):
    design = load(points={"unit": "m", "A": [0, 0, 0], "P": [1, 0, 0]}, legs=[[{"revolute": ["A", Y]}]])
    with pytest.raises(InvalidDesign, match="a tube is missing"):
        stiffness.matrix(design)
