"""Drawings of the design space of the IRSBot-2: zones of the {l1, b} plane, singular postures, cells."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import ceil, cos, hypot, sin
from pathlib import Path

import numpy as np
from matplotlib import rc_context
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from irsbot_kinematics.design import (
    PARAMETERS,
    Designs,
    Kind,
    SingularPosture,
    counts,
    evaluate_printed_zones,
    evaluate_questions,
    find_seats,
    reachability,
)
from irsbot_kinematics.design.proximal import ZONES, Lengths, slack
from irsbot_kinematics.mechanisms.irsbot2_space.designs import Flags
from irsbot_kinematics.mechanisms.irsbot2_space.distal import bounds
from irsbot_kinematics.mechanisms.irsbot2_space.geometry import Irsbot2Geometry
from irsbot_kinematics.numerics.arithmetic import Array

INK, ZONE, ONLY_PRINTED, ROD, ARM, AXIS = "#222222", "#9ecae1", "#e6550d", "#08519c", "#777777", "#d62728"
_TITLES = {
    "a": "$Z_a$: can be assembled (Figs. 14, 17d)",
    "wac": r"$Z_{wac}$: no $\psi_I = \psi_{II} + \pi$ (Fig. 15)",
    "I1": "$Z_\\mathrm{I1}$: Case I, smaller root (Fig. 17a)",
    "I2": "$Z_\\mathrm{I2}$: Case I, larger root (Fig. 17b)",
    "II": "$Z_\\mathrm{II}$: Case II out of reach",
    "III": "$Z_\\mathrm{III}$: Case III out of reach",
    "C1a": "Condition 1a out of reach (ours)",
    "C1b": "Condition 1b out of reach (ours)",
    "csc": "no Case I, II, III (Fig. 17c)",
    "equal": r"no $\psi_I = \psi_{II}$ (ours)",
    "z": "$Z$: assembled, no Case I, II, III (Fig. 18a)",
    "wps": "$Z_{wps}$: $Z$ and $Z_{wac}$ (Fig. 18b)",
    "strict": "$Z_{wps,strict}$: free in all modes (ours)",
}
_PLATE = {"boxstyle": "round,pad=0.15", "facecolor": "white", "edgecolor": "none", "alpha": 0.85}
_SIDE = 301
"""Nodes of the {l1, b} plane per side."""


def draw_zones(g: Irsbot2Geometry, path: Path) -> None:
    """The zones of the proximal design space for the distal parameters of a design, as Figs. 14, 15, 17, 18 of [S0].

    Filled: exact. Hatched: where [S0] prints that the zone holds and it does not. The dot is the design.
    """
    size = g.l2eq + g.a1 * sin(g.beta) + g.p
    l1 = np.linspace(0.0, max(1.25 * g.l1, size), _SIDE)[1:]
    b = np.linspace(0.0, max(1.25 * g.b, 2.0 * size), _SIDE)[1:]
    plane = Designs.columns(
        {name: {"l1": l1[None, :], "b": b[:, None]}.get(name, getattr(g, name)) for name in PARAMETERS}
    )
    found, stated = evaluate_questions(plane), evaluate_printed_zones(plane)
    seat = find_seats(Designs.of(g))
    kinds = [name for name in seat if np.isfinite(seat[name].centre[0])]
    panels = ["a", "wac", "equal", *kinds, "csc", "z", "wps", "strict"]
    if not any(not name.startswith("C1") for name in kinds):
        panels.remove("csc")
    columns = _columns(len(panels))
    figure = Figure(figsize=(3.4 * columns, 3.5 * ceil(len(panels) / columns) + 0.7))
    axes = figure.subplots(ceil(len(panels) / columns), columns, sharex=True, sharey=True, squeeze=False).ravel()
    for axis, name in zip(axes, panels, strict=False):
        _zone(axis, l1, b, _slack(name, found), stated.get(name))
        axis.plot(g.l1, g.b, "o", color=INK, markersize=5)
        axis.set_title(_TITLES[name], fontsize=9)
    for axis in axes[len(panels) :]:
        axis.set_axis_off()
    for at, axis in enumerate(axes[: len(panels)]):
        axis.tick_params(labelbottom=at + columns >= len(panels), labelsize=8)
        if at + columns >= len(panels):
            axis.set_xlabel("$l_1$ [m]")
        if at % columns == 0:
            axis.set_ylabel("$b$ [m]")
    handles = [
        Patch(facecolor=ZONE, edgecolor=INK, label="zone, exact"),
        Patch(facecolor="white", edgecolor=ONLY_PRINTED, hatch="////", label="printed only: does not hold"),
        Line2D([], [], marker="o", color=INK, linestyle="none", label="this design"),
    ]
    _save(figure, handles, _distal_text(g), path)


def _columns(panels: int) -> int:
    """The arrangement with the fewest empty panels."""
    return min((4, 3, 5, 2), key=lambda number: -panels % number)


def _slack(name: str, found: Mapping[str, Lengths]) -> Array:
    return slack(name, found) if name in ZONES else found[name].slack


def _zone(axis: Axes, l1: Array, b: Array, exact: Array, stated: Flags | None) -> None:
    largest = 2.0 * float(l1[-1] + b[-1])
    finite = np.clip(exact, -largest, largest)  # an infinite slack has no contour
    axis.contourf(l1, b, finite, levels=[0.0, 2.0 * largest], colors=[ZONE])
    if finite.min() < 0.0 < finite.max():
        axis.contour(l1, b, finite, levels=[0.0], colors=INK, linewidths=0.8)
    if stated is not None and (wrong := stated & ~(exact >= 0.0)).any():
        with rc_context({"hatch.color": ONLY_PRINTED}):
            axis.contourf(l1, b, wrong.astype(float), levels=[0.5, 1.5], colors="none", hatches=["////"])
    axis.set_xlim(0.0, l1[-1])
    axis.set_ylim(0.0, b[-1])


def _save(figure: Figure, handles: Sequence[Artist], title: str, path: Path) -> None:
    """Title above, legend below, half an inch left for each."""
    height = figure.get_figheight()
    figure.suptitle(title, fontsize=10)
    figure.legend(handles=handles, loc="lower center", ncol=len(handles), fontsize=9, frameon=False)
    figure.tight_layout(rect=(0.0, 0.35 / height, 1.0, 1.0 - 0.1 / height), h_pad=1.8)
    figure.savefig(path, dpi=110)


def _distal_text(g: Irsbot2Geometry) -> str:
    return (
        f"$a_1$ {g.a1:g}  $a_2$ {g.a2:g}  $\\beta$ {np.degrees(g.beta):.4g}°  $p$ {g.p:g}  $l_{{2eq}}$ {g.l2eq:g}  [m]"
    )


def draw_postures(g: Irsbot2Geometry, postures: tuple[SingularPosture, ...], path: Path) -> None:
    """Front views of singular postures, as Figs. 8 and 10 to 12 of [S0]: rods E_k F_k, platform, gained axis.

    The proximal arms are drawn if the robot can reach the posture. Raises ValueError if there is no posture.
    """
    if not postures:
        raise ValueError("no posture to draw")
    columns = _columns(len(postures))
    rows = ceil(len(postures) / columns)
    figure = Figure(figsize=(3.5 * columns, 4.0 * rows + 0.6))
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for axis, posture in zip(axes, postures, strict=False):
        _posture(axis, g, posture)
    for axis in axes[len(postures) :]:
        axis.set_axis_off()
    handles = [
        Line2D([], [], color=ROD, linewidth=2.5, label="distal rods $E_kF_k$"),
        Line2D([], [], color=INK, linewidth=3.5, label="elbows, platform"),
        Line2D([], [], color=ARM, linewidth=2.5, label="arms $A_kB_k$, where they reach"),
        Line2D([], [], color=AXIS, linestyle="--", label="gained rotation"),
    ]
    _save(figure, handles, _distal_text(g), path)


def _posture(axis: Axes, g: Irsbot2Geometry, posture: SingularPosture) -> None:
    """Draw a posture relative to the platform point."""
    s, where = sin(g.beta), reachability(g, posture)
    place = where.placements[-1] if where.placements else None
    wrists: list[Array] = []
    span: list[Array] = [np.zeros(2)]
    for k, sign in enumerate((1.0, -1.0)):
        F = np.array([-sign * (g.a2 * s + g.p), 0.0])
        E = F - posture.lam[k] * np.array([cos(posture.theta[k]), -sin(posture.theta[k])])
        H = E + np.array([sign * g.a1 * s, 0.0])
        G = np.array([-sign * g.p, 0.0])
        axis.plot(*zip(E, F, strict=True), color=ROD, linewidth=2.5, zorder=2)
        axis.plot(*zip(H, G, strict=True), color=ROD, linewidth=0.8, linestyle=":", zorder=2)
        axis.plot(*zip(E, H, strict=True), color=INK, linewidth=3.5, zorder=1, solid_capstyle="round")
        axis.plot(*E, "o", color=INK, markersize=4, zorder=3)
        axis.annotate(
            f"$E_{{{'I' * (k + 1)}}}$",
            (E[0], E[1]),
            xytext=(4, 4 if E[1] > 0.0 else -12),
            textcoords="offset points",
            fontsize=8,
        )
        wrists.append(F)
        span += [E, H]
        if place:
            B = E + np.array([0.0, g.e])
            A = B - g.l1 * np.array([cos(place.joints[k]), -sin(place.joints[k])])
            axis.plot(*zip(A, B, strict=True), color=ARM, linewidth=2.5, zorder=0)
            axis.plot(*A, "s", color=ARM, markersize=6, zorder=0)
            span.append(A)
    axis.plot(*zip(*wrists, strict=True), color=INK, linewidth=3.5, zorder=1, solid_capstyle="round")
    axis.plot(0.0, 0.0, "o", color="white", markeredgecolor=INK, markersize=5, zorder=4)
    if np.abs(posture.axis_point).max() < np.ptp(span, axis=0).max():
        span.append(np.array(posture.axis_point))
    _frame(axis, np.array(span))
    _gained(axis, posture)
    held = "held" if where.placements or where.anywhere else f"out of reach by {1e3 * where.slack:.0f} mm"
    axis.set_title(
        f"{'' if posture.kind in (Kind.C1A, Kind.C1B) else 'Case '}{posture.kind.value}, {held}\n"
        rf"$\psi$ = ({np.degrees(posture.psi[0]):.1f}°, {np.degrees(posture.psi[1]):.1f}°)",
        fontsize=9,
    )


def _frame(axis: Axes, span: Array) -> None:
    middle = 0.5 * (span.min(axis=0) + span.max(axis=0))
    half = 0.62 * (span.max(axis=0) - span.min(axis=0)).max()
    axis.set_xlim(middle[0] - half, middle[0] + half)
    axis.set_ylim(middle[1] - half, middle[1] + half)
    axis.set_aspect("equal")
    axis.tick_params(labelsize=7)
    axis.grid(alpha=0.25)


def _gained(axis: Axes, posture: SingularPosture) -> None:
    (x, z), (ax, _, az) = posture.axis_point, posture.axis
    if posture.kind is Kind.C1B:
        axis.plot(0.0, 0.0, marker="o", markersize=11, fillstyle="none", color=AXIS, zorder=5)
        return
    if hypot(ax, az) > 0.0:
        axis.axline((x, z), (x + ax, z + az), color=AXIS, linestyle="--", linewidth=1.2, zorder=5)


def draw_cells(g: Irsbot2Geometry, path: Path) -> None:
    """Numbers of singular postures of Cases I to III over p and l2eq, for the a1, a2, beta of a design."""
    a2s = g.a2 * sin(g.beta)
    D = g.D
    p = np.linspace(0.0, max(1.3 * g.p, 4.0 * a2s), _SIDE)[1:]
    l2eq = np.linspace(0.0, max(1.3 * g.l2eq, 2.5 * D), _SIDE)[1:]
    plane = Designs.columns(
        {name: {"p": p[None, :], "l2eq": l2eq[:, None]}.get(name, getattr(g, name)) for name in PARAMETERS}
    )
    number = counts(plane)
    total = number.case_1 + number.case_2 + number.case_3
    figure = Figure(figsize=(7.0, 5.8))
    axis = figure.subplots()
    shades = ["#f7fbff", "#c6dbef", "#9ecae1", "#6baed6", "#3182bd"]
    seen = np.unique(total // 2)
    axis.contourf(p, l2eq, total, levels=[-1, 1, 3, 5, 7, 9], colors=shades)
    line = Designs.columns({name: p if name == "p" else getattr(g, name) for name in PARAMETERS})
    t = bounds(line)
    middle = (p > t.p3) & (p < t.p5)
    for label, edge in (
        ("$l_{2eq1}$", t.l2eq1),
        ("$l_{2eq2} = D$", t.l2eq2),
        ("$l_{2eq3}$", np.where(middle, t.l2eq3, np.nan)),
        ("$l_{2eq4}$", t.l2eq4),
    ):
        axis.plot(p, edge, color=INK, linewidth=0.9)
        _label(axis, p, edge, l2eq[-1], label)
    if t.p8[0] < p[-1]:
        axis.plot([t.p8[0]] * 2, [D, l2eq[-1]], color=INK, linewidth=0.9)
        axis.annotate("$p_8$", (t.p8[0], 0.9 * l2eq[-1]), fontsize=9, ha="center", bbox=_PLATE)
    axis.plot(g.p, g.l2eq, "o", color=AXIS, markersize=6)
    axis.set_xlim(p[0], p[-1])
    axis.set_ylim(l2eq[0], l2eq[-1])
    axis.set_xlabel("$p$ [m]")
    axis.set_ylabel("$l_{2eq}$ [m]")
    handles: list[Artist] = [
        Patch(facecolor=shade, edgecolor=INK, label=f"{2 * i} postures") for i, shade in enumerate(shades) if i in seen
    ]
    handles.append(Line2D([], [], marker="o", color=AXIS, linestyle="none", label="this design"))
    title = f"Cases I to III for $a_1$ {g.a1:g} m, $a_2$ {g.a2:g} m, $\\beta$ {np.degrees(g.beta):.4g}°"
    _save(figure, handles, title, path)


def _label(axis: Axes, x: Array, y: Array, top: float, text: str) -> None:
    """Label on the curve, some way before it leaves the picture or ends."""
    inside = np.flatnonzero(np.isfinite(y) & (y < top))
    if inside.size:
        at = inside[int(0.6 * (inside.size - 1))]
        axis.annotate(text, (x[at], y[at]), fontsize=9, ha="center", va="center", bbox=_PLATE)
