"""Leg forces under a load of any direction: instantaneous centres, admissible loads, force workspace.

Source: [S2], with the corrections in docs/explanation/sources.md. Its Table 1 of cases is not used: R_i,max <= R_adm is
tested directly. R_i,max comes from cofactors, which also works for platforms that cannot turn.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import acos, hypot, inf, sqrt, tau

import numpy as np
from numpy.typing import ArrayLike, NDArray

from irsbot_kinematics import arguments, statics
from irsbot_kinematics.arguments import check_fields, checked
from irsbot_kinematics.errors import BadInput
from irsbot_kinematics.mechanism import Legs, Mechanism, Signs
from irsbot_kinematics.numerics.arithmetic import ARRAYS, FLOATS, Array
from irsbot_kinematics.numerics.tolerances import FARTHEST, REACH_TOL_M, SCAN_TOL_M

MOST_RAYS = 10**6
"""1: more rays than any picture shows."""


@dataclass(frozen=True)
class Load:
    """A force of any direction, a moment of either sign, and the leg force that they may raise."""

    force_n: float
    moment_nm: float
    admissible_n: float

    def __post_init__(self) -> None:
        check_fields(self)
        for name in ("force_n", "moment_nm", "admissible_n"):
            if not 0.0 <= getattr(self, name) < inf:
                raise BadInput(f"{name} must be a finite number that is not negative, got {getattr(self, name)}")


@dataclass(frozen=True)
class LegPressure:
    """The hold of one leg on the platform while this leg alone yields ([S2], section II).

    angle_rad: alpha: between the leg's force and the velocity of the point that it holds.
    centre_m: Instantaneous centre of the platform seen from the platform point; infinite where it does not turn.
    distance_m: d: from the point held to the centre (in space: that point's velocity over the turn rate).
    gamma: Speed of the platform point over that of the point held: |P I|/d.
    """

    angle_rad: float
    centre_m: tuple[float, float]
    distance_m: float
    gamma: float

    def reaction_max(self, force_n: float, moment_nm: float = 0.0) -> float:
        """[S2] (8): (gamma f + |m|/d)/cos alpha, N. `statics.reaction_max` gives the same in one step."""
        cosine = FLOATS.cos(self.angle_rad)
        return (self.gamma * force_n + abs(moment_nm) / self.distance_m) / cosine if cosine > 0.0 else inf


@checked
def pressure(legs: Legs[float]) -> tuple[LegPressure, ...]:
    """Pressure angle, instantaneous centre and distance d of every leg. Raises BadInput at Type 2 (det A = 0)."""
    det, columns = statics.cofactors(legs.screws)
    if det == 0.0:
        raise BadInput("pressure angles have no instantaneous centres at Type 2 (det A = 0)")
    _, cosines = statics.pressure_cosines(FLOATS, legs.screws, legs.attachments)
    found = []
    for i, (column, cosine) in enumerate(zip(columns, cosines, strict=True)):
        *v, w = column if legs.attachments else (*column, 0.0)
        speed = sqrt(sum([value * value for value in v]))
        centre, held = (inf, inf), speed
        if legs.attachments:
            ax, ay = legs.attachments[i]
            held = hypot(v[0] - w * ay, v[1] + w * ax, *v[2:])
        if w != 0.0:
            centre = (-v[1] / w, v[0] / w)
        found.append(LegPressure(acos(cosine), centre, FLOATS.quotient(held, abs(w)), FLOATS.quotient(speed, held)))
    return tuple(found)


@checked
def reaction_max_many(mechanism: Mechanism, poses: ArrayLike, mode: Signs | str, load: Load) -> Array:
    """Largest force of every leg, (N, n) in N, at poses (N, m) in one working mode; NaN out of reach.

    Raises BadInput.
    """
    mode = arguments.working_mode(mechanism, mode)
    given = arguments.table(poses, len(mechanism.task), "poses")
    x = tuple(np.ascontiguousarray(column) for column in np.where(np.abs(given) <= FARTHEST, given, np.nan).T)
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        q, reach = mechanism.inverse(ARRAYS, x, mode)
        legs = mechanism.legs(ARRAYS, q, x)
        sizes = statics.reaction_max(ARRAYS, legs.screws, load.force_n, load.moment_nm, turns=bool(legs.attachments))
        reached = np.minimum.reduce(reach) >= -REACH_TOL_M
        return np.where(reached[:, None], np.stack(sizes, axis=1), np.nan)


def _plane(mechanism: Mechanism, plane: tuple[int, int]) -> tuple[int, int]:
    """Two different task coordinates. Raises BadInput."""
    first, second = (arguments.count(place, "plane", 0, len(mechanism.task) - 1) for place in plane)
    if first == second:
        raise BadInput(f"plane must be two different coordinates, got {first} twice")
    return first, second


def _grid(values: ArrayLike, what: str) -> Array:
    given = arguments.array(values, what, "a row of numbers")
    if given.ndim != 1 or not given.size or not (np.abs(given) <= FARTHEST).all():
        raise BadInput(f"{what} must be a row of finite numbers, got {arguments.shown(values)}")
    return given


@checked
def admissible(mechanism: Mechanism, poses: ArrayLike, mode: Signs | str, load: Load) -> NDArray[np.bool_]:
    """(N,) True if every leg force stays within the load's limit; False out of reach and at Type 2."""
    sizes = reaction_max_many(mechanism, poses, mode, load)
    return np.asarray((sizes <= load.admissible_n).all(axis=1))


@dataclass(frozen=True)
class ForceWorkspace:
    """Boundary of the poses around a centre that carry a load, in polar coordinates.

    angle_rad: (K,) evenly spaced over a turn, from the first of the two coordinates to the second.
    radius_m: (K,) to the first pose that does not carry the load or is out of reach; 0 where the centre does not.
    """

    angle_rad: Array
    radius_m: Array

    @property
    def area_m2(self) -> float:
        """Half the mean of r^2 times a turn."""
        return float(0.5 * tau * np.mean(self.radius_m**2))


@checked
def force_workspace(
    mechanism: Mechanism,
    centre: Sequence[float],
    mode: Signs | str,
    load: Load,
    *,
    rays: int = 720,
    step_m: float = 1e-3,
    plane: tuple[int, int] = (0, 1),
) -> ForceWorkspace:
    """Force workspace of [S2] around a pose: the first violation along every ray, refined to SCAN_TOL_M.

    plane: the two task coordinates, in m, that the rays span; the others keep their values. A violation narrower than
    step_m may be missed. The part of a ray after its first violation is not examined (as in Fig. 5 of [S2]).
    """
    rays, step_m = arguments.count(rays, "rays", 3, MOST_RAYS), arguments.positive(step_m, "step_m")
    plane = _plane(mechanism, plane)
    angle: Array = np.arange(rays, dtype=np.float64) * (tau / rays)
    ways = np.zeros((rays, len(mechanism.task)))
    ways[:, plane[0]], ways[:, plane[1]] = np.cos(angle), np.sin(angle)
    start = np.array(arguments.place(centre, mechanism.task, "centre"))

    def carries(radius: Array, on: NDArray[np.int64]) -> NDArray[np.bool_]:
        return admissible(mechanism, start + radius[:, None] * ways[on], mode, load)

    good = np.zeros(rays)
    going: NDArray[np.int_] = np.arange(rays) if carries(np.zeros(1), np.zeros(1, np.int64))[0] else np.arange(0)
    stopped = going
    while len(going):
        further = carries(good[going] + step_m, going)
        going = going[further]
        good[going] += step_m
    bad = good + step_m
    for _ in range(max(int(np.ceil(np.log2(step_m / SCAN_TOL_M))), 0)):
        middle = 0.5 * (good[stopped] + bad[stopped])
        carried = carries(middle, stopped)
        good[stopped[carried]], bad[stopped[~carried]] = middle[carried], middle[~carried]
    return ForceWorkspace(angle, good)


@checked
def reaction_map(
    mechanism: Mechanism,
    centre: Sequence[float],
    mode: Signs | str,
    load: Load,
    *,
    first_m: ArrayLike,
    second_m: ArrayLike,
    plane: tuple[int, int] = (0, 1),
) -> Array:
    """Largest leg force (len(second), len(first), n) in N over a grid of two task coordinates; NaN out of reach."""
    plane = _plane(mechanism, plane)
    first, second = np.meshgrid(_grid(first_m, "first_m"), _grid(second_m, "second_m"))
    poses = np.tile(arguments.place(centre, mechanism.task, "centre"), (first.size, 1))
    poses[:, plane[0]], poses[:, plane[1]] = first.ravel(), second.ravel()
    return reaction_max_many(mechanism, poses, mode, load).reshape(*first.shape, -1)
