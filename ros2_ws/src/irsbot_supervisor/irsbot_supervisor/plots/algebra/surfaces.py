"""Singular surfaces in space: an interactive page, and a picture of contour lines in three directions."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from irsbot_kinematics.algebra.model.polynomial import Polynomial
from irsbot_kinematics.algebra.model.system import System
from irsbot_supervisor.plots.algebra.style import BRANCHES, label_of

GRID = 40
"""1: nodes along each axis of the page."""

LINES = 14
"""1: planes across each axis of the picture."""

Range = tuple[float, float]


def values_on_grid(poly: Polynomial, names: Sequence[str], axes: Sequence[np.ndarray]) -> np.ndarray:  # type: ignore[type-arg]
    """Values relative to the sum of the sizes of the terms, on a grid (n1, n2, n3)."""
    grid = np.meshgrid(*axes, indexing="ij")
    table = np.stack([grid[names.index(name)] for name in poly.names], axis=-1)
    return poly.values(table)


def page_of_surfaces(
    polys: Sequence[Polynomial], names: Sequence[str], box: Sequence[Range], system: System, target: Path, title: str
) -> None:
    """A self-contained page with one surface for each irreducible polynomial; drawn only, on a grid."""
    import plotly.graph_objects as go

    axes = [np.linspace(*pair, GRID) for pair in box]
    grid = np.meshgrid(*axes, indexing="ij")
    figure = go.Figure()
    for i, poly in enumerate(polys):
        values = values_on_grid(poly, names, axes)
        if values.min() < 0.0 < values.max():
            colour = BRANCHES[i % len(BRANCHES)]
            figure.add_trace(
                go.Isosurface(
                    x=grid[0].ravel(), y=grid[1].ravel(), z=grid[2].ravel(), value=values.ravel(), isomin=0.0,
                    isomax=0.0, surface_count=1, opacity=0.6, showscale=False, colorscale=[[0, colour], [1, colour]],
                    caps={"x_show": False, "y_show": False, "z_show": False},
                    name=f"factor {i + 1}, degree {poly.degree}", showlegend=True,
                )
            )  # fmt: skip
    figure.update_layout(
        title=title,
        scene={f"{axis}axis_title": label_of(system, name) for axis, name in zip("xyz", names, strict=True)},
    )
    figure.write_html(target, include_plotlyjs=True)


def draw_surfaces(
    polys: Sequence[Polynomial], names: Sequence[str], box: Sequence[Range], system: System, target: Path, title: str
) -> None:
    """Contour lines of the surfaces in planes across the three axes; drawn only, on a grid."""
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

    figure = Figure(figsize=(8.0, 7.0), layout="constrained")
    axes = figure.add_subplot(projection="3d")
    handles = []
    for i, poly in enumerate(polys):
        colour = BRANCHES[i % len(BRANCHES)]
        handles.append(Line2D([], [], color=colour, label=f"factor {i + 1}: degree {poly.degree}, {poly.terms} terms"))
        for across in range(3):
            inside = [k for k in range(3) if k != across]
            for height in np.linspace(*box[across], LINES + 2)[1:-1]:
                rows = [np.linspace(*pair, 90) for pair in box]
                rows[across] = np.array([height])
                values = values_on_grid(poly, names, rows).squeeze(axis=across)
                if not values.min() < 0.0 < values.max():
                    continue
                for line in _lines(rows[inside[0]], rows[inside[1]], values):
                    place = np.full((len(line), 3), height)
                    place[:, inside] = line
                    axes.plot(*place.T, color=colour, linewidth=0.7, alpha=0.75)
    axes.set(xlim=box[0], ylim=box[1], zlim=box[2])
    axes.set_xlabel(label_of(system, names[0]))
    axes.set_ylabel(label_of(system, names[1]))
    axes.set_zlabel(label_of(system, names[2]))
    axes.legend(handles=handles, loc="upper left", fontsize="small")
    axes.set_title(title)
    figure.savefig(target, dpi=130)


def _lines(first: np.ndarray, second: np.ndarray, values: np.ndarray) -> list[np.ndarray]:  # type: ignore[type-arg]
    from contourpy import contour_generator

    return list(contour_generator(first, second, values.T).lines(0.0))
