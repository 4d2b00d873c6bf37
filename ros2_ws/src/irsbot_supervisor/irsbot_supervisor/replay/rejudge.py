"""Judges a recorded run again, from the bag alone: in process, event by event, as fast as possible.

The bag contains the supervisor's inputs: the joint states, and the journal with its settings and resets. The published
states tell when each sample was received: `received.py`. A bag without a journal (joint states only) is judged for a
given robot, in the order and at the times of its recording.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import count
from pathlib import Path
from typing import Any, NamedTuple

from irsbot_kinematics import KinematicsError, Robot
from irsbot_msgs_py.records import JointSample, LateBrakes, Level, Tick
from irsbot_supervisor.bag.errors import BagError
from irsbot_supervisor.bag.joint_columns import JointColumns, JointSamples
from irsbot_supervisor.bag.journal import Configuration, Entry, configured
from irsbot_supervisor.configuration.loading import read_settings, robot_of
from irsbot_supervisor.core.settings import InvalidSettings, Settings
from irsbot_supervisor.replay.judged import SILENCE_NS, Interval, Judged
from irsbot_supervisor.replay.levels import Levels
from irsbot_supervisor.replay.received import Received
from irsbot_supervisor.replay.recording import Recording, SupervisorSession
from irsbot_supervisor.replay.stepping import Input, Stepper, Watch, WatchRows, in_order


class Assumption(NamedTuple):
    """Robot and settings for a bag without a journal, which does not contain them.

    robot: name of a preset, YAML file or Robot; None: not given. settings: by name, in place of the shipped ones.
    complete: all settings, in place of the shipped and the named ones.
    """

    robot: str | Path | Robot | None
    settings: Mapping[str, Any] = {}
    complete: Settings | None = None


def judge_again(
    recording: Recording,
    assumption: Assumption | None = None,
    mechanisms: Sequence[Path] | None = None,
    watch: Watch | None = None,
    watch_rows: WatchRows | None = None,
) -> Judged:
    """Judge the recorded inputs again; returns the levels, causes and smallest margins that this version finds.

    assumption: robot and settings, required for a bag without a journal and refused for a bag with one. mechanisms:
    Python files that may contain the recorded mechanism; left out: those beside the bag. Only a file with the recorded
    hash is loaded. watch: called for every judged sample. watch_rows: the same for samples that are judged as columns;
    with `watch` alone none are. Raises BagError for settings that this version cannot use, if the robot is missing or
    given twice, and if the bag has runs of several robots, one after another.
    """
    judged, watches = Judged([], Levels(), 0, 0), (watch, watch_rows)
    files = beside(recording.path) if mechanisms is None else mechanisms
    first = next((entry for entry in recording.journal if isinstance(entry, Configuration)), None)
    try:
        if first is None:
            first = _assumed(recording, assumption)
            other = assumption is not None and (assumption.settings or assumption.complete is not None)
            settings = "other settings than the shipped ones" if other else "its shipped settings"
            judged.robot = f"{first.values['robot']} with {settings}, as given: the bag does not contain it"
        elif assumption is not None:
            fault = "the bag contains its robot and settings; a given robot and settings"
            raise BagError(f"{recording.path}: {fault} are for bags of joint states alone")
        else:
            judged.robot = f"{first.machine.get('name')}, as recorded"
        _need_one_robot(recording)
        if not recording.states:
            others = [_as_recorded(entry) for entry in recording.journal if entry is not first]
            events = _with_ticks(recording.samples, others, recording.samples[-1].seen_ns)
            begin = first._replace(seen_ns=first.received_ns)
            _step_through(judged, begin, events, count(1), files, watches)
            return judged
        received = Received(recording.samples)
        for session in recording.sessions:
            first = next((entry for entry in session.journal if isinstance(entry, Configuration)), first)
            seen = received.of(session)
            last = session.states[-1].sequence - session.states[0].sequence + 1 if session.states else 0
            judged.missing += last - len(seen)
            events = _events(session, first, list(seen.values()))
            _step_through(judged, first, events, seen, files, watches, session.ahead_ns)
        for session, part, later in zip(recording.sessions, judged.parts, judged.parts[1:], strict=False):
            part += _silence(session.end_ns, later[0].since_ns)
        judged.unseen, judged.between = received.left, received.between
    except (InvalidSettings, KinematicsError) as error:
        raise BagError(f"{recording.path}: {error}") from None
    return judged


def _as_recorded(entry: Entry) -> Entry:
    """An entry with the ROS clock in place of the steady one: the clock of samples that no state tells the time of."""
    later_ns = entry.received_ns - entry.seen_ns
    if isinstance(entry, LateBrakes):
        entry = entry._replace(brakes_ns=entry.brakes_ns + later_ns)
    return entry._replace(seen_ns=entry.received_ns)


def _need_one_robot(recording: Recording) -> None:
    """Raises BagError if the settings of the sessions are of different robots."""
    machines = [entry.machine for entry in recording.journal if isinstance(entry, Configuration)]
    for machine in machines:
        if machine != machines[0]:
            names = f"{machines[0].get('name')} and {machine.get('name')}, with different records"
            raise BagError(
                f"{recording.path}: it holds runs of two robots under one name, {names}; split it in two bags"
            )


def beside(bag: Path) -> list[Path]:
    """Python files in the folder of a bag and beside it."""
    return [
        file
        for folder in ((bag, bag.parent) if bag.is_dir() else (bag.parent,))
        for file in sorted(folder.glob("*.py"))
    ]


def _silence(end_ns: int, again_ns: int) -> list[Interval]:
    """The intervals between two supervisors, as a consumer sees them."""
    text = f"no verdict for more than {SILENCE_NS / 1e6:.0f} ms: there was no supervisor"
    since_ns = end_ns + SILENCE_NS
    return [Interval(since_ns, Level.UNKNOWN, 0, False, 0, text)] if since_ns < again_ns else []


def _assumed(recording: Recording, assumption: Assumption | None) -> Configuration:
    if assumption is None or assumption.robot is None:
        how = "say it with --robot NAME, and settings other than the shipped ones with --params FILE"
        raise BagError(f"{recording.path}: the bag does not say which robot it is of; {how}")
    start, machine = recording.samples[0], assumption.robot
    if assumption.complete is None:
        found, machine = read_settings(machine, assumption.settings)
    else:
        found, machine = assumption.complete, machine if isinstance(machine, Robot) else robot_of(machine)
    _need_joints(recording, found.joint_names)
    return configured(found, machine, start.received_ns, start.seen_ns)


def _need_joints(recording: Recording, joints: Sequence[str]) -> None:
    """Raises BagError if no message names all joints: then no sample could be judged."""
    samples = recording.samples
    sets = samples.names if isinstance(samples, JointSamples) else {sample.names for sample in samples}
    if not any(set(joints) <= set(names) for names in sets):
        known = "; ".join(sorted(", ".join(names) or "no names" for names in sets))
        fault = f"no message names all joints of the robot, {', '.join(joints)}; there are {known}"
        raise BagError(f"{recording.path}: {fault}. Other names are said by joint_names in --params FILE")


def _events(
    session: SupervisorSession, first: Configuration, samples: list[JointSample]
) -> Iterator[Input | JointColumns]:
    """The inputs of a supervisor in the order of their reception."""
    others: list[Input] = [entry for entry in session.journal if entry is not first]
    end_ns = max([verdict.since_ns for _log, verdict in session.verdicts], default=0)
    yield _begin(session, first)
    yield from _with_ticks(samples, others, end_ns)


def _begin(session: SupervisorSession, first: Configuration) -> Tick:
    """Begin of the first silence: when the settings came into force, or at the begin of the recording if that is
    later."""
    if session.begun_late:
        return Tick(session.states[0].received_ns, session.states[0].seen_ns)
    return Tick(first.received_ns, first.seen_ns)


def _with_ticks(samples: Sequence[JointSample], others: Sequence[Input], end_ns: int) -> Iterator[Input | JointColumns]:
    """In order of time, with a tick just after the end: a silence that counts from the end on is noticed by it."""
    kept = samples if isinstance(samples, JointSamples) else JointSamples(samples)
    others = sorted(others, key=lambda event: event.seen_ns)
    yield from in_order(kept, others)
    last = [*(event.seen_ns for event in others[-1:]), *(part.last_ns for part in [kept] if len(kept))]
    if end_ns > max(last, default=0):
        yield Tick(end_ns + 1, end_ns + 1)


def _step_through(
    judged: Judged,
    first: Configuration,
    events: Iterator[Input | JointColumns],
    numbers: Iterable[int],
    files: Sequence[Path],
    watches: tuple[Watch | None, WatchRows | None],
    ahead_ns: int = 0,
) -> None:
    """Judge the inputs of one supervisor. numbers: of its samples, as recorded."""
    stepper = Stepper(judged, first, numbers, files, watches, ahead_ns)
    stepper.take(events)
    stepper.finish()
