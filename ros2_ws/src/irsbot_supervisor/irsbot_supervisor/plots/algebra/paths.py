"""Paths in joint or pose space: their images in the other space, and loops."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from irsbot_kinematics.algebra.cells import Cells
from irsbot_kinematics.algebra.images import ImagePoint
from irsbot_kinematics.algebra.model.system import System
from irsbot_supervisor.plots.algebra.slices import show_cells
from irsbot_supervisor.plots.algebra.style import BRANCHES, label_of


def draw_path(system: System, found: Sequence[ImagePoint], target: Path, cells: Cells | None = None) -> None:
    """Write a picture of a path in its own space, over the cells if given, and of all its images in the other space.

    found: the points of the path in order, at least one, each with its images.
    """
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
    """Write a picture of a closed joint path: the pose along it, and |det A|.

    dets: (N,) as the equations are written. poses: (N, variables) in the order of names, length or rad.
    """
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
