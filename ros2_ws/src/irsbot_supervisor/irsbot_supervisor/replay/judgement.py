"""A recorded run judged offline, as one record for `irsbot replay` and `irsbot replay --json`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite, nan
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from irsbot_kinematics import BadInput, Robot
from irsbot_msgs_py.records import Cause, Level, SingularityState, cause_names
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.configuration.loading import read_values, robot_of
from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.core.supervisor import Supervisor
from irsbot_supervisor.replay.comparison import Check, against_expectation, against_recording
from irsbot_supervisor.replay.expectation import Expectation, measures_of, read_expectation
from irsbot_supervisor.replay.judged import Judged
from irsbot_supervisor.replay.quiet.strides import QuietRows
from irsbot_supervisor.replay.recording import Recording, read_recording
from irsbot_supervisor.replay.rejudge import Assumption, judge_again
from irsbot_supervisor.replay.run_figures import summary
from irsbot_supervisor.replay.series import Series
from irsbot_supervisor.replay.stepping import Watch, WatchRows

Progress = Callable[[int, int], None]
"""Called with the number of judged samples, and of all samples."""


class LevelInterval(NamedTuple):
    """Level and causes from one moment until the next interval begins.

    time_s: begin, s since the first joint state of the bag.
    level: `Level`.
    causes: `Cause`, bit mask.
    latched: the stop stays until it is reset.
    event: number of the stop event, 0 before the first.
    text: cause, value, limit and unit.
    """

    time_s: float
    level: Level
    causes: Cause
    latched: bool
    event: int
    text: str

    def as_json(self) -> dict[str, Any]:
        """The same in plain values; causes by name."""
        return {**self._asdict(), "level": self.level.name, "causes": cause_names(self.causes)}


class SmallestMargin(NamedTuple):
    """The smallest value of one margin at the samples of a run.

    margin: 'type1', 'type2', 'constraint' or 'limb'.
    value: at least 0.
    time_s: s since the first joint state of the bag.
    """

    margin: str
    value: float
    time_s: float


@dataclass(frozen=True)
class BagJudgement:
    """A recorded run, judged again from its bag.

    bag: its path.
    robot: the judged robot, and the source of that choice.
    levels: every change of level or causes, in order.
    margins: the smallest margins of the samples as they were judged again; the margins that the robot does not have are
    left out.
    measures: numbers that an expectation file may bound, see bags/README.md; NaN where there is none.
    errors: exceptions inside the supervisor, each judged UNKNOWN.
    checks: comparisons with recorded verdicts, recorded states and expectation, each with its differences.
    recording: content of the bag.
    judged: the complete verdicts, per supervisor.
    series: columns of every sample that was judged again.
    expectation: the expectation file, or None.
    assumption: robot and settings that were given for a bag without them; None if the bag has them.
    """

    bag: Path
    robot: str
    levels: tuple[LevelInterval, ...]
    margins: tuple[SmallestMargin, ...]
    measures: Mapping[str, float]
    errors: tuple[str, ...]
    checks: tuple[Check, ...]
    recording: Recording
    judged: Judged
    series: Series
    expectation: Expectation | None
    assumption: Assumption | None

    @property
    def summary(self) -> dict[str, Any]:
        """Verdict, smallest margins with time and pose, stops with time and distance, rejected input by reason."""
        return summary(self.recording, self.judged, self.series)

    @property
    def events(self) -> tuple[LevelInterval, ...]:
        """The intervals that begin a stop event."""
        before = (0, *(interval.event for interval in self.levels))
        return tuple(now for now, last in zip(self.levels, before, strict=False) if now.event > last)

    @property
    def differences(self) -> tuple[str, ...]:
        """All differences from the recording and the expectation; empty: none."""
        return tuple(f"{check.name}: {fault}" for check in self.checks for fault in check.faults)

    def as_json(self) -> dict[str, Any]:
        """The output of `irsbot replay --json`; there NaN becomes null."""
        return {
            "bag": str(self.bag),
            "robot": self.robot,
            "chapters": [interval.as_json() for interval in self.levels],
            "events": [interval.event for interval in self.events],
            "smallest_margins": [margin._asdict() for margin in self.margins],
            "summary": self.summary,
            "measures": dict(self.measures),
            "errors": list(self.errors),
            "checks": [check._asdict() for check in self.checks],
        }


def judge_bag(
    path: str | Path,
    robot: str | Path | Robot | None = None,
    settings: Mapping[str, Any] | str | Path | Settings | None = None,
    *,
    expect: str | Path | None = None,
    namespace: str | None = None,
    topic: str | None = None,
    mechanisms: Sequence[str | Path] | None = None,
    progress: Progress | None = None,
) -> BagJudgement:
    """Judge a recorded run again from its bag alone: deterministic, in process, without ROS.

    path: MCAP file, or a folder with one.
    robot: preset name, YAML file or Robot, for a bag with joint states alone; other bags contain it.
    settings: for such a bag: names and values or a YAML file in place of shipped settings, or Settings.
    expect: expectation file; left out: `expected.json` in the folder of the bag, of a single file NAME.mcap
    `NAME.expected.json` or `expected.json` beside it, if it exists.
    namespace: selects the robot in a bag of several robots.
    topic: joint states to judge, in a bag with several topics of them.
    mechanisms: files of your own mechanisms; left out: those beside the bag.
    progress: called with the numbers of judged and of all samples.

    Raises BadInput, BagError, InvalidSettings, each with one sentence.
    """
    bag = existing_file(path, "the bag")
    expectation = story_of(bag, None if expect is None else existing_file(expect, "the expectation file"))
    if expectation is not None:
        namespace, topic = namespace or expectation.namespace, topic or expectation.topic
    recording = read_recording(bag, namespace, topic)
    assumption = assumption_from(robot, settings, expectation)
    files = None if mechanisms is None else [existing_file(file, "the mechanism file") for file in mechanisms]
    series = Series()
    watch, watch_rows = _watches(recording, series, progress)
    judged = judge_again(recording, assumption, files, watch, watch_rows)
    checks = against_recording(recording, judged)
    if expectation is not None:
        checks += against_expectation(recording, judged, expectation)
    return BagJudgement(
        bag=bag,
        robot=judged.robot,
        levels=intervals_of(recording, judged),
        margins=_smallest(recording, judged),
        measures=measures_of(recording, judged, expectation),
        errors=tuple(judged.errors),
        checks=tuple(checks),
        recording=recording,
        judged=judged,
        series=series,
        expectation=expectation,
        assumption=assumption,
    )


def _watches(recording: Recording, series: Series, progress: Progress | None) -> tuple[Watch, WatchRows]:
    """Add every judged sample to the series, with the recorded time that judging it took."""
    took_s = {
        (part, state.sequence): state.compute_time
        for part, session in enumerate(recording.sessions)
        for state in session.states
    }
    begin_ns, number = recording.begin_ns, len(recording.samples)

    def watch(part: int, time_ns: int, state: SingularityState) -> None:
        series.add((time_ns - begin_ns) / NS_PER_S, state, took_s.get((part, state.sequence), nan))
        if progress is not None:
            progress(series.count, number)

    def watch_rows(part: int, ahead_ns: int, supervisor: Supervisor, rows: QuietRows) -> None:
        count, times = len(rows.joints), (rows.joints.seen_ns + (ahead_ns - begin_ns)) / NS_PER_S
        took = np.full(count, nan)
        if took_s:
            took[:] = [took_s.get((part, place), nan) for place in range(rows.last - count + 1, rows.last + 1)]
        series.add_rows(times, supervisor, rows, took)
        if progress is not None:
            progress(series.count, number)

    return watch, watch_rows


def intervals_of(recording: Recording, judged: Judged) -> tuple[LevelInterval, ...]:
    """Levels and causes of a run, times from its first joint state."""
    return tuple(
        LevelInterval(
            (one.since_ns - recording.begin_ns) / NS_PER_S,
            one.level,
            Cause(one.causes),
            one.latched,
            one.event,
            one.text,
        )
        for one in judged.intervals
    )


def story_of(bag: Path, expect: Path | None = None) -> Expectation | None:
    """The expectations of a bag: the given one, or the one beside it if it exists. Raises BagError."""
    file = expect or story_file(bag)
    return read_expectation(file) if file is not None else None


def story_file(bag: Path) -> Path | None:
    """The expectation file of a bag: in its folder; of a single file the one with its name, or else the common one,
    beside it."""
    own = f"{Path(bag.name.removesuffix('.zstd')).stem}.expected.json"
    files = [bag / "expected.json"] if bag.is_dir() else [bag.with_name(own), bag.with_name("expected.json")]
    return next((file for file in files if file.is_file()), None)


def assumption_from(
    robot: str | Path | Robot | None,
    settings: Mapping[str, Any] | str | Path | Settings | None,
    expectation: Expectation | None,
) -> Assumption | None:
    """Robot and settings of a bag that does not contain them: from the caller, else from its expectations.

    Raises BadInput, InvalidSettings.
    """
    assumption = expectation.assumption if expectation is not None else None
    if robot is not None:
        assumption = Assumption(robot if isinstance(robot, Robot) else str(robot))
    if settings is None:
        return assumption
    if isinstance(settings, Settings):
        machine = assumption.robot if assumption and assumption.robot is not None else settings.robot
        machine = machine if isinstance(machine, Robot) else robot_of(machine)
        return Assumption(machine, complete=settings)
    if isinstance(settings, (str, Path)):
        settings = read_values(existing_file(settings, "the settings file"))
    elif not isinstance(settings, Mapping):
        raise BadInput(f"settings must be a mapping, a YAML file or Settings, got {type(settings).__name__}")
    return Assumption(assumption.robot if assumption else settings.get("robot"), settings)


def existing_file(path: str | Path, what: str) -> Path:
    """A path that must exist. Raises BadInput."""
    if not isinstance(path, (str, Path)):
        raise BadInput(f"{what} must be a path, got {type(path).__name__}")
    if not Path(path).exists():
        raise BadInput(f"{what} '{path}' does not exist")
    return Path(path)


def _smallest(recording: Recording, judged: Judged) -> tuple[SmallestMargin, ...]:
    return tuple(
        SmallestMargin(name, value, (since_ns - recording.begin_ns) / NS_PER_S)
        for name, (value, since_ns) in judged.margins.items()
        if isfinite(value)
    )
