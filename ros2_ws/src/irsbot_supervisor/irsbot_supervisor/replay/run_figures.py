"""Numbers of a judged run: the head of the page, and part of `replay --json`."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from irsbot_kinematics.mechanism import Mechanism
from irsbot_msgs_py.records import Cause, Level
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.core.margins import MARGIN_CAUSES
from irsbot_supervisor.core.stopping import limits_of
from irsbot_supervisor.replay.expectation import levels_of
from irsbot_supervisor.replay.judged import Judged
from irsbot_supervisor.replay.recording import Recording
from irsbot_supervisor.replay.series import MARGINS, Series, SettingsInForce

SAME_S = 1e-9
"""s: times that differ by less are equal, because seconds are rounded nanoseconds."""


def settings_in_force(recording: Recording, judged: Judged) -> SettingsInForce:
    """Settings with the times from which they are in force, s."""
    return [((since_ns - recording.begin_ns) / NS_PER_S, settings) for since_ns, settings in judged.settings]


def summary(recording: Recording, judged: Judged, series: Series) -> dict[str, Any]:
    """Verdict, smallest margins with time and pose, stops with time and distance, rejected input by reason."""
    mechanism = judged.machine.mechanism if judged.machine and series.count else None
    return {
        "verdict": _verdict(judged),
        "samples": len(recording.samples),
        "judged": series.count,
        "seconds": float(series.times[-1]) if series.count else 0.0,
        "smallest_margins": _smallest(series, mechanism, settings_in_force(recording, judged)) if mechanism else [],
        "stops": _stops(recording, judged, series, mechanism) if mechanism else [],
        "rejected": {Cause(cause).name: count for cause, count in sorted(judged.rejections.items())},
        "unseen": judged.unseen,
        "missing": judged.missing,
        "between": judged.between,
    }


def _verdict(judged: Judged) -> dict[str, Any]:
    """The level at the end, and the worst one since the begin of work."""
    levels = [entry.level for entry in levels_of(judged.intervals)]
    begun = next((place for place, level in enumerate(levels) if level < Level.STOP), None)
    worst = None if begun is None else max(levels[begun:]).name
    return {"last": levels[-1].name if levels else Level.UNKNOWN.name, "worst_at_work": worst}


def _smallest(series: Series, mechanism: Mechanism, settings: SettingsInForce) -> list[dict[str, Any]]:
    """Smallest value of each margin that the robot has, with the limit in force."""
    times, found = series.times, []
    for kind, (cause, name) in enumerate(zip(MARGIN_CAUSES, MARGINS, strict=True)):
        values = series["margin"][:, kind]
        if not np.isfinite(values).any():
            continue
        row = int(np.nanargmin(values))
        now = next((one for since, one in reversed(settings) if since <= times[row]), settings[0][1])
        pose = dict(zip([one.name for one in mechanism.task], series["pose"][row].tolist(), strict=True))
        found.append(
            {
                "margin": name,
                "cause": cause.name,
                "value": float(values[row]),
                "stop_limit": limits_of(now, "stop")[kind],
                "time_s": float(times[row]),
                "pose": pose,
            }
        )
    return found


def _stops(recording: Recording, judged: Judged, series: Series, mechanism: Mechanism) -> list[dict[str, Any]]:
    """Every STOP or UNKNOWN that ended work: its time and cause, the time until the joints stood, and their
    displacement."""
    settings, times, joints = settings_in_force(recording, judged), series.times, series["joint"]
    stands = np.all(np.abs(series["joint rate"]) <= settings[0][1].standstill_speed, axis=1)
    places = series["pose"][:, [place for place, one in enumerate(mechanism.task) if not one.is_angle]]
    ended = [now for before, now in pairwise(levels_of(judged.intervals)) if before.level < Level.STOP <= now.level]
    found = []
    for now, later in zip(ended, [*ended[1:], None], strict=False):
        since_s = (now.since_ns - recording.begin_ns) / NS_PER_S
        first = min(int(np.searchsorted(times, since_s - SAME_S)), len(times) - 1)
        rest = np.flatnonzero(stands[first:])
        end = first + int(rest[0]) if len(rest) else len(times) - 1
        steps = np.linalg.norm(np.diff(places[first : end + 1], axis=0), axis=1)
        ways = np.nan_to_num(np.abs(joints[first : end + 1] - joints[first])).max(axis=0)
        interval = next(one for one in judged.intervals if (one.since_ns, one.level) == (now.since_ns, now.level))
        measured = [
            stop
            for ended_ns, stop in judged.stops
            if ended_ns >= now.since_ns and (later is None or ended_ns < later.since_ns)
        ]
        found.append(
            {
                "time_s": since_s,
                "level": now.level.name,
                "text": interval.text,
                "until_rest_s": max(float(times[end]) - since_s, 0.0) if len(rest) else None,
                "platform_m": float(np.nansum(steps)),
                "joints": dict(zip([one.name for one in mechanism.joints], ways.tolist(), strict=True)),
                "allowed": measured[0]._asdict() if measured else None,
            }
        )
    return found
