"""Recordings that are judged in both ways: by the supervisor alone, and as columns."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from irsbot_msgs_py.records import JointSample
from irsbot_supervisor.bag.joint_columns import JointSamples
from irsbot_supervisor.core.supervisor import Supervisor
from irsbot_supervisor.replay import judgement
from irsbot_supervisor.replay.judged import Judged
from irsbot_supervisor.replay.quiet.strides import QuietRows
from irsbot_supervisor.replay.recording import Recording
from irsbot_supervisor.replay.rejudge import Assumption, judge_again
from irsbot_supervisor.replay.run_figures import summary
from irsbot_supervisor.replay.series import Series

ROUNDING = 1e-10
"""1, rad, m, N: numbers of columns differ by less."""


def judged(recording: Recording, assumption: Assumption | None, columns: bool) -> tuple[Judged, Series, int]:
    """The result, the series, and the number of samples that were judged as columns."""
    series, quiet = Series(), 0
    watch, watch_rows = judgement._watches(recording, series, None)

    def counted(part: int, ahead_ns: int, supervisor: Supervisor, rows: QuietRows) -> None:
        nonlocal quiet
        quiet += len(rows.joints)
        watch_rows(part, ahead_ns, supervisor, rows)

    found = judge_again(recording, assumption, None, watch, counted if columns else None)
    return found, series, quiet


def quiet_and_same(recording: Recording, assumption: Assumption | None = None) -> int:
    """Judge in both ways and compare all that is recorded; returns how many samples were judged as columns."""
    one_by_one, expected, none = judged(recording, assumption, columns=False)
    found, series, quiet = judged(recording, assumption, columns=True)
    assert none == 0
    assert found == one_by_one
    assert summary(recording, found, series) == summary(recording, one_by_one, expected)
    for kind in expected._rows:
        np.testing.assert_allclose(series[kind], expected[kind], rtol=ROUNDING, atol=ROUNDING, equal_nan=True)
    for kind in ("time", "level", "causes", "joint", "joint rate", "age", "computing"):
        np.testing.assert_array_equal(series[kind], expected[kind])
    return quiet


def recording_of(samples: list[JointSample]) -> Recording:
    return Recording(Path("run"), JointSamples(samples))


def disturbed(samples: list[JointSample], seed: int) -> Iterator[JointSample]:
    """A recording with disturbances of every kind at random places, most of them a few samples long."""
    random = np.random.default_rng(seed)
    kinds = ("none", "jitter", "gap", "nan", "jump", "noise", "old", "ahead", "still", "velocity", "repeat", "clock")
    kind, left, shift, scale = "none", 200, 0, 1.0
    for sample in samples:
        stamp, received, seen, names, position, velocity, effort = sample
        if left == 0:
            quiet = random.random() < 0.5
            kind = "none" if quiet else str(random.choice(kinds))
            left = int(random.integers(100, 400)) if quiet else int(random.choice([1, 2, 5, 30, 120]))
            scale = float(10.0 ** random.uniform(-5.0, -1.0))
            shift += int(random.integers(-2, 30)) * 1_000_000 if kind == "clock" else 0
        left -= 1
        if kind == "gap" and random.random() < 0.9:
            continue
        if kind == "jitter":
            stamp += int(random.normal() * 1e4)
            received, seen = received + int(random.random() * 2e6), seen + int(random.random() * 2e6)
        if kind == "nan":
            position = (float("nan"), *position[1:])
        if kind in ("jump", "noise"):
            size = 0.3 if kind == "jump" else scale
            position = tuple(q + size * float(random.normal()) for q in position)
        if kind == "old":
            stamp -= 40_000_000
        if kind == "ahead":
            stamp += 3_000_000
        if kind == "still":
            position = samples[0].position
        if kind == "velocity":
            velocity = tuple(rate + scale * 100.0 * float(random.normal()) for rate in velocity)
        if kind == "repeat" and random.random() < 0.5:
            stamp -= 1_000_000
        yield JointSample(stamp + shift, received + shift, seen, names, position, velocity, effort)
