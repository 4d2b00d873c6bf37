"""Earlier benchmarks: a file with one line of JSON each, and a page of the goals over them.

Times differ from machine to machine and from hour to hour; ratios to a goal of the same machine show what a change of
the code did.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from irsbot_kinematics import BadInput
from irsbot_kinematics.description import json_text

Facts = Mapping[str, Any]
"""What `bench --json` prints."""


def append(file: Path, facts: Facts) -> None:
    """Add a benchmark at the end of a file, new or not. Raises OSError."""
    with file.open("a+b") as opened:
        opened.seek(max(opened.seek(0, os.SEEK_END) - 1, 0))
        begin = "" if opened.read(1) in (b"", b"\n") else "\n"  # somebody's editor may have dropped the last one
        opened.write(f"{begin}{json.dumps(facts, allow_nan=False)}\n".encode())


def read(file: Path) -> list[Facts]:
    """All benchmarks of a file, none of one that does not exist. Raises BadInput for a line that is none, OSError."""
    if not file.exists():
        return []
    found = []
    for number, line in enumerate(file.read_bytes().splitlines(), 1):
        try:
            facts = json_text.parsed(line)
            if not _is_benchmark(facts):
                raise ValueError
        except (ValueError, TypeError, KeyError):
            raise BadInput(f"{file}, line {number} is no benchmark: it must be a file of --history") from None
        found.append(facts)
    return found


def ratios(history: Sequence[Facts]) -> dict[str, list[float | None]]:
    """By goal: per benchmark, how many times the measured value is worse than the goal; 1 or less: met. None: not
    measured, or the goal is 0."""
    names = dict.fromkeys(_name(goal, facts) for facts in history for goal in facts["goals"] if goal["limit"])
    rows: dict[str, list[float | None]] = {name: [] for name in names}
    for facts in history:
        stated = {_name(goal, facts): _ratio(goal) for goal in facts["goals"]}
        for name in names:
            rows[name].append(stated.get(name))
    return rows


def write_page(history: Sequence[Facts], target: Path) -> None:
    """A self-contained page with a line per goal over all benchmarks, less the quick ones, which are too short."""
    import plotly.graph_objects as go

    history = [facts for facts in history if not facts.get("quick")]
    places = [f"{number}: {facts['version']}" for number, facts in enumerate(history, 1)]
    figure = go.Figure()
    for name, values in ratios(history).items():
        hover = "%{x}<br>%{y:.2f} of the goal"
        figure.add_trace(go.Scatter(x=places, y=values, name=name, mode="lines+markers", hovertemplate=hover))
    figure.add_hline(y=1.0, line_dash="dash", annotation_text="goal")
    figure.update_layout(
        title="Benchmarks: measured value over goal; below the line the goal is met",
        xaxis_title="benchmark: version of the code",
        yaxis={"title": "measured / goal", "type": "log"},
    )
    figure.write_html(target, include_plotlyjs=True)


def _is_benchmark(facts: Facts) -> bool:
    """True if it has what `ratios` and the page need. Raises KeyError, TypeError if not."""
    return "version" in facts and all(
        isinstance(goal["goal"], str)
        and isinstance(goal["what"], str)
        and isinstance(goal["limit"], int | float)
        and isinstance(goal["measured"], int | float | None)
        and "at_least" in goal
        for goal in facts["goals"]
    )


def _name(goal: Mapping[str, Any], facts: Facts) -> str:
    """The goal, and whether compiled or plain modules were measured: each is compared with its like."""
    name = f"{goal['goal']} {goal['what']}"
    if (compiled := facts.get("compiled")) is None:
        return name  # of an older version
    form = "compiled" if compiled else "plain"
    return name if name.endswith(form) else f"{name}, {form}"


def _ratio(goal: Mapping[str, Any]) -> float | None:
    measured, limit = goal["measured"], goal["limit"]
    if measured is None or not measured > 0.0 or not limit:
        return None
    return float(limit / measured if goal["at_least"] else measured / limit)
