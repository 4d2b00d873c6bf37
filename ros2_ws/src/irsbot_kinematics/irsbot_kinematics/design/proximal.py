"""Proximal design space of the IRSBot-2: which singularities the arms l1 and the base b let it reach, and the zones.

Every question is one inequality `larger > smaller` between two lengths. A singular posture of the distal loop fixes
the vector E_I E_II = (2 centre, 2 height) but for b: the arms can hold it iff hypot(b - centre, height) <= l1. That
is exact for all kinds; [S0] (55)-(57), (62)-(64), (68)-(70) say the same where their square roots are real.
Source: [S0] section 6 with the corrections of `errata`; C1a, C1b, psi_I = psi_II and the lower bounds are ours.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from irsbot_kinematics.arguments import checked, one_of
from irsbot_kinematics.errors import BadInput
from irsbot_kinematics.mechanisms.irsbot2_space import distal
from irsbot_kinematics.mechanisms.irsbot2_space.designs import Designs, Flags
from irsbot_kinematics.numerics.arithmetic import Array


class Question(NamedTuple):
    """One condition of the design space, with its requirement in words and letters."""

    title: str
    inequality: str
    source: str


QUESTIONS: Mapping[str, Question] = {
    "assembled": Question("the robot can be assembled", "l1 + l2eq >= |b0|", "[S0] (44), corrected"),
    "opposite": Question("psi_I = psi_II + pi is out of reach", "l2eq > |b0| + l1", "[S0] (45), corrected"),
    "equal": Question("psi_I = psi_II is out of reach", "|b0| > l1", "ours"),
    "I1": Question("Case I, smaller root, is out of reach", "hypot(b - bc, h) > l1", "[S0] (55)-(57)"),
    "I2": Question("Case I, larger root, is out of reach", "hypot(b - bc, h) > l1", "[S0] (55)-(57)"),
    "II": Question("Case II is out of reach", "hypot(b - bc, h) > l1", "[S0] (62)-(64)"),
    "III": Question("Case III is out of reach", "hypot(b - bc, h) > l1", "[S0] (68)-(70)"),
    "legs": Question("no distal leg can vanish", "|l2eq - D| > 0", "ours"),
    "C1a": Question("Condition 1, legs upright side by side, is out of reach", "|b - bc| > l1", "ours"),
    "C1b": Question("Condition 1, one leg up and one down, is out of reach", "hypot(b - bc, h) > l1", "ours"),
}
_CASES = ("I1", "I2", "II", "III", "legs")
ZONES: Mapping[str, tuple[str, ...]] = {
    "a": ("assembled",),
    "wac": ("assembled", "opposite"),
    "i": _CASES[:2],
    "csc": _CASES,
    "z": ("assembled", *_CASES),
    "wps": ("assembled", *_CASES, "opposite"),
    "strict": ("assembled", *_CASES, "opposite", "equal", "C1a", "C1b"),
}
"""Questions that must be answered yes in a zone of the {l1, b} plane. `csc` is the paper's Z_I where only Case I
occurs; `strict` is ours: free of every parallel singularity in all modes."""


class Lengths(NamedTuple):
    """Both sides of a question, m: it holds where larger > smaller (assembled: >=)."""

    larger: Array
    smaller: Array

    @property
    def slack(self) -> Array:
        """larger - smaller, m: distance of the lengths from another answer; infinite if there is nothing to reach."""
        return self.larger - self.smaller


class Seat(NamedTuple):
    """The region of the {l1, b} plane in which a kind of singular posture can be held: hypot(b - centre, height) <=
    l1. NaN where the distal loop cannot take the posture."""

    centre: Array
    height: Array


@checked
def find_seats(d: Designs) -> dict[str, Seat]:
    """Seats of all kinds of singular postures, by the name of their question; they do not depend on l1 and b."""
    roots = distal.case_1_roots(d)
    rise = np.sqrt(1.0 - roots**2)
    X_sq = distal.shared_root(d)
    middle, lift = d.s2g + d.D * X_sq, d.D * np.sqrt(X_sq * (1.0 - X_sq))
    case_2, case_3 = distal.has_case_2(d), distal.has_case_3(d)
    upright = distal.has_condition_1(d)
    length = np.sqrt(np.where(upright, d.l2eq**2 - d.D**2, np.nan))
    base = np.where(upright, d.s2g, np.nan)
    return {
        "I1": Seat(d.s1g - d.l2eq * roots[0], d.l2eq * rise[0]),
        "I2": Seat(d.s1g - d.l2eq * roots[1], d.l2eq * rise[1]),
        "II": Seat(np.where(case_2, middle, np.nan), np.where(case_2, lift, np.nan)),
        "III": Seat(np.where(case_3, middle, np.nan), np.where(case_3, lift, np.nan)),
        "C1a": Seat(base, np.where(upright, 0.0, np.nan)),
        "C1b": Seat(base, length),
    }


@checked
def evaluate_questions(d: Designs) -> dict[str, Lengths]:
    """Both sides of every question of QUESTIONS, exact."""
    offset = np.abs(d.b0)
    found = {
        "assembled": Lengths(d.l1 + d.l2eq, offset),
        "opposite": Lengths(d.l2eq, offset + d.l1),
        "equal": Lengths(offset, d.l1),
        "legs": Lengths(np.abs(d.l2eq - d.D), np.zeros_like(d.D)),
    }
    for name, seat in find_seats(d).items():
        distance = np.hypot(d.b - seat.centre, seat.height)
        found[name] = Lengths(np.where(np.isnan(distance), np.inf, distance), d.l1)
    return {name: found[name] for name in QUESTIONS}


def holds(name: str, lengths: Lengths) -> Flags:
    """True if the answer to a question is yes. A design that just touches a singularity reaches it."""
    flags: Flags = lengths.larger >= lengths.smaller if name == "assembled" else lengths.larger > lengths.smaller
    return flags


@checked
def in_zone(zone: str, found: Mapping[str, Lengths]) -> Flags:
    """Membership in one of ZONES."""
    asked = ZONES[one_of(zone, tuple(ZONES), "zone")]
    if not set(asked) <= set(found):
        raise BadInput(f"found must answer {', '.join(asked)}, as design.answers does")
    flags: Flags = np.all([holds(name, found[name]) for name in asked], axis=0)
    return flags


def slack(zone: str, found: Mapping[str, Lengths]) -> Array:
    """m: the smallest slack of a zone's questions; above 0 inside, below 0 outside."""
    least: Array = np.min([found[name].slack for name in ZONES[zone]], axis=0)
    return least


@checked
def evaluate_printed_zones(d: Designs) -> dict[str, Flags]:
    """The zones as [S0] prints them: Z_a (44), Z_wac (45), Z_I1 to Z_III (56)-(70), their intersections Z and Z_wps.

    Read with every b outside a posture whose square root is not real. See `errata` for what is missing.
    """
    found = {"a": d.b < d.l1 + d.l2eq + d.s1g, "wac": d.b < -d.l1 + d.l2eq + d.s1g}
    for name, seat in find_seats(d).items():
        if not name.startswith("C1"):
            half = np.sqrt(np.maximum(d.l1**2 - seat.height**2, 0.0))
            found[name] = ~((d.b > seat.centre - half) & (d.b < seat.centre + half))
    found["i"] = found["I1"] & found["I2"]
    found["csc"] = found["i"] & found["II"] & found["III"]
    found["z"] = found["a"] & found["csc"]
    found["wps"] = found["z"] & found["wac"]
    return found
