"""Distal design space of the IRSBot-2: constraint singularities that the distal loop can take.

Source: [S0] sections 3.4 to 5, (38)-(40), Tables 1 to 3, with the corrections of `errata`. Condition 1 (C1a, C1b),
which the tables leave out, is ours. All functions work on columns of valid designs.
"""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple

import numpy as np

from irsbot_kinematics.arguments import checked
from irsbot_kinematics.mechanisms.irsbot2_space.designs import Designs, Flags
from irsbot_kinematics.numerics.arithmetic import Array


class Kind(Enum):
    """Kinds of constraint-singular postures of the distal loop."""

    CASE_1 = "I"
    CASE_2 = "II"
    CASE_3 = "III"
    C1A = "C1a"
    C1B = "C1b"


class Bounds(NamedTuple):
    """Table 2, corrected: bounds of the cells of Tables 1 and 3, m. NaN where a bound does not exist."""

    p2: Array
    p3: Array
    p4: Array
    p5: Array
    p6: Array
    p8: Array
    l2eq1: Array
    l2eq2: Array
    l2eq3: Array
    l2eq4: Array


class Counts(NamedTuple):
    """Number of singular postures of each kind, per design."""

    case_1: Array
    case_2: Array
    case_3: Array
    c1a: Array
    c1b: Array


@checked
def bounds(d: Designs) -> Bounds:
    """Table 2 of [S0] with p4, p6, l2eq3 and l2eq4 corrected; 1 - s written as c^2/(1 + s), which cannot cancel."""
    a2s, s, c_sq = d.a2 * d.s, d.s, d.c**2
    p8 = a2s * s**2 / c_sq
    radicand = c_sq * (4.0 * d.p * d.a2 * s**3 - c_sq * (d.p - a2s) ** 2)
    return Bounds(
        p2=a2s * c_sq / (1.0 + s) ** 2,
        p3=a2s * c_sq / (1.0 + s**2),
        p4=a2s,
        p5=a2s * (1.0 + s**2) / c_sq,
        p6=a2s * (1.0 + s) ** 2 / c_sq,
        p8=p8,
        l2eq1=d.p / d.mu,
        l2eq2=d.D,
        l2eq3=_root_or_nan(radicand) / (2.0 * d.mu * s),
        l2eq4=np.where(d.p < p8, d.D * np.sqrt(d.p / p8), np.nan),
    )


@checked
def counts(d: Designs) -> Counts:
    """Table 1 of [S0] as rules, Case II corrected to four postures; Condition 1 added."""
    t = bounds(d)
    l = d.l2eq
    low, high = np.minimum(t.l2eq1, t.l2eq2), np.maximum(t.l2eq1, t.l2eq2)
    two = (low < l) & (l < high)
    four = (t.p3 < d.p) & (d.p < t.p5) & (t.l2eq3 < l) & (l < low)
    beyond = l > t.l2eq2
    return Counts(
        case_1=np.where(two, 2, np.where(four, 4, 0)),
        case_2=np.where((d.p < t.p8) & (t.l2eq4 < l) & (l < t.l2eq2), 4, 0),
        case_3=np.where((d.p < t.p8) & beyond, 4, 0),
        c1a=np.where(beyond, 2, 0),
        c1b=np.where(beyond, 2, 0),
    )


@checked
def table_3(d: Designs) -> Flags:
    """Table 3 of [S0]: no posture of Case I, II or III. It leaves out bulky designs (l2eq <= l2eq2) that have none
    either, and says nothing on Condition 1, which every design with l2eq > l2eq2 can take."""
    t = bounds(d)
    return (d.p > t.p8) & (d.l2eq > np.maximum(t.l2eq1, t.l2eq2))


def case_1_roots(d: Designs) -> Array:
    """Roots X = cos psi_II of Q_I in [-1, 1], (38): shape (2, n), the smaller first, NaN where there is none.

    Q_I is concave, and its values at +-1 factor, so that the number of roots is decided without rounding.
    """
    c_sq, ell = d.c**2, d.mu * d.l2eq
    A = -(d.l2eq**2) * d.s**2 * d.mu
    B = d.l2eq * c_sq * (d.p - d.a2 * d.s)
    C = -d.p * c_sq * d.D + d.l2eq**2 * d.mu
    at_plus = d.l2eq - d.D  # sign of Q_I(1) = (p + ell) c^2 (l2eq - D)
    at_minus = ell - d.p  # sign of Q_I(-1) = (ell - p) c^2 (l2eq + D)
    discriminant = B * B - 4.0 * A * C
    inside = (discriminant >= 0.0) & (np.abs(B) <= -2.0 * A)
    t = -0.5 * (B + np.copysign(np.sqrt(np.maximum(discriminant, 0.0)), B))
    one, other = t / A, np.divide(C, t, out=np.zeros_like(t), where=t != 0.0)
    smaller = (at_minus <= 0.0) & ((at_plus >= 0.0) | inside)
    larger = (at_plus <= 0.0) & ((at_minus >= 0.0) | inside)
    low, high = np.clip(np.minimum(one, other), -1.0, 1.0), np.clip(np.maximum(one, other), -1.0, 1.0)
    return np.stack([np.where(smaller, low, np.nan), np.where(larger, high, np.nan)])


def shared_root(d: Designs) -> Array:
    """X^2 = cos^2 theta of Q_II and Q_III, (39), (40): 1 - p/p8, shape (n,), NaN where p > p8."""
    X_sq = 1.0 - d.p / bounds(d).p8
    return np.where(X_sq >= 0.0, X_sq, np.nan)


def has_case_2(d: Designs) -> Flags:
    """Both leg lengths D|X| +- r of Case II are positive; at l2eq = D one of them is zero."""
    t = bounds(d)
    exists: Flags = (d.p <= t.p8) & (d.l2eq <= t.l2eq2) & (d.l2eq >= d.D * np.sqrt(d.p / t.p8))
    return exists


def has_case_3(d: Designs) -> Flags:
    """Q_III has roots and both leg lengths +-D cos theta + r are positive."""
    t = bounds(d)
    return (d.p <= t.p8) & (d.l2eq > t.l2eq2)


def has_condition_1(d: Designs) -> Flags:
    """The legs can stand upright, cos theta_k = 0: l2eq > D."""
    return d.l2eq > d.D


@checked
def distal_free(d: Designs) -> Flags:
    """No posture of Cases I, II, III, bulky designs included. Bounds count as not free; so does l2eq = D, where a leg
    vanishes in the root X = 1 of Q_I."""
    flags: Flags = np.isnan(case_1_roots(d)).all(axis=0) & ~has_case_2(d) & ~has_case_3(d)
    return flags


def _root_or_nan(value: Array) -> Array:
    root: Array = np.sqrt(np.where(value >= 0.0, value, np.nan))
    return root
