"""Forces that a load of any direction raises in the legs: instantaneous centres, admissible loads, force workspace.

Source: [S2], corrected as docs/sources.md lists. Its Table 1 of cases is not used: R_i,max <= R_adm is tested directly,
with R_i,max from cofactors, which holds for platforms that cannot turn as well.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import acos, hypot, inf, sqrt, tau

import numpy as np
from numpy.typing import ArrayLike, NDArray

from irsbot_kinematics import statics
from irsbot_kinematics.arithmetic import ARRAYS, FLOATS, Array
from irsbot_kinematics.errors import BadInput
from irsbot_kinematics.mechanism import Legs, Mechanism, Signs
from irsbot_kinematics.tolerances import REACH_TOL_M, SCAN_TOL_M


@dataclass(frozen=True)
class Load:
    """A force of any direction, a moment of either sign, and the leg force that they may raise."""

    force_n: float
    moment_nm: float
    admissible_n: float

    def __post_init__(self) -> None:
        for name in ("force_n", "moment_nm", "admissible_n"):
            if not 0.0 <= getattr(self, name) < inf:
                raise BadInput(f"{name} must be a finite number that is not negative, got {getattr(self, name)}")


@dataclass(frozen=True)
class LegPressure:
    """How one leg holds the platform while it alone yields ([S2], section II).

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
        """[S2] (8): (gamma f + |m|/d)/cos alpha, N. `statics.reaction_max` gives the same without these detours."""
        cosine = FLOATS.cos(self.angle_rad)
        return (self.gamma * force_n + abs(moment_nm) / self.distance_m) / cosine if cosine > 0.0 else inf


def pressure(legs: Legs[float]) -> tuple[LegPressure, ...]:
    """Pressure angle, instantaneous centre and distance d of every leg. Raises BadInput at Type 2 (det A = 0)."""
    det, columns = statics.cofactors(legs.screws)
    if det == 0.0:
        raise BadInput("pressure angles have no instantaneous centres at Type 2 (det A = 0)")
    _, cosines = statics.pressure_cosines(FLOATS, legs.screws, legs.arms)
    found = []
    for i, (column, cosine) in enumerate(zip(columns, cosines, strict=True)):
        *v, w = column if legs.arms else (*column, 0.0)
        speed = sqrt(sum([value * value for value in v]))
        centre, held = (inf, inf), speed
        if legs.arms:
            ax, ay = legs.arms[i]
            held = hypot(v[0] - w * ay, v[1] + w * ax, *v[2:])
        if w != 0.0:
            centre = (-v[1] / w, v[0] / w)
        found.append(LegPressure(acos(cosine), centre, FLOATS.quotient(held, abs(w)), FLOATS.quotient(speed, held)))
    return tuple(found)


def reaction_max_many(mechanism: Mechanism, poses: ArrayLike, mode: Signs, load: Load) -> Array:
    """Largest force of every leg, (N, n) in N, at poses (N, m) in one working mode; NaN out of reach.

    Raises BadInput.
    """
    known = mechanism.working_modes
    if mode not in known:
        raise BadInput(f"working mode {mode!r} is not one of {known}")
    x = tuple(np.ascontiguousarray(column) for column in _poses(mechanism, poses).T)
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        q, reach = mechanism.inverse(ARRAYS, x, mode)
        legs = mechanism.legs(ARRAYS, q, x)
        sizes = statics.reaction_max(ARRAYS, legs.screws, load.force_n, load.moment_nm, turns=bool(legs.arms))
        reached = np.minimum.reduce(reach) >= -REACH_TOL_M
        return np.where(reached[:, None], np.stack(sizes, axis=1), np.nan)


def _poses(mechanism: Mechanism, poses: ArrayLike) -> Array:
    """(N, m) finite numbers. Raises BadInput."""
    try:
        found = np.asarray(poses, dtype=float)
    except (TypeError, ValueError):
        raise BadInput(f"poses must be numbers, got {poses!r}") from None
    if found.ndim != 2 or found.shape[1] != len(mechanism.task):
        raise BadInput(f"poses must be numbers of shape (N, {len(mechanism.task)}), got shape {found.shape}")
    return found


def _centre(mechanism: Mechanism, centre: Sequence[float]) -> Array:
    """(m,) finite numbers. Raises BadInput."""
    pose: Array = _poses(mechanism, [centre])[0]
    if not np.isfinite(pose).all():
        raise BadInput(f"the centre must be finite, got {tuple(centre)}")
    return pose


def admissible(mechanism: Mechanism, poses: ArrayLike, mode: Signs, load: Load) -> NDArray[np.bool_]:
    """(N,) whether every leg force stays within the load's limit; False out of reach and at Type 2."""
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


def force_workspace(
    mechanism: Mechanism,
    centre: Sequence[float],
    mode: Signs,
    load: Load,
    *,
    rays: int = 720,
    step_m: float = 1e-3,
    plane: tuple[int, int] = (0, 1),
) -> ForceWorkspace:
    """Force workspace of [S2] around a pose: along every ray the first violation, refined to SCAN_TOL_M.

    plane: the two task coordinates, in m, that the rays span; the others keep their values. A violation narrower than
    step_m may be passed over, and what lies behind the first one is not looked at (Fig. 5 of [S2] does the same).
    """
    if not (step_m > 0.0 and rays >= 3):
        raise BadInput(f"force workspace needs step_m > 0 and at least 3 rays, got {step_m} and {rays}")
    angle: Array = np.arange(rays, dtype=np.float64) * (tau / rays)
    ways = np.zeros((rays, len(mechanism.task)))
    ways[:, plane[0]], ways[:, plane[1]] = np.cos(angle), np.sin(angle)
    start = _centre(mechanism, centre)

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


def reaction_map(
    mechanism: Mechanism,
    centre: Sequence[float],
    mode: Signs,
    load: Load,
    *,
    first_m: ArrayLike,
    second_m: ArrayLike,
    plane: tuple[int, int] = (0, 1),
) -> Array:
    """Largest leg force (len(second), len(first), n) in N over a grid of two task coordinates; NaN out of reach."""
    first, second = np.meshgrid(np.asarray(first_m, dtype=float), np.asarray(second_m, dtype=float))
    poses = np.tile(_centre(mechanism, centre), (first.size, 1))
    poses[:, plane[0]], poses[:, plane[1]] = first.ravel(), second.ravel()
    return reaction_max_many(mechanism, poses, mode, load).reshape(*first.shape, -1)
