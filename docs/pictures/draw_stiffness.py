"""Draws docs/pictures/stiffness.png: the elastic IRSBot-2, its deflection over the workspace, and Fig. 14 of [S1].

./irsbot python docs/pictures/draw_stiffness.py
"""

from __future__ import annotations

import sys
from math import cos, radians, sin
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np

mpl.use("Agg")
from matplotlib import pyplot
from matplotlib.patches import Circle
from PIL import Image

from irsbot_kinematics import Robot, stiffness
from irsbot_kinematics.stiffness.comparison import POSES, sideways
from irsbot_supervisor.plots.stiffness import deflection_panel

TARGET = Path(__file__).parent / "stiffness.png"
MOST_BYTES = 60_000
COLOURS = {"proximal": "#1f5fa8", "parallel": "#6baed6", "elbow": "#d95f0e", "distal": "#2a8c4a"}
LETTERS = {"proximal": "1", "parallel": "2", "elbow": "4", "distal": "5"}
PLACES = {"proximal": (0.34, 0.02), "parallel": (0.0, 0.03), "elbow": (0.0, -0.07), "distal": (-0.22, -0.1)}
"""Where a label stands from the middle of its tube, m on the paper."""
AZIMUTH, ELEVATION = np.deg2rad(28.0), np.deg2rad(20.0)
VIEW = np.array(
    [
        [cos(AZIMUTH), -sin(AZIMUTH), 0.0],
        [sin(AZIMUTH) * sin(ELEVATION), cos(AZIMUTH) * sin(ELEVATION), cos(ELEVATION)],
    ]
)


def tubes(design: Any, pose: Any) -> list[tuple[str, Any, Any]]:
    """Kind and ends of every tube of an IRSBot-2 in a pose."""
    g, P = design.geometry, np.array([pose[0], 0.0, pose[1]])
    q = Robot(design.mechanism).inverse(pose, design.working_mode)
    up = design.parallelogram * np.array([design.direction[0], 0.0, design.direction[1]])
    found = []
    for sigma, angle in ((1.0, q[0]), (-1.0, q[1])):
        A = np.array([-sigma * g.b, 0.0, 0.0])
        B = A + g.l1 * np.array([cos(angle), 0.0, -sin(angle)])
        apart = np.array([0.0, 0.5 * design.spacing, 0.0])
        found += [("proximal", A + side * apart, B + side * apart) for side in (-1.0, 1.0)]
        found.append(("parallel", A + up, B + up))
        E = B - [0.0, 0.0, g.e]
        F = P - [sigma * (g.p + g.a2 * sin(g.beta)), 0.0, 0.0]
        for side in (-1.0, 1.0):
            arm = np.array([sigma * sin(g.beta), side * cos(g.beta), 0.0])
            found += [("elbow", E, E + g.a1 * arm), ("distal", E + g.a1 * arm, F + g.a2 * arm)]
            found.append(("platform", F + g.a2 * arm, P))
    return found


def sketch(axes: Any, design: Any, pose: Any) -> None:
    named: set[str] = set()
    for kind, start, end in tubes(design, pose):
        (x1, z1), (x2, z2) = VIEW @ start, VIEW @ end
        colour = COLOURS.get(kind, "#222222")
        axes.plot([x1, x2], [z1, z2], color=colour, linewidth=3.0 if kind in COLOURS else 1.6, solid_capstyle="round")
        axes.plot([x1, x2], [z1, z2], ".", color="#222222", markersize=4)
        if kind in COLOURS and kind not in named:
            named.add(kind)
            x, z = 0.5 * (x1 + x2) + PLACES[kind][0], 0.5 * (z1 + z2) + PLACES[kind][1]
            axes.text(x, z, f"{kind} ({LETTERS[kind]})", color=colour, fontsize=10, ha="center")
    P = VIEW @ np.array([pose[0], 0.0, pose[1]])
    axes.text(P[0] + 0.03, P[1] - 0.06, "P", fontsize=10)
    arrow = VIEW @ np.array([0.0, 0.25, 0.0])
    axes.annotate("", P + arrow, P, arrowprops={"arrowstyle": "->", "color": "#c0392b", "linewidth": 1.6})
    axes.text(*(P + arrow + [-0.02, 0.0]), "100 N", color="#c0392b", fontsize=10, ha="right")
    axes.set_aspect("equal")
    axes.margins(0.05)
    axes.set_axis_off()
    axes.set_title("elastic tubes, numbers of [S1]", fontsize=10)


def circles(axes: Any) -> None:
    """[S1] (23): radii in the same unit as the axes, so that the largest circle has 1/25 m."""
    limit = stiffness.load("irsbot2_table4", spacing=2.0 * 0.42 * cos(radians(45.0)), rigid=("elbow",))
    shown = {
        "five-bar, Table 1": (stiffness.load("five_bar_table1"), "#777777", "--"),
        "IRSBot-2, Table 2": (stiffness.load("irsbot2_table2"), "#1f5fa8", "-"),
        "IRSBot-2, Table 4, rigid elbow": (limit, "#d95f0e", "-"),
    }
    radii = stiffness.index({name: sideways(design, POSES) for name, (design, *_) in shown.items()})
    for name, (_, colour, style) in shown.items():
        for i, ((x, z), r) in enumerate(zip(POSES, radii[name], strict=True)):
            label = name if i == 0 else None
            axes.add_patch(Circle((x, z), r, fill=False, edgecolor=colour, linestyle=style, linewidth=1.2, label=label))
    axes.set_xlim(-0.47, 0.47)
    axes.set_ylim(-0.97, -0.46)
    axes.set_aspect("equal")
    axes.set_xlabel("x [m]")
    axes.set_ylabel("z [m]")
    axes.legend(loc="upper center", fontsize=8)
    axes.set_title("deflection along y0, radii of (23)", fontsize=10)


def main() -> int:
    design = stiffness.load("irsbot2_table2")
    figure = pyplot.figure(figsize=(13.0, 4.4), dpi=80, layout="constrained")
    left, middle, right = figure.subplots(1, 3, width_ratios=(0.9, 1.2, 1.1))
    sketch(left, design, (0.1, -0.8))
    field = stiffness.deflection_map(design, (0.0, 100.0, 0.0, 0.0, 0.0, 0.0), ((-0.6, 0.6), (-1.1, -0.4)), (241, 141))
    deflection_panel(figure, middle, field)
    middle.set_title("IRSBot-2, Table 2, beta 45°: 100 N along y0", fontsize=10)
    circles(right)
    figure.canvas.draw()
    Image.fromarray(np.asarray(figure.canvas.buffer_rgba())[..., :3]).quantize(64).save(TARGET, optimize=True)
    size = TARGET.stat().st_size
    print(f"{TARGET.name}: {size} bytes")
    return int(size > MOST_BYTES)


if __name__ == "__main__":
    sys.exit(main())
