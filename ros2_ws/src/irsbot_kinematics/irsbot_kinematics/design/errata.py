"""Statements of [S0] that differ from the result here, by subject."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple


class Erratum(NamedTuple):
    """One printed statement that does not hold, and the correct one."""

    where: str
    printed: str
    correct: str


ERRATA: Mapping[str, Erratum] = {
    "assembled": Erratum("(44), (75)", "b < l1 + l2eq + s1g", "also b >= s1g - l2eq - l1: |b0| <= l1 + l2eq"),
    "opposite": Erratum(
        "(45), (76)",
        "b < -l1 + l2eq + s1g keeps every actuation singularity away",
        "also b > s1g - l2eq + l1, and psi_I = psi_II stays within reach unless |b0| > l1",
    ),
    "roots": Erratum(
        "(55)-(57), (62)-(64), (68)-(70), (73), (74)",
        "b < bc - sqrt(l1^2 - h^2) or b > bc + sqrt(l1^2 - h^2), with l1 > h",
        "every b where l1 < h; b = bc -+ sqrt(l1^2 - h^2) reaches the posture",
    ),
    "p4": Erratum("Table 2", "p4 = (1 + s^2)/(a2 s)", "p4 = a2 s"),
    "p6": Erratum("Table 2", "p6 = (1 - s)/(1 + s) a2 s, which is p2", "p6 = (1 + s)/(1 - s) a2 s"),
    "l2eq3": Erratum("Table 2", "radicand of l2eq3", "the opposite sign of the whole radicand"),
    "l2eq4": Erratum("Table 2", "l2eq4 = D sin(theta_II)", "l2eq4 = D |sin(theta_II)| = D sqrt(p/p8)"),
    "case_2": Erratum(
        "Table 1, (39)",
        "two postures of Case II, l2eq in [D, D[",
        "four (the leg lengths can be exchanged), l2eq in ]l2eq4, D[",
    ),
    "condition_1": Erratum(
        "Section 5, Table 3",
        "no constraint singularity",
        "none of Condition 2; the loop takes C1a and C1b whenever l2eq > D",
    ),
}
