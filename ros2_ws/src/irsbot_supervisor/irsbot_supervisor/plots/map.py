"""A map of margins as a picture: contours, loci, constraint points, and the free rectangle."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle as Patch

from irsbot_kinematics.analysis.force_workspace import ForceWorkspace
from irsbot_kinematics.analysis.rectangle import Rectangle
from irsbot_kinematics.analysis.workspace_maps import Map
from irsbot_kinematics.mechanism import Locus
from irsbot_kinematics.numerics.arithmetic import Array

COLOURS = {"type1": "black", "type2": "#d62728"}
NAMES = {"type1": "Type 1 locus", "type2": "Type 2 locus"}


def draw_map(
    found: Map,
    what: str,
    title: str,
    curves: tuple[Locus, ...],
    points: Array,
    rectangle: Rectangle | None,
    target: Path,
    crossings: Array,
) -> None:
    """Write a picture of one quantity of a map: PNG, SVG or PDF, by the suffix. crossings: (N, 2) points of Type 2 if
    its curves are not known."""
    values = getattr(found, what)
    wide = found.first[-1] - found.first[0]
    tall = found.second[-1] - found.second[0]
    figure = Figure(figsize=(8.0, 1.2 + 7.0 * float(np.clip(tall / wide, 0.4, 1.6))), layout="constrained")
    axes = figure.subplots()
    top = float(np.nanmax(values)) if np.isfinite(values).any() else 1.0
    shown = axes.contourf(
        found.first, found.second, values, levels=np.linspace(0.0, max(top, 1e-9), 21), cmap="viridis"
    )
    unit = "m" if what == "reach" else "1"
    figure.colorbar(shown, ax=axes, label=f"{what} [{unit}]", shrink=0.8)
    named: set[str] = set()
    for curve in curves:
        if np.isfinite(curve.points).any():
            label = None if curve.kind in named else NAMES[curve.kind]
            named.add(curve.kind)
            axes.plot(*curve.points.T, color=COLOURS[curve.kind], linewidth=1.4, label=label)
    if len(crossings):
        axes.plot(*crossings.T, ".", color=COLOURS["type2"], markersize=2.5, label=f"{NAMES['type2']}, off the grid")
    if len(points):
        axes.plot(
            *points.T, "o", color="#d62728", markersize=6, markeredgecolor="white", label="constraint singularity"
        )
    if rectangle is not None and rectangle.area > 0.0:
        corner = (-rectangle.half_width, rectangle.z_low)
        size = (2.0 * rectangle.half_width, rectangle.z_high - rectangle.z_low)
        axes.add_patch(Patch(corner, *size, fill=False, edgecolor="white", linewidth=1.8, label="free rectangle"))
    axes.set_xlabel(f"{found.axes[0]} [{found.units[0]}]")
    axes.set_ylabel(f"{found.axes[1]} [{found.units[1]}]")
    axes.set_title(title)
    axes.set_aspect("equal")
    axes.set_xlim(found.first[0], found.first[-1])
    axes.set_ylim(found.second[0], found.second[-1])
    if axes.get_legend_handles_labels()[1]:
        axes.legend(loc="upper right", fontsize="small", facecolor="#bbbbbb")
    figure.savefig(target, dpi=120)


def draw_force_map(
    names: tuple[str, str],
    first: Array,
    second: Array,
    largest: Array,
    admissible_n: float,
    centre: Sequence[float] | None,
    around: ForceWorkspace | None,
    title: str,
    target: Path,
) -> None:
    """Write a picture of the largest leg force, (len(second), len(first)) N, its limit, and a force workspace: PNG, SVG
    or PDF, by the suffix."""
    tall = float(np.clip((second[-1] - second[0]) / (first[-1] - first[0]), 0.4, 1.6))
    figure = Figure(figsize=(8.0, 1.2 + 7.0 * tall), layout="constrained")
    axes = figure.subplots()
    shown = axes.contourf(first, second, np.minimum(largest, 2.0 * admissible_n), levels=20, cmap="viridis_r")
    figure.colorbar(shown, ax=axes, label="largest leg force [N], at most twice the admissible one", shrink=0.8)
    known = largest[np.isfinite(largest)]
    if known.size and known.min() < admissible_n < known.max():
        axes.contour(first, second, largest, levels=[admissible_n], colors="white", linewidths=1.6)
        axes.plot([], [], color="white", label=f"{admissible_n:g} N")
    if around is not None and centre is not None:
        x = centre[0] + around.radius_m * np.cos(around.angle_rad)
        y = centre[1] + around.radius_m * np.sin(around.angle_rad)
        axes.plot(x, y, color=COLOURS["type2"], label=f"force workspace, {around.area_m2:.4f} m2")
        axes.plot(*centre[:2], "+", color=COLOURS["type2"])
    axes.set_xlabel(f"{names[0]} [m]")
    axes.set_ylabel(f"{names[1]} [m]")
    axes.set_title(title)
    axes.set_aspect("equal")
    if axes.get_legend_handles_labels()[1]:
        axes.legend(loc="upper right", fontsize="small", facecolor="#bbbbbb")
    figure.savefig(target, dpi=120)
