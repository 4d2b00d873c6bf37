"""Postures, margins and first bounds of many samples at once.

The equations are those of the mechanism, with the sines and roots of numpy: they may differ from those of the `math`
module in the last digits. Such differences grow by quotients of margins, lengths and levers, which are at least
LEAST_LIMIT where a sample counts as clear. GUARD is far above what is left of 16 digits after two such quotients, and
far below what any setting resolves: a number within it of a limit decides nothing here.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from irsbot_kinematics import Mechanism, statics
from irsbot_kinematics.mechanism import CertifiedColumns, Legs
from irsbot_kinematics.numerics.arithmetic import ARRAYS, Array
from irsbot_kinematics.numerics.tolerances import CLOSURE_TOL_M, SIGN_DEAD_BAND
from irsbot_supervisor.bag.joint_columns import Values

GUARD = 1e-6
"""1, m: see above."""


@dataclass(frozen=True, eq=False)
class PostureColumns:
    """Postures of N samples.

    clear: (N,) True where the posture is surely solved, in the configured modes, and away from Type 2.
    gaps: (N, 2) m, as `Posture.gaps`.
    pose: (N, m).
    margins: (N, 4) in the order of `Margins`.
    legs: arrays per leg.
    cosines: of the pressure angles.
    """

    clear: NDArray[np.bool_]
    gaps: Values
    pose: Values
    margins: Values
    legs: Legs[Array]
    cosines: tuple[Array, ...]


def postures(
    mechanism: Mechanism, joints: Values, modes: tuple[tuple[int, ...], int], contact_m: float
) -> PostureColumns:
    """Postures of joints (N, n). modes: working mode and assembly mode of the settings. contact_m: clearance that
    counts as contact."""
    working, assembly = modes
    with np.errstate(all="ignore"):
        q = tuple(np.ascontiguousarray(column) for column in joints.T)
        pose, legs, found, clear = assembled(mechanism, q, assembly)
        _, cosines = statics.pressure_cosines(ARRAYS, legs.screws, legs.attachments)
        clearances = np.stack(found, axis=1)
        clear &= (clearances > contact_m + GUARD).all(1)
        for sign, sine in zip(working, legs.normalised_levers, strict=True):
            clear &= sign * sine > SIGN_DEAD_BAND + GUARD
        margins: Values = np.full((len(joints), 4), np.inf)
        margins[:, 0] = np.min([np.abs(sine) for sine in legs.normalised_levers], axis=0)
        margins[:, 1] = np.min(cosines, axis=0)
        if legs.constraint is not None:
            margins[:, 2] = legs.constraint
        if legs.limb:
            margins[:, 3] = np.min(legs.limb, axis=0)
    return PostureColumns(clear, clearances.astype(float), np.stack(pose, axis=1).astype(float), margins, legs, cosines)


def assembled(
    mechanism: Mechanism, joints: tuple[Array, ...], assembly: int
) -> tuple[tuple[Array, ...], Legs[Array], tuple[Array, Array], NDArray[np.bool_]]:
    """Pose, legs and assembly clearances at joints, (N,) each, and where they are surely those of a solved posture."""
    pose, gaps = mechanism.direct(ARRAYS, joints, assembly)
    legs = mechanism.legs(ARRAYS, joints, pose)
    solved = (gaps[0] > GUARD) & (gaps[1] > GUARD)
    for error in legs.closure:
        solved &= np.abs(error) <= 0.5 * CLOSURE_TOL_M
    return pose, legs, gaps, solved


def four_margins(bounds: CertifiedColumns | None, count: int) -> Values:
    """(N, 4) bounds in the order of `Margins`; NaN if the mechanism has no form for many."""
    found = np.full((count, 4), np.inf)
    if bounds is None:
        return np.full_like(found, np.nan)
    found[:, 0], found[:, 1] = np.min(bounds.type1, axis=0), bounds.type2
    if bounds.constraint is not None:
        found[:, 2] = bounds.constraint
    if bounds.limb:
        found[:, 3] = np.min(bounds.limb, axis=0)
    return found
