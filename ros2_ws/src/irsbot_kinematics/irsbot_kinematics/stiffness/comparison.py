"""Tables 1, 2 and 4 of [S1], compared with the model, and the results that cannot be reproduced.

The paper does not print its poses, the angle beta, the spacing of the two bars, the material or the rods of the
five-bar. The poses here are assumed; docs/explanation/stiffness.md gives the reasons.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import cos, radians
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from irsbot_kinematics.arguments import array, checked
from irsbot_kinematics.errors import BadInput
from irsbot_kinematics.numerics.arithmetic import Array
from irsbot_kinematics.stiffness.design_file import load
from irsbot_kinematics.stiffness.response import deflection, table_of
from irsbot_kinematics.stiffness.structure import Structure

SIDEWAYS_N = 100.0
"""N: the force along y0 of the paper."""

POSES: Array = np.array([(x, z) for z in (-0.7, -0.76667, -0.83333, -0.9) for x in (-0.4, -0.2, 0.0, 0.2, 0.4)])
"""(20, 2) m: assumed poses in place of the paper's twenty configurations, which it does not print."""


class Statistics(NamedTuple):
    """Deflection along y0 under SIDEWAYS_N over some poses, mm, and mass of the tubes, kg."""

    largest_mm: float
    mean_mm: float
    deviation_mm: float
    """Standard deviation of the population."""
    mass_kg: float


class Row(NamedTuple):
    """One case: the printed values, NaN where there are none, and those of the model, None if there is no model."""

    case: str
    printed: Statistics
    found: Statistics | None
    remark: str


NOT_PRINTED = Statistics(*[float("nan")] * 4)


@checked
def statistics(design: Structure, poses: ArrayLike = POSES) -> Statistics:
    """Deflection along y0 under 100 N over poses (N, 2). Raises BadInput without a pose, and if one has no result."""
    places = some_poses(poses)
    moved = 1e3 * sideways(design, places)
    if not np.isfinite(moved).all():
        where = places[~np.isfinite(moved)][0].tolist()
        raise BadInput(f"pose {where} has no deflection: it is out of reach or singular")
    return Statistics(float(moved.max()), float(moved.mean()), float(moved.std()), design.mass)


def some_poses(poses: ArrayLike) -> Array:
    """At least one pose (x, z), m, as (N, 2). Raises BadInput."""
    places = table_of(poses)
    if not len(places):
        raise BadInput("poses must be at least one, got none")
    return places


def sideways(design: Structure, poses: ArrayLike) -> Array:
    """Deflection along y0 of P under 100 N along y0, m; one pose (2,) or many (N, 2)."""
    moved: Array = deflection(design, poses, (0.0, SIDEWAYS_N, 0.0, 0.0, 0.0, 0.0))[..., 1]
    return moved


@checked
def index(deflections: Mapping[str, ArrayLike]) -> dict[str, Array]:
    """r of [S1] (23) for each robot: deflection over 25 times the largest of all robots and poses; NaN is skipped."""
    moved = {name: array(values, "deflections", "numbers in m") for name, values in deflections.items()}
    largest = max(
        (float(np.max(values, initial=0.0, where=~np.isnan(values))) for values in moved.values()), default=0.0
    )
    if not 0.0 < largest < np.inf:
        raise BadInput("deflections must hold at least one > 0 m, all of them finite or NaN")
    return {name: values / (25.0 * largest) for name, values in moved.items()}


def table() -> tuple[Row, ...]:
    """Every case of Tables 1, 2 (with 3) and 4 (with 5), with its assumptions."""
    printed = Statistics(1.227, 1.135, 0.064, 5.6)
    rows = [
        _row("Table 1, five-bar, revolute at P", "five_bar_table1", printed, "mass reproduced; poses assumed"),
        _row(
            "Table 1, five-bar, ball joint at P",
            "five_bar_table1",
            printed,
            "agrees, but other joints and poses do as well: not conclusive",
            platform_joint="spherical",
        ),
        Row(
            "Table 1, Par2",
            Statistics(1.158, 0.382, 0.205, 5.77),
            None,
            "not reproducible: material, rods and workspace are in the paper's ref. 19",
        ),
    ]
    for beta in (30.0, 40.0, 45.0, 50.0):
        remark = "beta not printed; Table 3 has no numbers in the text at hand"
        if beta == 45.0:
            remark = "beta not printed; here the constraints (22) against Table 1 bind; Table 3 has no numbers"
        rows.append(_row(f"Table 2, beta {beta:g} deg", "irsbot2_table2", NOT_PRINTED, remark, beta=radians(beta)))
    rows.append(
        _row(
            "Table 4, beta 45 deg, elbow of one tube",
            "irsbot2_table4",
            NOT_PRINTED,
            "'twice as stiff' is not reproducible with this elbow; Table 5 has no numbers in the text at hand",
        )
    )
    for beta, spacing in ((45.0, 0.2), (45.0, 0.4), (45.0, None), (40.0, None), (30.0, None)):
        apart = 2.0 * 0.42 * cos(radians(beta)) if spacing is None else spacing
        changes = {"beta": radians(beta), "spacing": apart, "rigid": ("elbow",)}
        remark = "limit of a triangulated elbow; spacing and beta not printed"
        rows.append(
            _row(
                f"Table 4, beta {beta:g} deg, s {apart:.3f} m, rigid elbow",
                "irsbot2_table4",
                NOT_PRINTED,
                remark,
                **changes,
            )
        )
    return tuple(rows)


def _row(case: str, name: str, printed: Statistics, remark: str, **changes: Any) -> Row:
    design = load(name, **changes)
    assert isinstance(design, Structure)
    return Row(case, printed, statistics(design), remark)
