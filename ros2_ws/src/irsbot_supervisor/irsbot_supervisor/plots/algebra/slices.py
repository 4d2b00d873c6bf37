"""Slices of joint or pose space: cells by their number of solutions, singular curves, cusps."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from irsbot_kinematics.algebra.cells import Cells, float_stack
from irsbot_kinematics.algebra.cusp_records import Cusp
from irsbot_kinematics.algebra.model.system import System
from irsbot_kinematics.algebra.plane import Plane
from irsbot_supervisor.plots.algebra.style import colour_of, label_of

NODES = 60
"""1: abscissae per column; denser at its ends, where walls have vertical tangents."""


def draw_cells(
    cells: Cells, system: System, target: Path, cusps: Sequence[Cusp] = (), title: str | None = None
) -> None:
    """Write a picture of one decomposed slice: cells by colour, walls as lines, cusps as vertices. target: its suffix
    selects the format. title: left out: the name and the fixed values."""
    figure = Figure(figsize=(7.5, 6.2), layout="constrained")
    show_cells(figure.subplots(), cells, system, cusps, title)
    figure.savefig(target, dpi=130)


def draw_side_by_side(joint: Cells, pose: Cells, system: System, target: Path) -> None:
    """Write a picture of the decomposed joint space of a robot beside its decomposed workspace."""
    figure = Figure(figsize=(13.0, 6.0), layout="constrained")
    left, right = figure.subplots(1, 2)
    show_cells(left, joint, system, (), "joint space: direct solutions")
    show_cells(right, pose, system, (), "workspace: inverse solutions")
    figure.savefig(target, dpi=130)


def show_cells(axes: Axes, cells: Cells, system: System, cusps: Sequence[Cusp] = (), title: str | None = None) -> None:
    """Draw a decomposition into axes, with a legend of regions and areas."""
    plane = cells.plane
    count = {(cell.column, cell.row): cell.count for cell in cells.cells}
    for column, (u, heights) in enumerate(_columns(plane)):
        for row in range(len(heights) - 1):
            axes.fill_between(
                u, heights[row], heights[row + 1], color=colour_of(count[column, row]), linewidth=0.5, zorder=1
            )
    _show_walls(axes, plane)
    first, second = cells.axes
    areas = cells.areas()
    regions = cells.counts()
    handles: list[Any] = [
        Patch(
            facecolor=colour_of(n),
            edgecolor="#888888",
            label=f"{n} solution{'s' if n != 1 else ''}: {regions[n][1]} region{'s' if regions[n][1] != 1 else ''}, "
            f"area {area:.4g}",
        )
        for n, area in areas.items()
    ]
    handles += _show_cusps(axes, cusps, first.name, second.name)
    axes.legend(handles=handles, loc="upper right", fontsize="small", framealpha=0.9)
    _finish(axes, system, cells, title)


def draw_curves(
    plane: Plane, system: System, names: tuple[str, str], target: Path, title: str, cusps: Sequence[Cusp] = ()
) -> None:
    """Write a picture of the singular curves of a slice, every branch, cusps as vertices. names: of the two axes."""
    figure = Figure(figsize=(7.0, 6.0), layout="constrained")
    axes = figure.subplots()
    _show_walls(axes, plane, label="singular")
    handles = [*axes.get_lines()[:1], *_show_cusps(axes, cusps, *names)]
    axes.legend(handles=handles, loc="upper right", fontsize="small")
    axes.set_xlabel(label_of(system, names[0]))
    axes.set_ylabel(label_of(system, names[1]))
    axes.set_xlim(*plane.first.box)
    axes.set_ylim(*plane.second.box)
    axes.set_title(title)
    figure.savefig(target, dpi=130)


def _columns(plane: Plane) -> list[tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]]:
    """Abscissae and boundaries (rows + 1, nodes) of every column, in the user's units."""
    first, second = plane.first, plane.second
    cuts = [first.box[0], *(first.user(float(root)) for root in plane.criticals), first.box[1]]
    found = []
    for k in range(len(plane.columns)):
        a, b = cuts[k], cuts[k + 1]
        nodes = a + (b - a) * 0.5 * (1.0 - np.cos(np.linspace(0.0, np.pi, NODES)))
        nodes = np.clip(nodes, a + 1e-7 * (b - a), b - 1e-7 * (b - a))
        us, rows = [], []
        for u in nodes:
            stack = float_stack(plane, first.chart_float(float(u)))
            if len(stack) == plane.rows(k) - 1:
                us.append(u)
                rows.append([second.box[0], *(second.user(v) for v in stack), second.box[1]])
        if us:
            us[0], us[-1] = a, b
            found.append((np.array(us), np.array(rows).T))
        else:
            found.append((np.array([a, b]), np.tile([[second.box[0]], [second.box[1]]], (1, 2))))
    return found


def _show_walls(axes: Axes, plane: Plane, label: str | None = None) -> None:
    for u, heights in _columns(plane):
        for row in heights[1:-1]:
            axes.plot(u, row, color="#333333", linewidth=1.0, zorder=3, label=label)
            label = None
    vertical = [curve for curve in plane.curves if curve.dv == 0]
    for curve in vertical:
        for root, _ in curve.columns and curve.at_v(0).complex_roots():
            if root.imag == 0 and float(plane.first.low) < float(root.real.mid()) < float(plane.first.high):
                axes.axvline(plane.first.user(float(root.real.mid())), color="#333333", linewidth=1.0, zorder=3)


def _show_cusps(axes: Axes, cusps: Sequence[Cusp], first: str, second: str) -> list[Any]:
    places = [{**cusp.joints, **cusp.pose} for cusp in cusps]
    if not places:
        return []
    return axes.plot([p[first] for p in places], [p[second] for p in places], "o", color="black", markersize=5,
                     markerfacecolor="white", zorder=7, label=f"{len(places)} cusps", clip_on=True)  # fmt: skip


def _finish(axes: Axes, system: System, cells: Cells, title: str | None) -> None:
    first, second = cells.axes
    axes.set_xlabel(label_of(system, first.name))
    axes.set_ylabel(label_of(system, second.name))
    axes.set_xlim(*first.box)
    axes.set_ylim(*second.box)
    fixed = ", ".join(f"{name} = {float_text(value)}" for name, value in cells.fixed.items())
    axes.set_title(title or f"{system.name}{f', {fixed}' if fixed else ''}: {_what(cells)}")


def _what(cells: Cells) -> str:
    return "direct solutions" if cells.space == "joint" else "inverse solutions"


def float_text(value: str) -> str:
    """A rational number as a decimal text."""
    return f"{float(Fraction(value)):g}"
