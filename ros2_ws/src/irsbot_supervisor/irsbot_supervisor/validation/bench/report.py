"""Measurements and goals, as rows for people and programs."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import median
from typing import NamedTuple

import numpy as np

from irsbot_supervisor.validation.bench.batch import Batch
from irsbot_supervisor.validation.bench.high_rate import HighRate
from irsbot_supervisor.validation.bench.loop_closure import LoopClosure
from irsbot_supervisor.validation.bench.offline import Offline
from irsbot_supervisor.validation.bench.one_sample import OneSample
from irsbot_supervisor.validation.bench.recorder import Recorder
from irsbot_supervisor.validation.bench.startup import Start
from irsbot_supervisor.validation.bench.transport import RAW, SUPERVISED, TYPED, Run


class Row(NamedTuple):
    """One goal and its measurement."""

    goal: str
    what: str
    limit: float
    at_least: bool
    measured: float
    unit: str

    @property
    def met(self) -> bool:
        """False for a value that could not be measured (NaN)."""
        return self.measured >= self.limit if self.at_least else self.measured <= self.limit


class Measured(NamedTuple):
    """All measurements; empty or None for those left out."""

    one_sample: Sequence[OneSample] = ()
    transport: Sequence[Run] = ()
    high_rate: HighRate | None = None
    batch: Batch | None = None
    startup: Sequence[Start] = ()
    offline: Offline | None = None
    recorder: Recorder | None = None
    loop_closure: LoopClosure | None = None


def rows(measured: Measured) -> list[Row]:
    """One row per goal that was measured."""
    found: list[Row] = []
    if measured.transport:
        found += _transport(measured.transport)
    if measured.high_rate is not None:
        what = f"samples not judged at {measured.high_rate.rate_hz * 1e-3:g} kHz"
        found.append(Row("P3", what, 0.0, False, float(measured.high_rate.lost), ""))
    if measured.one_sample:
        found += _one_sample(measured.one_sample)
    if measured.batch is not None:
        plain, compiled = measured.batch.samples_per_s, measured.batch.compiled_samples_per_s
        anew = measured.batch.anew_samples_per_s
        found.append(Row("P5", "batch: margins with numpy alone", 5.5, True, plain * 1e-6, "Msamples/s"))
        if compiled is not None:
            found.append(Row("P5", "batch: margins as machine code", 40.0, True, compiled * 1e-6, "Msamples/s"))
        if anew is not None:
            what = "batch: the same on all cores, into arrays of an earlier call"
            found.append(Row("P5", what, 40.0, True, anew * 1e-6, "Msamples/s"))
    if measured.recorder is not None:
        found += _recorder(measured.recorder)
    if measured.loop_closure is not None:
        found += _loop_closure(measured.loop_closure)
    if measured.offline is not None:
        offline = measured.offline
        found.append(Row("P6", f"an hour at 1 kHz judged offline, {offline.robot}", 15.0, False, offline.hour_s, "s"))
    if measured.startup:
        first = median(start.first_judged_s for start in measured.startup)
        memory = max(start.resident_mb for start in measured.startup)
        found.append(Row("P8", "process start to the first judged sample", 0.5, False, first, "s"))
        found.append(Row("P8", "resident memory at the first judgement", 60.0, False, memory, "MB"))
    return found


def _transport(runs: Sequence[Run]) -> list[Row]:
    raw, typed, ours = ([run for run in runs if run.subject == name] for name in (RAW, TYPED, SUPERVISED))
    lost = float(sum(run.lost for run in ours))
    return [
        Row("P1", "latency p50 / raw relay", 1.10, False, _ratio(ours, raw, "p50_us"), "x"),
        Row("P1", "latency p99 / raw relay", 1.30, False, lower_quartile(ours) / lower_quartile(raw), "x"),
        Row("P1", "latency p50 / typed relay", 0.75, False, _ratio(ours, typed, "p50_us"), "x"),
        Row("P2", "CPU per message / raw relay", 1.25, False, _ratio(ours, raw, "cpu_us"), "x"),
        Row("P2", "CPU per message / typed relay", 0.35, False, _ratio(ours, typed, "cpu_us"), "x"),
        Row("P3", "samples lost at 1 kHz", 0.0, False, lost, ""),
    ]


def _ratio(ours: Sequence[Run], theirs: Sequence[Run], field: str) -> float:
    """Median over the rounds: both subjects of a round ran on the same machine."""
    return float(median(getattr(a, field) / getattr(b, field) for a, b in zip(ours, theirs, strict=True)))


def lower_quartile(runs: Sequence[Run]) -> float:
    """us, lower quartile of the 99th percentiles: the upper rounds include other work of the machine."""
    return float(np.percentile([run.p99_us for run in runs], 25.0))


def _one_sample(results: Sequence[OneSample]) -> list[Row]:
    first, *others = results
    form, limit = ("compiled", 8.0) if first.compiled else ("plain", 20.0)
    found = [
        Row("P4", f"one step, median, {first.robot}, {form}", limit, False, first.median_us, "us"),
        Row("P4", f"one step, worst, {first.robot}, {form}", 150.0, False, first.worst_us, "us"),
    ]
    if others and first.compiled:
        slowest = max(others, key=lambda result: result.median_us)
        what = f"one step, median, slowest other robot ({slowest.robot}), {form}"
        found.append(Row("P4", what, 20.0, False, slowest.median_us, "us"))
    return found


def _recorder(found: Recorder) -> list[Row]:
    return [
        Row("P7", "recorder, of one core at 3000 messages/s", 3.0, False, 100.0 * found.share, "%"),
        Row("P7", "recorder, lost at SIGKILL", 0.05, False, found.lost_s, "s"),
        Row("P7", "recorder, longest turn", 1.0, False, 1e3 * found.stall_s, "ms"),
        Row("P7", "messages salvaged", 300.0, True, 1e-3 * found.salvaged_per_s, "thousand/s"),
    ]


def _loop_closure(found: LoopClosure) -> list[Row]:
    """Empty where Pinocchio is not installed."""
    if not found.pinocchio_us > 0.0:
        return []
    return [
        Row("P10", "a posture, faster than Pinocchio", 10.0, True, found.pinocchio_us / found.ours_us, "x"),
        Row("P10", "a posture in a batch, likewise", 1000.0, True, found.pinocchio_us / found.batch_us, "x"),
    ]
