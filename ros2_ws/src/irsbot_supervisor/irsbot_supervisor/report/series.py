"""Series over time of a judged run: collected sample by sample, thinned out at the end."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from math import acos, degrees, isfinite, nan
from typing import Any

import numpy as np

from irsbot_kinematics.mechanism import Mechanism
from irsbot_kinematics.numerics.arithmetic import Array
from irsbot_msgs_py.records import CONSUMER_TIMEOUT_S
from irsbot_supervisor.core.stopping import limits_of
from irsbot_supervisor.replay.series import MARGINS, Series, SettingsInForce
from irsbot_supervisor.report.decimation import breaks_in, kept_rows, rows_of_places

UNTIL_REST = "smallest until standstill"
FORCES = (("measured", "force"), ("worst direction", "largest force"))
"""Names of leg forces on the page and in the series."""

DIGITS = 9
"""Digits of a number on the page: more than any measurement has."""


def tracks(series: Series, mechanism: Mechanism, settings: SettingsInForce) -> list[dict[str, Any]]:
    """Quantities over time, one entry per plot: title, unit, decimated columns, limits as steps over time."""
    times, legs = series.times, [f"leg {number}" for number in range(1, len(mechanism.joints) + 1)]
    margins = dict(zip(MARGINS, series["margin"].T, strict=True))
    found = [track("Margins", "1", times, {**margins, UNTIL_REST: series["until rest"][:, 0]})]
    shown = [column["name"] for column in found[0]["columns"]]
    for kind in ("stop", "warn"):
        limits = [(since_s, dict(zip(MARGINS, limits_of(now, kind), strict=True))) for since_s, now in settings]
        found[0]["limits"] += [limit for limit in _steps(kind, limits) if limit["of"] in shown]
    found.append(
        track("Pressure angles", "deg", times, dict(zip(legs, np.degrees(series["pressure angle"]).T, strict=True)))
    )
    found[-1]["limits"] = _steps("stop", [(since_s, {"": degrees(acos(now.type2_stop))}) for since_s, now in settings])
    forces = {f"{leg}, {how}": column for how, kind in FORCES for leg, column in zip(legs, series[kind].T, strict=True)}
    found.append(
        track(
            "Leg forces",
            "N",
            times,
            {name: one for name, one in forces.items() if np.nanmax(np.abs(one), initial=0.0) > 0.0},
        )
    )
    checked = [(since_s, {"": now.reaction_limit_n}) for since_s, now in settings if now.reaction_check != "none"]
    found[-1]["limits"] = _steps("stop", checked)
    for title, kind, coordinates in (
        ("Joint positions", "joint", mechanism.joints),
        ("Joint rates", "joint rate", mechanism.joints),
        ("Platform pose", "pose", mechanism.task),
        ("Platform rates", "pose rate", mechanism.task),
    ):
        for unit in dict.fromkeys(one.unit for one in coordinates):
            places = [place for place, one in enumerate(coordinates) if one.unit == unit]
            columns = {coordinates[place].name: series[kind][:, place] for place in places}
            found.append(track(title, f"{unit}/s" if kind.endswith("rate") else unit, times, columns))
            if kind == "joint rate":
                for sign in (1.0, -1.0):
                    most = [
                        (since_s, {"": sign * max(now.velocity_limit[p] for p in places)}) for since_s, now in settings
                    ]
                    found[-1]["limits"] += _steps("warn", most)
    age = {
        "age of the sample": series["age"][:, 0] * 1e3,
        "computing": series["computing"][:, 0] * 1e3,
        "since the sample before": np.diff(times, prepend=np.nan) * 1e3,
    }
    found.append(track("Latency", "ms", times, age))
    return [one for one in found if one["columns"]]


def track(title: str, unit: str, times: Array, columns: Mapping[str, Array]) -> dict[str, Any]:
    """One plot, decimated. columns: (N,) each; columns without any known value are left out."""
    known = {name: column for name, column in columns.items() if np.isfinite(column).any()}
    breaks = breaks_in(times, CONSUMER_TIMEOUT_S)
    rows = kept_rows(list(known.values()), breaks) if known else np.arange(0)
    return {
        "title": title,
        "unit": unit,
        "t": rounded(times[rows]),
        "breaks": np.flatnonzero(np.isin(rows, breaks)).tolist(),
        "columns": [{"name": name, "values": rounded(column[rows])} for name, column in known.items()],
        "limits": [],
        "samples": len(times),
    }


def _steps(kind: str, limits: Iterable[tuple[float, Mapping[str, float]]]) -> list[dict[str, Any]]:
    """Limits over time, each from the time when it came into force, s: by the name of its column, empty for all
    columns."""
    steps: dict[str, list[tuple[float, float]]] = {}
    for since_s, values in limits:
        for name, value in values.items():
            if isfinite(value):
                steps.setdefault(name, []).append((since_s, value))
    return [{"of": name, "kind": kind, "steps": found} for name, found in steps.items()]


def posture_table(series: Series, mechanism: Mechanism) -> dict[str, Any]:
    """Poses, joints and passive joints over time, and the least margin: the data for the drawing of the mechanism."""
    pose, joints = series["pose"], series["joint"]
    least: Array = np.fmin.reduce(series["margin"], axis=1)
    breaks = breaks_in(series.times, CONSUMER_TIMEOUT_S)
    rows = np.union1d(kept_rows([*pose.T, *joints.T, least], breaks), rows_of_places(pose, least))
    positions = {one.name: rounded(column) for one, column in zip(mechanism.joints, joints[rows].T, strict=True)}
    return {
        "t": rounded(series.times[rows]),
        "thinned": len(rows) < series.count,
        "breaks": np.flatnonzero(np.isin(rows, breaks)).tolist(),
        "pose": [rounded(column) for column in pose[rows].T],
        "joints": positions | _passive(mechanism, joints[rows], pose[rows]),
        "margin": rounded(least[rows]),
    }


def _passive(mechanism: Mechanism, joints: Array, poses: Array) -> dict[str, list[float | None]]:
    """Positions of the passive joints, for the rows with a known pose."""
    skeleton = mechanism.skeleton()
    found: dict[str, list[float | None]] = {name: [] for name in skeleton.passive} if skeleton else {}
    for q, pose in zip(joints.tolist(), poses.tolist(), strict=True):
        known = skeleton is not None and all(map(isfinite, (*q, *pose)))
        angles = skeleton.closing(tuple(q), tuple(pose)) if skeleton and known else {}
        for name, values in found.items():
            values += rounded([angles.get(name, nan)])
    return found


def rounded(values: Iterable[float]) -> list[float | None]:
    """Rounded numbers for the page; None for values that are not finite, which JSON does not have."""
    return [float(f"{value:.{DIGITS}g}") if isfinite(value) else None for value in values]
