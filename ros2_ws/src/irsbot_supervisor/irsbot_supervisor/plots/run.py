"""A run as a picture: margins against their limits, joint rates, and the level over time."""

from __future__ import annotations

from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from irsbot_kinematics.numerics.arithmetic import Array
from irsbot_msgs_py.records import CONSUMER_TIMEOUT_S, Cause, Level, SingularityState
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.bag.journal import Configuration
from irsbot_supervisor.core.margins import MARGIN_CAUSES, MARGIN_NAMES, MARGIN_TEXTS
from irsbot_supervisor.replay.recording import Recording
from irsbot_supervisor.replay.run_summary import Outcome, margin_of, spans_heard

LEVEL_COLOURS = {Level.OK: "#d9f0d3", Level.WARN: "#fee8a8", Level.STOP: "#f7b2a5", Level.UNKNOWN: "#d8c9e6"}
SILENT = f"no verdict for {CONSUMER_TIMEOUT_S:g} s: stop"
SILENT_STYLE: dict[str, Any] = {"facecolor": "#d8c9e6", "edgecolor": "#8050a0", "hatch": "//", "linewidth": 0.0}
MARGIN_COLOURS = ("#1b6ca8", "#b3372f", "#2d7d46", "#8050a0")
MARKS = (("sample judged STOP", "judged_ns", ":"), ("STOP", "stopped_ns", "--"), ("standstill", "stood_ns", "-."))


def draw_run(recording: Recording, found: Outcome, target: Path) -> None:
    """Write a PNG of a recorded run."""
    states = [state for state in recording.states if isfinite(state.type2_margin)]
    if not states:
        return
    settings = next((entry.values for entry in recording.journal if isinstance(entry, Configuration)), {})
    times = np.array([state.stamp_ns - found.begin_ns for state in states]) / NS_PER_S
    end_ns = max(recording.samples[-1].stamp_ns, states[-1].stamp_ns)
    figure = Figure(figsize=(10.0, 6.0), layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1.3))
    for axes in (upper, lower):
        _shade_levels(axes, recording, end_ns)
    for kind, name, colour in zip(MARGIN_CAUSES, MARGIN_NAMES, MARGIN_COLOURS, strict=True):
        _draw_margin(upper, times, states, kind, settings.get(f"{name}_stop"), colour)
    for text, which, style in MARKS:
        moment_ns = getattr(found, which)
        if moment_ns is not None:
            upper.axvline(
                (moment_ns - found.begin_ns) / NS_PER_S, color="black", linestyle=style, linewidth=1.0, label=text
            )
    for joint, rates in enumerate(np.array([state.joint_velocity for state in states]).T, 1):
        lower.plot(*_with_gaps(times, rates), linewidth=0.9, label=f"joint {joint}")
    upper.set_ylabel("margin [1], dotted: stop limit")
    upper.set_ylim(bottom=0.0)
    lower.set_ylabel("joint rate [rad/s, m/s]")
    lower.set_xlabel("time since the first joint state of the bag [s]")
    upper.set_title(f"{states[0].robot}: margins and verdict (green OK, yellow WARN, red STOP, violet UNKNOWN)")
    for axes in (upper, lower):
        axes.set_xlim(0.0, (end_ns - found.begin_ns) / NS_PER_S)
        axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize="small", frameon=False)
    figure.savefig(target, dpi=110)


def _draw_margin(
    axes: Axes, times: Array, states: list[SingularityState], kind: Cause, stop: float | None, colour: str
) -> None:
    values = np.array([margin_of(state, kind) for state in states])
    if not np.isfinite(values).any():
        return
    axes.plot(*_with_gaps(times, values), color=colour, linewidth=1.3, label=MARGIN_TEXTS[kind])
    if stop is not None:
        axes.axhline(float(stop), color=colour, linestyle=":", linewidth=1.0)


def _shade_levels(axes: Axes, recording: Recording, end_ns: int) -> None:
    """Shade the level in force, as the recorder received it; a silence has no level."""
    spoken = False
    for begin_ns, until_ns, level in spans_heard(recording, end_ns):
        ends = ((begin_ns - recording.begin_ns) / NS_PER_S, (until_ns - recording.begin_ns) / NS_PER_S)
        if level is not None:
            axes.axvspan(*ends, color=LEVEL_COLOURS[level], linewidth=0.0)
        else:
            axes.axvspan(*ends, label=None if spoken else SILENT, **SILENT_STYLE)
            spoken = True


def _with_gaps(times: Array, values: Array) -> tuple[Array, Array]:
    """Break lines at times of which nothing is known."""
    gaps = np.flatnonzero(np.diff(times) > CONSUMER_TIMEOUT_S) + 1
    return np.insert(times, gaps, np.nan), np.insert(values, gaps, np.nan)
