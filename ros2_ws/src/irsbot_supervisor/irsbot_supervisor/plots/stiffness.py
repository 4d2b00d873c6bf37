"""A map of deflections as a picture."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from irsbot_kinematics.stiffness import DeflectionMap

LEVELS = 10
"""Contour levels."""
SOFTEST = 95.0
"""%: share of the poses that the levels span; the few next to a singularity are softer by powers of ten."""


def draw_deflection(found: DeflectionMap, title: str, target: Path) -> None:
    """Write a picture of the displacement of the platform point, mm. Raises ValueError if no pose has a result."""
    wide, tall = np.ptp(found.x), np.ptp(found.z)
    figure = Figure(figsize=(8.0, 1.2 + 7.0 * float(np.clip(tall / wide, 0.4, 1.6))), layout="constrained")
    axes = figure.subplots()
    deflection_panel(figure, axes, found)
    axes.set_title(title)
    figure.savefig(target, dpi=120)


def deflection_panel(figure: Figure, axes: Axes, found: DeflectionMap) -> None:
    """Draw the map into a given panel. Raises ValueError if no pose has a result."""
    moved = 1e3 * found.displacement
    known = moved[np.isfinite(moved)]
    if not known.size or not known.max() > 0.0:
        raise ValueError("no pose has a deflection: there is nothing to draw")
    low, high = float(known.min()), float(np.percentile(known, SOFTEST))
    levels = np.geomspace(low, max(high, 1.02 * low), LEVELS)
    norm = LogNorm(levels[0], levels[-1])
    shown = axes.contourf(found.x, found.z, moved, levels=levels, norm=norm, cmap="viridis_r", extend="max")
    lines = axes.contour(found.x, found.z, moved, levels=levels[1:-1:2], colors="white", linewidths=0.8)
    axes.clabel(lines, fmt=lambda level: f"{level:.3g}", fontsize=7)
    short = FuncFormatter(lambda value, _: f"{value:.3g}")
    figure.colorbar(shown, ax=axes, label="displacement of P [mm]", shrink=0.8, ticks=levels, format=short)
    axes.set_xlabel("x [m]")
    axes.set_ylabel("z [m]")
    axes.set_aspect("equal")
