"""The mechanism and its workspace for the page: links as a tree, loci as curves, in the base frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import contourpy
import numpy as np

from irsbot_kinematics.analysis.workspace_maps import Box, Map, workspace_map
from irsbot_kinematics.errors import BadInput
from irsbot_kinematics.mechanism import Mechanism, Signs
from irsbot_kinematics.numerics.arithmetic import Array
from irsbot_supervisor.report.sections import stated_place
from irsbot_supervisor.report.series import rounded

NODES = 161
"""Nodes of a grid in each direction, where loci are found on a grid."""

COARSE = 31
"""The same, where only the extent of the workspace is needed."""

IN_SPACE = 101
"""NODES of a section of surfaces, which is found again as the robot moves."""

ENLARGED = 8
"""How often a section may grow by half until it contains the workspace."""

ENDLESS = 2.0
"""Length of a section in lengths of its other side, where the workspace goes on as far as it may grow."""

AXES = ("x", "y", "z")


def view(mechanism: Mechanism, mode: Signs, poses: Array, at: Sequence[float] | None = None) -> dict[str, Any]:
    """The fixed parts: links, bars of the base, loci, and their plane.

    poses: (N, m), NaN if not known. at: pose through which a section of the loci is taken, the last known without it.
    """
    names = [one.name for one in mechanism.task]
    places = [AXES.index(name) for name in names if name in AXES]
    known = poses[np.isfinite(poses).all(axis=1)]
    planar = len(places) == 2
    section = at if at is not None else known[-1].tolist() if len(known) else None
    curves, note = loci(mechanism, mode, known, section)
    if not planar and section is not None:
        curves = [(kind, np.column_stack([points, np.full(len(points), section[2])])) for kind, points in curves]
    skeleton = mechanism.skeleton()
    links = [asdict(link) for link in skeleton.links] if skeleton else []
    if skeleton is None:
        note += f" Mechanism '{mechanism.kind}' does not describe its links, so only its platform point is drawn."
    return {
        "task": [{"name": one.name, "unit": one.unit} for one in mechanism.task],
        "joints": [{"name": one.name, "unit": one.unit} for one in mechanism.joints],
        "places": places,
        "planar": planar,
        "section": "" if planar or not curves or section is None else stated_place(mechanism, section, ".4g"),
        "links": links,
        "rails": skeleton.rails if skeleton else [],
        "loci": [{"kind": kind, "points": list(zip(*map(rounded, points.T), strict=True))} for kind, points in curves],
        "note": note.strip(),
    }


def loci(
    mechanism: Mechanism, mode: Signs, known: Array, at: Sequence[float] | None
) -> tuple[list[tuple[str, Array]], str]:
    """Curves (N, 2) by kind, first two task coordinates, m, NaN where interrupted; and notes on them.

    known: (N, m) poses; at: one of them, None if none is known. Without a closed form the curves are a section of the
    workspace around them all, in the plane of the first two coordinates through `at`. Those of robots in space are
    surfaces, of which it shows nothing but the section: a picture, not a proof.
    """
    closed_form = mechanism.loci(mode)
    if closed_form is not None:
        return [(curve.kind, curve.points) for curve in closed_form], ""
    if at is None or not len(known):
        return [], "No pose is known, so there is no section of the workspace to draw."
    planar = sum(one.name in AXES for one in mechanism.task) == 2
    others, fixed = tuple(at[2:]), stated_place(mechanism, at, ".4g")
    try:
        found = _section(mechanism, mode, known, others, NODES if planar else IN_SPACE)
    except BadInput as error:
        return [], f"No loci: {error}."
    curves = []
    for kind, values in (("type1", found.reach), ("type2", found.type2 * found.assembly)):
        drawn = contourpy.contour_generator(found.first, found.second, values).lines(0.0)
        curves += [(kind, np.asarray(line)) for line in drawn]
    if planar:
        return curves, f"Loci are those of {fixed}, found on a grid."
    return curves, f"Loci are surfaces: drawn is their section at {fixed}, found on a grid."


def _section(mechanism: Mechanism, mode: Signs, known: Array, others: tuple[float, ...], fine: int) -> Map:
    """Margins around the path in the plane of the first two coordinates, as far as the platform can move there. fine:
    nodes in each direction."""
    low, high = known[:, :2].min(axis=0), known[:, :2].max(axis=0)
    middle: Array = 0.5 * (low + high)
    half: Array = np.full(2, max(0.5 * (high - low).max(), mechanism.length_m))

    def found(nodes: int) -> Map:
        first, second = ((float(centre - way), float(centre + way)) for centre, way in zip(middle, half, strict=True))
        return workspace_map(mechanism, mode, Box(first, second, others), (nodes, nodes))

    for _ in range(ENLARGED):
        reached = np.isfinite(found(COARSE).type1)
        cut = np.array([reached[:, [0, -1]].any(), reached[[0, -1]].any()])
        if not cut.any():
            break
        half = np.where(cut, 1.5 * half, half)
    else:
        half = np.where(cut, np.minimum(half, ENDLESS * half.min()), half)
    return found(fine)
