"""The mechanism and its workspace for the page: links as a tree, loci as curves, in the base frame."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import contourpy
import numpy as np

from irsbot_kinematics.analysis.workspace_maps import Box, Map, workspace_map
from irsbot_kinematics.errors import BadInput
from irsbot_kinematics.mechanism import Mechanism, Signs
from irsbot_kinematics.numerics.arithmetic import Array
from irsbot_supervisor.report.series import rounded

NODES = 161
"""Nodes of a grid in each direction, where loci are found on a grid."""

COARSE = 31
"""The same, where only the extent of the workspace is needed."""

ENLARGED = 8
"""How often a section may grow by half until it contains the workspace."""

AXES = ("x", "y", "z")


def view(mechanism: Mechanism, mode: Signs, poses: Array) -> dict[str, Any]:
    """The fixed parts: links, bars of the base, loci, and their plane. poses: (N, m), NaN if not known."""
    names = [one.name for one in mechanism.task]
    places = [AXES.index(name) for name in names if name in AXES]
    known = poses[np.isfinite(poses).all(axis=1)]
    curves, note = loci(mechanism, mode, known)
    skeleton = mechanism.skeleton()
    links = [asdict(link) for link in skeleton.links] if skeleton else []
    if skeleton is None:
        note += f" Mechanism '{mechanism.kind}' does not describe its links, so only its platform point is drawn."
    return {
        "task": [{"name": one.name, "unit": one.unit} for one in mechanism.task],
        "joints": [{"name": one.name, "unit": one.unit} for one in mechanism.joints],
        "places": places,
        "planar": len(places) == 2,
        "links": links,
        "rails": skeleton.rails if skeleton else [],
        "loci": [{"kind": kind, "points": list(zip(*map(rounded, points.T), strict=True))} for kind, points in curves],
        "note": note.strip(),
    }


def loci(mechanism: Mechanism, mode: Signs, known: Array) -> tuple[list[tuple[str, Array]], str]:
    """Curves (N, 2) by kind, first two task coordinates, m, NaN where interrupted; and notes on them.

    known: (N, m) poses; without a closed form the curves are a section of the workspace around them, at the last one.
    """
    closed_form = mechanism.loci(mode)
    if closed_form is not None:
        return [(curve.kind, curve.points) for curve in closed_form], ""
    if sum(one.name in AXES for one in mechanism.task) != 2:
        return [], "Loci are drawn for planar robots; those of this one are surfaces."
    if not len(known):
        return [], "No pose is known, so there is no section of the workspace to draw."
    others = tuple(known[-1, 2:].tolist())
    fixed = ", ".join(
        f"{one.name} = {value:.4g} {one.unit}" for one, value in zip(mechanism.task[2:], others, strict=True)
    )
    try:
        found = _section(mechanism, mode, known, others)
    except BadInput as error:
        return [], f"No loci: {error}."
    curves = []
    for kind, values in (("type1", found.reach), ("type2", found.type2 * found.assembly)):
        drawn = contourpy.contour_generator(found.first, found.second, values).lines(0.0)
        curves += [(kind, np.asarray(line)) for line in drawn]
    return curves, f"Loci are those of the last known {fixed}, found on a grid."


def _section(mechanism: Mechanism, mode: Signs, known: Array, others: tuple[float, ...]) -> Map:
    """Margins around the path in the plane of the first two coordinates, as far as the platform can move there."""
    low, high = known[:, :2].min(axis=0), known[:, :2].max(axis=0)
    middle, half = 0.5 * (low + high), max(0.5 * (high - low).max(), mechanism.length_m)
    for nodes in (*[COARSE] * ENLARGED, NODES):
        first, second = ((float(centre - half), float(centre + half)) for centre in middle)
        found = workspace_map(mechanism, mode, Box(first, second, others), (nodes, nodes))
        edge = np.concatenate([found.type1[[0, -1]].ravel(), found.type1[:, [0, -1]].ravel()])
        half *= 1.5 if np.isfinite(edge).any() else 1.0
    return found
