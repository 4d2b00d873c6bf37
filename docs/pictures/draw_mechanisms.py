"""Draws every mechanism for docs/reference/mechanisms.md.

In a good posture, and in one in which the motors do not hold the platform.

    ./irsbot python docs/pictures/draw_mechanisms.py            # writes docs/pictures/<mechanism>.png

Joints come from the library's inverse kinematics; the singular posture is found by bisection of det A between poses.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib as mpl
import numpy as np

mpl.use("Agg")
from matplotlib import pyplot
from PIL import Image

import irsbot_kinematics as irs
from irsbot_kinematics.numerics.arithmetic import FLOATS

HERE = Path(__file__).parent
BASE, ACTUATED, ROD, PLATFORM, RED = "#444444", "#1f5fa8", "#808080", "#2a8c4a", "#c0392b"
MOST_BYTES = 60_000
AZIMUTH, ELEVATION = np.deg2rad(35.0), np.deg2rad(25.0)
VIEW = np.array(
    [
        [np.cos(AZIMUTH), -np.sin(AZIMUTH), 0.0],
        [np.sin(AZIMUTH) * np.sin(ELEVATION), np.cos(AZIMUTH) * np.sin(ELEVATION), np.cos(ELEVATION)],
    ]
)
"""Parallel projection of robots in space: x to the right, y to the back, z upwards."""


def flat(points: Any) -> Any:
    """(2, N) on the paper of points (N, 2) or (N, 3)."""
    columns = np.array([np.asarray(point, dtype=float) for point in points]).T
    return VIEW @ columns if len(columns) == 3 else columns


class Parts(NamedTuple):
    """Points of one leg from base to platform, and what its first piece is."""

    points: list[Sequence[float]]
    rail: tuple[Sequence[float], Sequence[float]] | None = None
    """Ends of the rail on which the first point slides; None: the first piece is a crank or link."""


def planar_pair(robot: irs.Robot, q: Any, x: Any) -> tuple[list[Parts], list[Any]]:
    """Five-bar; the elbow carriers of the IRSBot-2 shift its rods towards each other."""
    g = robot.mechanism.geometry
    half, carrier, platform = (g.b, g.a1 * np.sin(g.beta), g.p) if hasattr(g, "a1") else (g.b, 0.0, 0.0)
    legs = []
    for side, angle in zip((-1.0, 1.0), q, strict=True):
        foot = np.array([side * half, -getattr(g, "e", 0.0)])
        elbow = foot + g.l1 * np.array([np.cos(angle), -np.sin(angle)])
        points = [foot, elbow]
        if carrier:
            points.append(elbow - np.array([side * carrier, 0.0]))
        legs.append(Parts([*points, np.add(x, [side * platform, 0.0])]))
    return legs, [leg.points[-1] for leg in legs]


def rrr3(robot: irs.Robot, q: Any, x: Any) -> tuple[list[Parts], list[Any]]:
    g, (px, py, phi) = robot.mechanism.geometry, x
    legs = []
    for degrees, elbow in zip((210.0, 330.0, 90.0), q, strict=True):
        t = np.deg2rad(degrees)
        a = g.rb * np.array([np.cos(t), np.sin(t)])
        b = np.array([px, py]) + g.rp * np.array([np.cos(t + phi), np.sin(t + phi)])
        first = np.arctan2(*(b - a)[::-1]) - 0.5 * elbow
        legs.append(Parts([a, a + g.l * np.array([np.cos(first), np.sin(first)]), b]))
    return legs, [leg.points[-1] for leg in legs]


def cranks(robot: irs.Robot, q: Any, x: Any) -> tuple[list[Parts], list[Any]]:
    m = robot.mechanism
    high, legs = list(x[2:-1]), []
    c, s = np.cos(x[-1]), np.sin(x[-1])
    for (fx, fy), (bx, by), angle in zip(m.feet, m.corners, q, strict=True):
        end = [fx + m.crank * np.cos(angle), fy + m.crank * np.sin(angle)]
        corner = [x[0] + c * bx - s * by, x[1] + s * bx + c * by, *high]
        legs.append(Parts([[fx, fy, *[0.0] * len(high)], [*end, *[0.0] * len(high)], corner]))
    return legs, [leg.points[-1] for leg in legs]


def rails(robot: irs.Robot, q: Any, x: Any) -> tuple[list[Parts], list[Any]]:
    legs = []
    for rail, joint, travel in zip(robot.mechanism.rails, robot.mechanism.joints, q, strict=True):
        o, u = np.array(rail.origin), np.array(rail.direction)
        legs.append(Parts([o + travel * u, np.array(x)], (o + joint.lower * u, o + joint.upper * u)))
    return legs, [x]


def slides(robot: irs.Robot, q: Any, x: Any) -> tuple[list[Parts], list[Any]]:
    """Struts of actuated length, and carriages with rods."""
    m, (c, s) = robot.mechanism, (np.cos(x[2]), np.sin(x[2]))
    legs = []
    for foot, (bx, by), rail, joint, at in zip(m.feet, m.corners, m.rails, m.joints, q, strict=True):
        corner = [x[0] + c * bx - s * by, x[1] + s * bx + c * by]
        if rail is None:
            legs.append(Parts([foot, corner]))
        else:
            near, first, last = (np.add(foot, np.multiply(far, rail.way)) for far in (at, joint.lower, joint.upper))
            legs.append(Parts([near, corner], (first, last)))
    return legs, [leg.points[-1] for leg in legs]


def prr3(robot: irs.Robot, q: Any, x: Any) -> tuple[list[Parts], list[Any]]:
    m, g, (px, py, phi) = robot.mechanism, robot.mechanism.geometry, x
    tip = (px + g.b * np.cos(phi), py + g.b * np.sin(phi))
    legs = []
    for end, o, u, travel in zip(((px, py), (px, py), tip), m.origins, m.ways, q, strict=True):
        lower, upper = (np.add(o, np.multiply(far, u)) for far in g.travel)
        legs.append(Parts([np.add(o, np.multiply(travel, u)), end], (lower, upper)))
    return legs, [(px, py), tip]


SHOWN: dict[str, tuple[str, Any, tuple[float, ...]]] = {
    "irsbot2": ("irsbot2", planar_pair, (0.1, -0.85)),
    "five_bar": ("five_bar", planar_pair, (0.1, -0.85)),
    "rrr3": ("rrr3", rrr3, (-0.03, 0.02, 0.8)),
    "rrr3_base": ("rrr3_base", cranks, (-0.03, 0.02, 0.3)),
    "ruu4": ("ruu4", cranks, (0.03, 0.02, -0.42, 0.15)),
    "orthoglide": ("orthoglide", rails, (-0.2, 0.1, 0.0)),
    "hybridglide": ("hybridglide", rails, (-0.1, 0.4, 0.1)),
    "triaglide": ("triaglide", rails, (-0.1, 2.2, 0.8)),
    "uranesx": ("uranesx", rails, (-0.1, 0.05, -1.2)),
    "linear_delta": ("linear_delta", rails, (0.05, 0.0, 0.1)),
    "rpr3": ("rpr3", slides, (-0.09, 0.28, -0.28)),
    "rails3": ("rails3", slides, (0.23, 0.1, 0.9)),
    "rails2": ("rails2", slides, (0.24, 0.47, -1.05)),
    "prr3": (str(HERE.parent / "examples" / "prr3" / "prr3.yaml"), prr3, (0.0, 0.28, 2.0)),
}
"""Per picture the robot, how its parts lie, and a good pose in its usual working mode."""


def singular(robot: irs.Robot, good: tuple[float, ...]) -> tuple[Any, Any] | None:
    """Joints and pose with det A = 0, on a straight way from the good pose in a working mode, far from Type 1."""
    m, rng, best = robot.mechanism, np.random.default_rng(5), (0.05, None)
    scale = np.array([1.0 if axis.is_angle else np.abs(good[:2]).sum() + m.length_m for axis in m.task])

    def at(x: Any, mode: Any) -> Any:
        q, reach = m.inverse(FLOATS, tuple(x), mode)
        inside = all(j.lower < value < j.upper for j, value in zip(m.joints, q, strict=True))
        return m.at(q, tuple(x), 1, (1.0, 1.0)) if min(reach) > 0.0 and inside else None

    modes = [m.usual_working_mode, *m.working_modes]
    for trial in range(3000):
        mode = modes[0 if trial < 1500 else trial % len(modes)]
        far = np.array(good) + rng.normal(size=len(good)) * scale
        first, last = at(good, mode), at(far, mode)
        if first is None or last is None or first.det * last.det > 0.0:
            continue
        low, high = np.array(good), far
        for _ in range(60):
            middle = 0.5 * (low + high)
            one = at(middle, mode)
            if one is None:
                break
            low, high = (middle, high) if one.det * first.det > 0.0 else (low, middle)
        if one is not None and min(one.type1) > best[0]:
            best = min(one.type1), one
    return None if best[1] is None else (best[1].joints, best[1].pose)


def draw(axes: Any, robot: irs.Robot, parts: Any, q: Any, x: Any, colour: str) -> None:
    legs, corners = parts(robot, q, x)
    for i, leg in enumerate(legs, 1):
        points = flat(leg.points)
        if leg.rail is not None:
            axes.plot(*flat(leg.rail), color=BASE, linewidth=1.0)
            axes.plot(*points[:, :1], "s", color=ACTUATED, markersize=6)
            axes.plot(*points, color=ROD, linewidth=1.6)
        else:
            axes.plot(*points[:, :2], color=ACTUATED, linewidth=2.6)
            axes.plot(*points[:, 1:], color=ROD, linewidth=1.6)
            axes.plot(*points[:, :1], "^", color=BASE, markersize=7)
        axes.plot(*points[:, 1:], ".", color=BASE, markersize=6)
        axes.text(*points[:, 0], f"  {i}", color=BASE, fontsize=9)
    axes.plot(*flat([*corners, corners[0]]), color=colour, linewidth=2.2)
    (px,), (py,) = flat([x[: len(corners[0])]])
    axes.plot(px, py, "o", color=colour, markersize=5)
    axes.text(px, py, "  P", color=colour, fontsize=10)
    if len(corners[0]) == 3:
        origin = flat([[0.0, 0.0, 0.0]])
        length = 0.5 * robot.mechanism.length_m if robot.mechanism.length_m > 0.2 else 0.2
        for name, end in zip("xyz", np.eye(3) * length, strict=True):
            arrow = np.concatenate([origin, flat([end])], axis=1)
            axes.plot(*arrow, color="#b8860b", linewidth=1.0)
            axes.text(*arrow[:, 1], name, color="#b8860b", fontsize=9)


def picture(name: str) -> Path:
    preset, parts, good = SHOWN[name]
    robot = irs.load_robot(preset) if preset.endswith(".yaml") else irs.make_robot(preset)
    panels = [("good", tuple(robot.inverse(good)), good, PLATFORM)]
    bad = singular(robot, good)
    if bad is not None:
        panels.append(("singular, Type 2", *bad, RED))
    names = [axis.name for axis in robot.mechanism.task if not axis.is_angle]
    figure = pyplot.figure(figsize=(3.6 * len(panels), 3.4), dpi=80)
    for k, (title, q, x, colour) in enumerate(panels, 1):
        axes = figure.add_subplot(1, len(panels), k)
        draw(axes, robot, parts, q, x, colour)
        axes.set_title(title, fontsize=10, color=colour)
        axes.set_aspect("equal")
        axes.margins(0.12)
        if len(names) == 3:
            axes.set_axis_off()
        else:
            axes.set_xlabel(f"{names[0]} [m]", fontsize=8)
            axes.set_ylabel(f"{names[1]} [m]", fontsize=8)
            axes.tick_params(labelsize=7)
    figure.tight_layout()
    path = HERE / f"{name}.png"
    figure.canvas.draw()
    Image.fromarray(np.asarray(figure.canvas.buffer_rgba())[..., :3]).quantize(64).save(path, optimize=True)
    pyplot.close(figure)
    return path


def main() -> int:
    for name in sys.argv[1:] or SHOWN:
        path = picture(name)
        size = path.stat().st_size
        print(f"{path.name}: {size} bytes")
        if size > MOST_BYTES:
            print(f"{path.name} is larger than {MOST_BYTES} bytes", file=sys.stderr)
            return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
