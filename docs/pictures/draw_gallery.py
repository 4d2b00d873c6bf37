"""Draws the gallery, docs/reference/gallery.md: one sheet of pictures for every shipped robot.

    ./irsbot python docs/pictures/draw_gallery.py               # writes docs/pictures/gallery/<robot>.png
    ./irsbot python docs/pictures/draw_gallery.py --nodes 21 --out /tmp/g rrr3    # quick, one robot

Every number comes from the library: maps, loci, postures, limits as shipped. Colours are those of viridis, whose
lightness grows evenly, and zones carry hatches, so that a grey print and a colour-blind reader lose nothing.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np

mpl.use("Agg")
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from PIL import Image

import irsbot_kinematics as irs
from irsbot_kinematics.analysis.force_workspace import Load, force_workspace, reaction_map
from irsbot_kinematics.analysis.workspace_maps import Box, Map, joint_map, reachable_box, workspace_map
from irsbot_kinematics.conformance.samples import Machine
from irsbot_kinematics.mechanism import Mechanism, Posture, Status
from irsbot_kinematics.skeleton import BASE, PLATFORM, Bar, bars
from irsbot_supervisor.configuration.loading import shipped_values
from irsbot_supervisor.core.margins import MARGIN_KINDS, margins_of
from irsbot_supervisor.core.settings import completed
from irsbot_supervisor.core.stopping import limits_of

HERE = Path(__file__).parent
NODES = 91
LOAD = Load(10.0, 0.0, 20.0)
"""N in any direction, and what a leg may carry."""

ZONES = (("OK", "#cfe3f2", ""), ("WARN", "#e6b422", "///"), ("STOP", "#7a1f1f", "xxx"))
TYPE1, TYPE2, POSTURE = "black", "#d62728", "#d55e00"
TURN, TILT = np.deg2rad(35.0), np.deg2rad(25.0)
OBLIQUE = np.array(
    [
        [np.cos(TURN), -np.sin(TURN), 0.0],
        [np.sin(TURN) * np.sin(TILT), np.cos(TURN) * np.sin(TILT), np.cos(TILT)],
    ]
)
"""Parallel projection of robots in space."""

POSTURES = 600
"""Tried at random for the one that is drawn."""

SMALLEST_LIMIT = 0.05
"""In place of a limit of zero, when margins are compared."""


class Sheet:
    """The pictures of one robot: a section of its workspace through a good posture."""

    def __init__(self, name: str, nodes: int) -> None:
        self.robot = irs.make_robot(name)
        self.mechanism: Mechanism = self.robot.mechanism
        self.mode = self.mechanism.usual_working_mode
        self.settings = completed({**shipped_values(self.robot), "robot": name}, self.robot)
        self.at, poses = self._good_posture()
        self.box = self._section(poses)
        self.found = workspace_map(self.mechanism, self.mode, self.box, (nodes, nodes))
        self.nodes = nodes

    def draw(self, target: Path) -> None:
        """Write the sheet."""
        figure = Figure(figsize=(13.5, 9.0), layout="constrained")
        (workspace, margins, zones), (joints, forces, posture) = figure.subplots(2, 3)
        self._workspace(workspace)
        self._margin(figure, margins, self.found, "Smallest margin")
        self._zones(zones)
        self._joints(figure, joints)
        self._forces(figure, forces)
        self._posture(posture)
        fixed = ", ".join(
            f"{one.name} = {value:.3g} {one.unit}"
            for one, value in zip(self.mechanism.task[2:], self.at.pose[2:], strict=True)
        )
        signs = "".join("+" if sign > 0 else "-" for sign in self.mode)
        figure.suptitle(f"{self.robot.name}, working mode {signs}{f', section at {fixed}' if fixed else ''}")
        target.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(target, dpi=80)
        if target.suffix == ".png":
            Image.open(target).convert("RGB").quantize(128).save(target, optimize=True)

    def bars(self) -> list[Bar]:
        """Bars of the links in the posture that is drawn."""
        skeleton, at = self.mechanism.skeleton(), self.at
        if skeleton is None:
            return []
        return bars(
            skeleton, {**dict(zip(skeleton.drives, at.joints, strict=True)), **skeleton.closing(at.joints, at.pose)}
        )

    def _good_posture(self) -> tuple[Posture, Any]:
        """Of many postures the one whose smallest margin, as a share of its limit, is largest; and all their poses."""
        stops = np.maximum(limits_of(self.settings, "stop"), SMALLEST_LIMIT)
        modes = self.mode, self.mechanism.usual_assembly_mode
        found = [at for at in self._postures() if (at.working_mode, at.assembly_mode) == modes]
        assert found, f"{self.robot.name}: no posture in its usual modes"
        shares = [float(np.min(np.array(margins_of(at)) / stops)) for at in found]
        return found[int(np.argmax(shares))], np.array([at.pose for at in found])

    def _postures(self) -> Iterator[Posture]:
        """At random: over the workspace if its extent is known, upright there, else over the joints."""
        rng, extent = np.random.default_rng(1), self.mechanism.workspace_ranges()
        if extent is None:
            yield from (at for at in Machine(self.robot, 4 * POSTURES, 1).postures if at.status == Status.SOLVED)
            return
        for _ in range(POSTURES):
            pose = [0.0 if one.is_angle else rng.uniform(*extent[k]) for k, one in enumerate(self.mechanism.task)]
            with suppress(irs.Unreachable):
                joints = tuple(map(float, self.robot.inverse(pose, self.mode)))
                at = self.mechanism.posture(joints, self.mechanism.usual_assembly_mode)
                if at.status == Status.SOLVED:
                    yield at

    def _section(self, poses: Any) -> Box:
        """What is mapped: all that can be reached, where that is known, else where the postures are."""
        others = tuple(self.at.pose[2:])
        if self.mechanism.workspace_ranges() is not None:
            return reachable_box(self.mechanism, others)
        low, high = poses[:, :2].min(axis=0), poses[:, :2].max(axis=0)
        middle, half = 0.5 * (low + high), 0.7 * float((high - low).max())
        first, second = ((float(at - half), float(at + half)) for at in middle)
        return Box(first, second, others)

    def _frame(self, axes: Axes, title: str) -> None:
        axes.set_title(title, fontsize="medium")
        axes.set_xlabel(f"{self.found.axes[0]} [m]")
        axes.set_ylabel(f"{self.found.axes[1]} [m]")
        axes.set_aspect("equal")
        axes.set_xlim(*self.box.first)
        axes.set_ylim(*self.box.second)

    def _loci(self, axes: Axes) -> None:
        found = self.found
        known = self.mechanism.loci(self.mode)
        if known is not None:
            for kind, colour, style in (("type1", TYPE1, "-"), ("type2", TYPE2, "--")):
                label: str | None = f"Type {kind[-1]} locus"
                for curve in known:
                    if curve.kind == kind and np.isfinite(curve.points).any():
                        axes.plot(*curve.points.T, style, color=colour, linewidth=1.2, label=label)
                        label = None
            return
        for values, colour, style, label in (
            (found.reach, TYPE1, "solid", "Type 1 locus, boundary"),
            (found.type2 * found.assembly, TYPE2, "dashed", "Type 2 locus"),
        ):
            known_values = values[np.isfinite(values)]
            if known_values.size and known_values.min() < 0.0 < known_values.max():
                axes.contour(found.first, found.second, values, [0.0], colors=colour, linestyles=style, linewidths=1.2)
                axes.plot([], [], color=colour, linestyle=style, label=label)

    def _workspace(self, axes: Axes) -> None:
        reached = np.where(np.isfinite(self.found.type1), 1.0, np.nan)
        axes.contourf(self.found.first, self.found.second, reached, levels=[0.5, 1.5], colors=["#dde6ec"])
        self._loci(axes)
        axes.plot(*self.at.pose[:2], "*", color=POSTURE, markersize=11, markeredgecolor="black", label="posture below")
        self._frame(axes, f"Workspace, {self.found.area:.3g} m²")
        axes.legend(fontsize="x-small", loc="upper right")

    def _margin(self, figure: Figure, axes: Axes, found: Map, title: str) -> None:
        values = found.smallest
        top = max(float(np.nanmax(values)) if np.isfinite(values).any() else 0.0, 1e-9)
        shown = axes.contourf(found.first, found.second, values, levels=np.linspace(0.0, top, 15), cmap="viridis")
        figure.colorbar(shown, ax=axes, label="smallest margin [1]", shrink=0.8, format="%.2f")
        if found is self.found:
            self._frame(axes, title)

    def _zones(self, axes: Axes) -> None:
        """By the limits of the settings, for a robot at rest."""
        margins = [getattr(self.found, kind.name) for kind in MARGIN_KINDS]
        level = np.zeros_like(self.found.type1)
        for number, which in ((1, "warn"), (2, "stop")):
            for values, limit in zip(margins, limits_of(self.settings, which), strict=True):
                level[values < limit] = number
        level[~np.isfinite(self.found.type1)] = np.nan
        axes.contourf(
            self.found.first, self.found.second, level, levels=[-0.5, 0.5, 1.5, 2.5],
            colors=[colour for _name, colour, _hatch in ZONES], hatches=[hatch for *_, hatch in ZONES],
        )  # fmt: skip
        keys = [Patch(facecolor=colour, hatch=hatch, edgecolor="black", label=name) for name, colour, hatch in ZONES]
        axes.legend(handles=keys, fontsize="x-small", loc="upper right")
        self._frame(axes, "Zones at rest, limits as shipped")

    def _joints(self, figure: Figure, axes: Axes) -> None:
        first, second = self.mechanism.joints[:2]
        ranges = [
            (-np.pi, np.pi) if one.unit == "rad" else (q - self.mechanism.length_m, q + self.mechanism.length_m)
            for one, q in zip((first, second), self.at.joints, strict=False)
        ]
        box = Box(ranges[0], ranges[1], tuple(self.at.joints[2:]))
        found = joint_map(self.mechanism, self.at.assembly_mode, box, (self.nodes, self.nodes))
        self._margin(figure, axes, found, "")
        further = ", ".join(
            f"{one.name} {q:.3g} {one.unit}"
            for one, q in zip(self.mechanism.joints[2:], self.at.joints[2:], strict=True)
        )
        axes.plot(
            *(q if one.unit == "m" else np.remainder(q + np.pi, 2.0 * np.pi) - np.pi
              for one, q in zip((first, second), self.at.joints, strict=False)),
            "*", color=POSTURE, markersize=11, markeredgecolor="black",
        )  # fmt: skip
        axes.set_title(f"Joint space{f' at {further}' if further else ''}", fontsize="medium")
        axes.set_xlabel(f"{first.name} [{first.unit}]")
        axes.set_ylabel(f"{second.name} [{second.unit}]")
        axes.set_aspect("equal")

    def _forces(self, figure: Figure, axes: Axes) -> None:
        first, second = self.found.first, self.found.second
        forces = reaction_map(self.mechanism, self.at.pose, self.mode, LOAD, first_m=first, second_m=second)
        largest = np.minimum(forces.max(axis=2), 2.0 * LOAD.admissible_n)
        levels = np.linspace(0.0, 2.0 * LOAD.admissible_n, 17)
        shown = axes.contourf(first, second, largest, levels=levels, cmap="viridis_r")
        figure.colorbar(shown, ax=axes, label="largest leg force [N], 40 N and more", shrink=0.8)
        around = force_workspace(self.mechanism, self.at.pose, self.mode, LOAD, rays=90, step_m=8e-3)
        x, y = (
            centre + around.radius_m * turn(around.angle_rad)
            for centre, turn in zip(self.at.pose, (np.cos, np.sin), strict=False)
        )
        axes.plot(x, y, color=TYPE2, linewidth=1.6, label=f"at most {LOAD.admissible_n:g} N on every ray")
        axes.legend(fontsize="x-small", loc="upper right")
        self._frame(axes, f"Force workspace, {LOAD.force_n:g} N in any direction")

    def _posture(self, axes: Axes) -> None:
        """In its plane; robots in space obliquely, from the front and above."""
        names = [one.name for one in self.mechanism.task]
        spatial = {"y", "z"} <= set(names)
        onto = OBLIQUE if spatial else np.eye(3)[[0, 2 if "z" in names else 1]]
        for start, end, link in self.bars():
            look = {BASE: ("#777777", 2.0, "-"), PLATFORM: (POSTURE, 4.0, "-")}.get(link, ("#1f2a33", 2.2, "-"))
            line = onto @ np.column_stack([start, end])
            axes.plot(*line, color=look[0], linewidth=look[1], linestyle=look[2], marker="o", markersize=3)
        axes.set_title(f"Posture with large margins{', seen obliquely' if spatial else ''}", fontsize="medium")
        axes.set_xlabel("to the right [m]" if spatial else "x [m]")
        axes.set_ylabel("upwards on the paper [m]" if spatial else f"{names[1]} [m]")
        axes.set_aspect("equal", adjustable="datalim")


PAGE = """# Gallery

Six pictures of each robot, made by `./irsbot python docs/pictures/draw_gallery.py` from the library
alone; the script adds a sheet here for every robot it draws.
`--suffix .svg` and `.pdf` write vector pictures.

| picture | shows |
| --- | --- |
| workspace | what the working mode reaches, with Type 1 and Type 2 loci; the star is the posture that is drawn |
| smallest margin | the smallest of all margins of the robot, 0 is singular |
| zones at rest | where a standing robot is judged OK, WARN or STOP with its shipped limits |
| joint space | the smallest margin over the first two joints, the others as in the posture |
| force workspace | the largest leg force under 10 N in any direction; inside the line no leg carries more than 20 N |
| posture | the one with the largest margins of 600 random ones |

The lightness of the colours grows evenly and zones are hatched, so a grey print tells as much. How to draw your own:
`./irsbot map --help`; what margins mean: [margins](../explanation/margins.md).
"""


def page(folder: Path) -> str:
    """The page, for the sheets that are there."""
    names = [name for name in irs.robots() if (folder / f"{name}.png").is_file()]
    return PAGE + "".join(f"\n## `{name}`\n\n![{name}](../pictures/gallery/{name}.png)\n" for name in names)


def main() -> None:
    """Draw the sheets, and write the page if they are those of the documentation."""
    given = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    given.add_argument("robots", nargs="*", help="all if left out")
    given.add_argument("--nodes", type=int, default=NODES, help="of a grid along each axis")
    given.add_argument("--out", type=Path, default=HERE / "gallery")
    given.add_argument("--suffix", default=".png", help=".png, .svg or .pdf")
    stated = given.parse_args()
    for name in stated.robots or irs.robots():
        Sheet(name, stated.nodes).draw(stated.out / f"{name}{stated.suffix}")
        print(stated.out / f"{name}{stated.suffix}", flush=True)
    if stated.out == HERE / "gallery":
        (HERE.parent / "reference" / "gallery.md").write_text(page(stated.out), encoding="utf-8")


if __name__ == "__main__":
    main()
