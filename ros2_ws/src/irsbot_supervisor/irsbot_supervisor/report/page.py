"""The page: data of a judged run, and the template that shows them, in one self-contained file."""

from __future__ import annotations

import json
from dataclasses import asdict, fields
from importlib import resources
from typing import Any

import jinja2
import numpy as np

from irsbot_supervisor.bag.errors import BagError
from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.replay.expectation import MEASURES
from irsbot_supervisor.replay.judgement import BagJudgement
from irsbot_supervisor.replay.run_figures import settings_in_force
from irsbot_supervisor.replay.series import Series
from irsbot_supervisor.report.drawing import view
from irsbot_supervisor.report.json_values import plain
from irsbot_supervisor.report.series import posture_table, tracks

SCRIPTS = ("plots.js", "mechanism.js", "run.js")
MOST_ROWS = 500
"""Verdicts in the table of the page."""


def page_data(found: BagJudgement) -> dict[str, Any]:
    """All data of the page as JSON values: the argument of `update` in `page/run.js`.

    Raises BagError if no sample was judged.
    """
    recording, judged, series = found.recording, found.judged, found.series
    if judged.machine is None or not series.count:
        stated = f": {judged.errors[0]}" if judged.errors else ""
        raise BagError(f"{recording.path}: not one joint state could be judged{stated}")
    mechanism = judged.machine.mechanism
    settings = settings_in_force(recording, judged)
    rows = [interval.as_json() for interval in found.levels]
    lines = tracks(series, mechanism, settings)
    ends = [*series.times[:1].tolist(), *series.times[-1:].tolist(), *(row["time_s"] for row in rows[-1:])]
    begin = min([0.0, *ends[:1]])
    data = {
        "title": found.bag.resolve().name,
        "robot": f"Robot: {judged.robot}",
        "loss": recording.loss,
        "span": [begin, max([begin + 1e-3, *ends])],
        "chapters": rows,
        "measures": dict(found.measures),
        "checks": [check._asdict() for check in found.checks],
        "summary": found.summary,
        "decimated": any(len(track["t"]) < track["samples"] for track in lines),
        "tracks": lines,
        "posture": posture_table(series, mechanism),
        "view": view(mechanism, settings[-1][1].working_mode, series["pose"], _nearest(series)),
        "settings": asdict(settings[-1][1]),
    }
    return dict(plain(data))


def _nearest(series: Series) -> list[float] | None:
    """The pose with the smallest margin, through which a section is taken; None if no margin is known."""
    poses, least = series["pose"], np.fmin.reduce(series["margin"], axis=1)
    least[~np.isfinite(poses).all(axis=1)] = np.nan
    return list(poses[np.nanargmin(least)].tolist()) if np.isfinite(least).any() else None


def page(data: dict[str, Any]) -> str:
    """The page as HTML text. data: result of `page_data`."""
    environment = jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined)
    units = {known.name: str(known.metadata["unit"]) for known in fields(Settings)}
    return environment.from_string(page_text("page.html.j2")).render(
        data=data,
        style=page_text("page.css"),
        scripts=[page_text(name) for name in SCRIPTS],
        json=json.dumps(data, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c"),
        units={one["name"]: one["unit"] for one in data["view"]["task"]},
        joint_units={one["name"]: one["unit"] for one in data["view"]["joints"]},
        settings=[(name, value, units.get(name, "")) for name, value in data["settings"].items()],
        meanings=MEASURES,
        most_rows=MOST_ROWS,
    )


def page_text(name: str) -> str:
    """A part of a page: style, script or template."""
    return resources.files("irsbot_supervisor").joinpath(f"report/page/{name}").read_text(encoding="utf-8")
