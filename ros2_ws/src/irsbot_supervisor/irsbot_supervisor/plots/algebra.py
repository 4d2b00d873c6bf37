"""Pictures of the algebraic analysis: cells, curves with cusps, configurations, paths and their images."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from irsbot_kinematics.algebra.cells import Cells, float_stack
from irsbot_kinematics.algebra.cusp_records import Cusp
from irsbot_kinematics.algebra.images import ImagePoint
from irsbot_kinematics.algebra.model.system import System
from irsbot_kinematics.algebra.plane import Plane
from irsbot_kinematics.algebra.solving import Configuration

NODES = 60
"""1: abscissae per column; denser at its ends, where walls have vertical tangents."""

COLOURS = {0: "#f2f2f2", 1: "#9ecae1", 2: "#4292c6", 4: "#f6c85f", 6: "#d95f4c", 8: "#6aa84f"}
"""Colours by number of solutions."""

BRANCHES = ("#1f77b4", "#d62728", "#2ca02c", "#9467bd", "#ff7f0e", "#17becf", "#8c564b", "#e377c2")


def colour_of(count: int) -> str:
    """A colour for each number of solutions."""
    return COLOURS.get(count, BRANCHES[count % len(BRANCHES)])


def label_of(system: System, name: str) -> str:
    """A name with its unit; lengths of predefined manipulators have the unit of their lengths."""
    return f"{name} [{system.units.get(name, 'length')}]"


def draw_cells(
    cells: Cells, system: System, target: Path, cusps: Sequence[Cusp] = (), title: str | None = None
) -> None:
    """One decomposed slice: cells by colour, walls as lines, cusps as vertices."""
    figure = Figure(figsize=(7.5, 6.2), layout="constrained")
    show_cells(figure.subplots(), cells, system, cusps, title)
    figure.savefig(target, dpi=130)


def draw_side_by_side(joint: Cells, pose: Cells, system: System, target: Path) -> None:
    """Joint space and workspace of one robot."""
    figure = Figure(figsize=(13.0, 6.0), layout="constrained")
    left, right = figure.subplots(1, 2)
    show_cells(left, joint, system, (), "joint space: direct solutions")
    show_cells(right, pose, system, (), "workspace: inverse solutions")
    figure.savefig(target, dpi=130)


def show_cells(axes: Axes, cells: Cells, system: System, cusps: Sequence[Cusp] = (), title: str | None = None) -> None:
    """Draw a decomposition into axes."""
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
    """Singular curves of a slice, every branch, cusps as vertices."""
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


def draw_configurations(system: System, found: Sequence[Configuration], target: Path, title: str | None = None) -> None:
    """Every configuration in its own panel: actuators blue, platform filled, named points."""
    spatial = any(len(point) == 3 for point in system.drawing.points.values())
    columns = min(4, max(1, len(found)))
    rows = max(1, -(-len(found) // columns))
    figure = Figure(figsize=(3.6 * columns, 3.5 * rows), layout="constrained")
    for i, configuration in enumerate(found):
        axes: Any = figure.add_subplot(rows, columns, i + 1, projection="3d" if spatial else None)
        _show_robot(axes, system, configuration, BRANCHES[i % len(BRANCHES)])
        varied = [n for n in found[0].values if len({round(c.values[n], 9) for c in found}) > 1] or list(system.pose)
        stated = ", ".join(f"{name} = {configuration.values[name]:.4g}" for name in varied[:4])
        axes.set_title(f"{i + 1}: {stated}", fontsize="small")
    figure.suptitle(title or f"{system.name}: {len(found)} configurations")
    figure.savefig(target, dpi=110)


def draw_path(system: System, found: Sequence[ImagePoint], target: Path, cells: Cells | None = None) -> None:
    """A path in its own space, over the cells if given, and all its images in the other space."""
    figure = Figure(figsize=(13.0, 5.8), layout="constrained")
    left, right = figure.subplots(1, 2)
    names = list(found[0].values)[:2] if cells is None else [axis.name for axis in cells.axes]
    if cells is not None:
        show_cells(left, cells, system)
    xs, ys = ([point.values[name] for point in found] for name in names)
    left.plot(xs, ys, "-", color="black", linewidth=2.0, label="path", zorder=5)
    left.plot(xs[0], ys[0], "o", color="black", zorder=6)
    left.set_xlabel(label_of(system, names[0]))
    left.set_ylabel(label_of(system, names[1]))
    others = system.joints if set(names) <= set(system.pose) else system.pose
    for k, row in enumerate(_branches(system, found, others)):
        colour = BRANCHES[k % len(BRANCHES)]
        right.plot(*np.array(row).T[:2], ".", markersize=4, color=colour, label=f"solution {k + 1}")
    right.set_xlabel(label_of(system, others[0]))
    right.set_ylabel(label_of(system, others[1]))
    right.set_title("images, the nearest ones joined")
    right.legend(fontsize="small")
    figure.savefig(target, dpi=130)


def draw_loop(dets: Sequence[float], poses: Any, names: Sequence[str], target: Path, title: str) -> None:
    """A closed joint path, the pose along it and |det A|."""
    figure = Figure(figsize=(12.0, 4.6), layout="constrained")
    left, right = figure.subplots(1, 2)
    share = np.linspace(0.0, 1.0, len(poses))
    for column, name in zip(np.asarray(poses).T, names, strict=True):
        left.plot(share, column - column[0], label=f"{name} {-column[0]:+.4g}")
    left.set_xlabel("share of the loop [1]")
    left.set_ylabel("pose less its start [length, rad]")
    left.legend(fontsize="small")
    left.grid(alpha=0.3)
    right.plot(share, np.abs(dets), color="#d62728")
    right.set_ylim(bottom=0.0)
    right.set_xlabel("share of the loop [1]")
    right.set_ylabel("|det A| [as the equations are written]")
    right.grid(alpha=0.3)
    figure.suptitle(title)
    figure.savefig(target, dpi=130)


def _branches(system: System, found: Sequence[ImagePoint], names: Sequence[str]) -> list[list[list[float]]]:
    """Images connected from point to point, each to the nearest free end; for display, without a proof."""
    ends: list[list[list[float]]] = []
    done: list[list[list[float]]] = []
    turned = np.array([name in system.angles for name in names])
    for point in found:
        left = [[image.values[name] for name in names] for image in point.images]
        going = []
        for branch in ends:
            if not left:
                done.append(branch)
                continue
            way = np.abs(np.array(left) - branch[-1])
            way = np.where(turned, np.minimum(way, 2.0 * np.pi - way), way)
            branch.append(left.pop(int(way.max(axis=1).argmin())))
            going.append(branch)
        ends = going + [[image] for image in left]
    return done + ends


# --- parts ---------------------------------------------------------------------------------------------------------


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
    from fractions import Fraction

    return f"{float(Fraction(value)):g}"


def places_of(system: System, configuration: Configuration) -> dict[str, list[float]]:
    """Coordinates of the named points of a drawing."""
    values: dict[str, float] = {}
    for name in system.names:
        value: Any = configuration.values.get(name)
        if value is None:
            known = system.values[name]
            if isinstance(known, tuple):
                values[f"cos_{name}"], values[f"sin_{name}"] = float(known[0]), float(known[1])
                continue
            value = float(known)
        if name in system.angles:
            values[f"cos_{name}"], values[f"sin_{name}"] = float(np.cos(value)), float(np.sin(value))
        else:
            values[name] = value
    found = {}
    for point, texts in system.drawing.points.items():
        found[point] = [_number(system, text, values) for text in texts]
    return found


def _number(system: System, text: str, values: Mapping[str, float]) -> float:
    poly = system.reader.polynomial(text, "a point")
    names = poly.context().names()
    total = 0.0
    for powers, coefficient in zip(poly.monoms(), poly.coeffs(), strict=True):
        term = float(int(coefficient.p)) / float(int(coefficient.q))
        for name, power in zip(names, powers, strict=True):
            if power:
                term *= values[name] ** int(power)
        total += term
    return total


def _show_robot(axes: Any, system: System, configuration: Configuration, colour: str) -> None:
    points = places_of(system, configuration)
    actuated = {tuple(pair) for pair in system.drawing.actuators if not isinstance(pair, str)}
    for chain in system.drawing.chains:
        for a, b in itertools.pairwise(chain):
            row = np.array([points[a], points[b]]).T
            driven = (a, b) in actuated
            axes.plot(*row, "-", color="#1f77b4" if driven else "#666666", linewidth=2.6 if driven else 1.6)
    for loop in system.drawing.loops:
        row = np.array([points[name] for name in [*loop, loop[0]]]).T
        if len(row) == 2:
            axes.fill(*row, color=colour, alpha=0.35)
        axes.plot(*row, "-", color=colour, linewidth=2.0)
    for name, place in points.items():
        axes.plot(
            *[[v] for v in place], "s" if name in system.drawing.actuators else "o", color="#333333", markersize=4
        )
        axes.text(*place, f" {name}", fontsize=7)
    if len(next(iter(points.values()))) == 2:
        axes.set_aspect("equal", adjustable="datalim")
    axes.tick_params(labelsize=7)
    axes.set_xlabel("x [length]", fontsize=8)
    axes.set_ylabel("y [length]" if "z" not in system.pose or len(system.pose) == 3 else "z [m]", fontsize=8)
