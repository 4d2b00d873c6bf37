"""The cells of Tables 1 to 3 of [S0] around one design, with the numbers of singular postures in each."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from math import asin, inf, isclose, isinf, pi, sqrt

from irsbot_kinematics.arguments import checked
from irsbot_kinematics.mechanisms.irsbot2_space import distal
from irsbot_kinematics.mechanisms.irsbot2_space.designs import PARAMETERS, Designs
from irsbot_kinematics.mechanisms.irsbot2_space.geometry import Irsbot2Geometry

BETA_BOUNDS = {"beta1": 0.0, "beta2": asin(1.0 / sqrt(3.0)), "beta3": pi / 4, "beta4": pi / 2}
"""rad; Table 2 of [S0]: where p8 passes p3 and p4."""


@dataclass(frozen=True)
class Bound:
    """One bound of Table 2: p1 = 0, p7 and l2eq5 are infinite; l2eq0 = 0 is ours."""

    name: str
    value: float


@dataclass(frozen=True)
class Cell:
    """An open interval of p or l2eq between two bounds."""

    low: Bound
    high: Bound
    here: bool
    """The design lies in it."""

    @property
    def name(self) -> str:
        return f"]{self.low.name}, {self.high.name}["


@dataclass(frozen=True)
class LengthCell(Cell):
    """An interval of l2eq for the p of the design, and the singular postures of the distal loop in it."""

    counts: dict[str, int]
    """Number of singular postures by kind: I, II, III, C1a, C1b."""
    table_3: bool
    """One of the cells of Table 3: free of Cases I to III, and l2eq > D."""


@dataclass(frozen=True)
class Cells:
    """Location of a design in the distal design space."""

    beta: Cell
    """Closed below, as in Table 3."""
    p: tuple[Cell, ...]
    l2eq: tuple[LengthCell, ...]
    counts: dict[str, int]
    table_3: bool
    distal_free: bool
    """Free of Cases I to III, bulky designs included."""


@checked
def cells(g: Irsbot2Geometry) -> Cells:
    """All cells of p for the a2 and beta of a design, and all cells of l2eq for its p."""
    t = distal.bounds(Designs.of(g))
    value = {name: float(bound[0]) for name, bound in t._asdict().items()}
    beta = next(cell for cell in reversed(_cells(BETA_BOUNDS, g.beta)) if cell.low.value <= g.beta)
    in_p = {"p1": 0.0, **{name: value[name] for name in ("p2", "p3", "p4", "p5", "p6", "p8")}, "p7": inf}
    in_l = {"l2eq0": 0.0, "l2eq1": value["l2eq1"], "l2eq2": value["l2eq2"], "l2eq5": inf}
    if value["p3"] < g.p < value["p5"]:  # elsewhere Q_I has no double root in its domain
        in_l["l2eq3"] = value["l2eq3"]
    if g.p < value["p8"]:
        in_l["l2eq4"] = value["l2eq4"]
    lengths = _cells(in_l, g.l2eq)
    inside = [2.0 * cell.low.value if isinf(cell.high.value) else _middle(cell) for cell in lengths]
    d = _with_l2eq(g, [*inside, g.l2eq])
    numbers = [
        dict(zip((k.value for k in distal.Kind), map(int, row), strict=True))
        for row in zip(*distal.counts(d), strict=True)
    ]
    free = distal.table_3(d).tolist()
    return Cells(
        beta=beta,
        p=tuple(_cells(in_p, g.p)),
        l2eq=tuple(
            LengthCell(c.low, c.high, c.here, n, f) for c, n, f in zip(lengths, numbers[:-1], free[:-1], strict=True)
        ),
        counts=numbers[-1],
        table_3=free[-1],
        distal_free=bool(distal.distal_free(d)[-1]),
    )


def _cells(bounds: dict[str, float], value: float) -> list[Cell]:
    order = sorted((Bound(name, at) for name, at in bounds.items()), key=lambda bound: bound.value)
    return [
        Cell(low, high, low.value < value < high.value)
        for low, high in pairwise(order)
        if not isclose(low.value, high.value)  # p8 = p3 at beta2, p8 = p4 at beta3
    ]


def _middle(cell: Cell) -> float:
    return 0.5 * (cell.low.value + cell.high.value)


def _with_l2eq(g: Irsbot2Geometry, lengths: list[float]) -> Designs:
    return Designs.columns({name: lengths if name == "l2eq" else getattr(g, name) for name in PARAMETERS})
