"""Configurations of a manipulator, drawn as a mechanism."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from irsbot_kinematics.algebra.model.system import System
from irsbot_kinematics.algebra.solving import Configuration
from irsbot_supervisor.plots.algebra.style import BRANCHES


def draw_configurations(system: System, found: Sequence[Configuration], target: Path, title: str | None = None) -> None:
    """Write a picture with a panel for every configuration: actuators blue, platform filled, named points."""
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


def places_of(system: System, configuration: Configuration) -> dict[str, list[float]]:
    """Coordinates of the named points of the drawing of a manipulator, 2 or 3 each, in the unit of its lengths."""
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
        axes.margins(0.12)  # room for the names of the outermost points
        axes.set_aspect("equal", adjustable="datalim")
    axes.tick_params(labelsize=7)
    axes.set_xlabel("x [length]", fontsize=8)
    axes.set_ylabel("y [length]" if "z" not in system.pose or len(system.pose) == 3 else "z [m]", fontsize=8)
