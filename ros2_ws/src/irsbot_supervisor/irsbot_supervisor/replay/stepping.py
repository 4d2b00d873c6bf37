"""One supervisor that judges its recorded inputs again, and what is noted of the results."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import islice
from math import inf, nan
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from irsbot_kinematics import BadInput, KinematicsError, Robot
from irsbot_kinematics.description.robot_record import robot_from_record
from irsbot_msgs_py.records import Cause, JointSample, Level, SingularityState, Tick
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.bag.joint_columns import JointColumns, JointSamples
from irsbot_supervisor.bag.journal import Configuration, Entry
from irsbot_supervisor.configuration.feasibility import settings_from
from irsbot_supervisor.core.events import Configure, Event
from irsbot_supervisor.core.margins import MARGIN_NAMES, margins_of
from irsbot_supervisor.core.settings import InvalidSettings
from irsbot_supervisor.core.stop_monitor import MeasuredStop
from irsbot_supervisor.core.supervisor import Supervisor
from irsbot_supervisor.replay.quiet.strides import QuietRows, Strides

if TYPE_CHECKING:
    from irsbot_supervisor.replay.judged import Judged

Input = JointSample | Tick | Entry
"""An input of a supervisor, as the bag has it."""

SAME = 1e-9
"""1: margins of columns that differ by less may be in another order; far above their rounding."""

Watch = Callable[[int, int, SingularityState], None]
"""Called for every sample that is judged again: number of the session, ns on the clock of the intervals, and the
result."""

WatchRows = Callable[[int, int, Supervisor, QuietRows], None]
"""The same for samples that are judged as columns; ns by which that clock is ahead of theirs, and their supervisor."""


def in_order(samples: JointSamples, others: Sequence[Input]) -> Iterator[Input | JointColumns]:
    """Samples and other inputs in order of time, samples as columns where possible. others: in order."""
    waiting = list(reversed(others))
    newest = -(2**63)
    for part in samples.parts:
        seen = part.seen_ns if isinstance(part, JointColumns) else np.array([one.seen_ns for one in part], np.int64)
        if len(seen) and (seen[0] < newest or (np.diff(seen) < 0).any()):
            yield from sorted([*samples, *others], key=lambda event: event.seen_ns)
            return
        newest = int(seen[-1]) if len(seen) else newest
    for part in samples.parts:
        if not isinstance(part, JointColumns):
            for sample in part:
                while waiting and waiting[-1].seen_ns < sample.seen_ns:
                    yield waiting.pop()
                yield sample
            continue
        at = 0
        while at < len(part):
            until = len(part)
            if waiting:
                until = int(np.searchsorted(part.seen_ns, waiting[-1].seen_ns, side="right"))
            if until > at:
                yield part[at:until]
                at = until
            elif waiting:
                yield waiting.pop()
    yield from reversed(waiting)


class Stepper:
    """Judges the inputs of one supervisor and notes the results in `judged`."""

    def __init__(
        self,
        judged: Judged,
        first: Configuration,
        numbers: Iterable[int],
        files: Sequence[Path],
        watches: tuple[Watch | None, WatchRows | None],
        ahead_ns: int,
    ) -> None:
        """numbers: of its samples, as recorded."""
        self._judged, self._numbers, self._ahead_ns = judged, iter(numbers), ahead_ns
        self._watch, self._watch_rows = watches
        self._machine = _machine_of(first, files)
        self.supervisor = Supervisor(settings_from(first.values, self._machine), self._machine)
        judged.machine = self._machine
        judged.settings.append((first.seen_ns + ahead_ns, self.supervisor.settings))
        self._part, self._slow = len(judged.parts), judged.settings[0][1].standstill_speed
        judged.parts.append([])
        self._stop: MeasuredStop | None = None
        self._level = Level.UNKNOWN
        self._halted = False  # True from the end of work until the joints stand: its path is measured
        self._strides: Strides | None = None

    def take(self, events: Iterable[Input | JointColumns]) -> None:
        """Judge inputs in order of time."""
        for event in events:
            if not isinstance(event, JointColumns):
                self.step(event)
            elif self._watch is not None and self._watch_rows is None:
                for sample in event.samples():
                    self.step(sample)
            else:
                if self._strides is None:
                    self._strides = Strides(self.supervisor, self.step, self._rows, lambda: not self._halted)
                self._strides.judge(event)

    def step(self, event: Input) -> None:
        """Judge one input. An internal error makes the state UNKNOWN, as in the node, and the replay goes on."""
        judged, supervisor, ahead_ns = self._judged, self.supervisor, self._ahead_ns
        try:
            step = supervisor.step(_event(event, self._machine))
        except InvalidSettings:  # of the bag, not of an error inside
            raise
        except Exception as error:  # as the node guards it
            step = supervisor.fail(event.seen_ns, error)
            judged.errors.append(f"input seen at {event.seen_ns / NS_PER_S:.6f}: {type(error).__name__}: {error}")
        if isinstance(event, JointSample):
            found = step.found or (Level.UNKNOWN, int(Cause.INTERNAL))
            judged.levels.add(self._part, [next(self._numbers)], found)
            if step.state is not None:
                self._note(step.state)
        elif isinstance(event, Configuration):
            judged.settings.append((event.seen_ns + ahead_ns, supervisor.settings))
            self._strides = None
        if supervisor.measured_stop is not self._stop:
            self._stop = supervisor.measured_stop
            judged.stops += [(event.seen_ns + ahead_ns, self._stop)] if self._stop else []
        for turn in step.transitions:
            self._halted |= self._level < Level.STOP <= turn.level
            self._level = turn.level
            judged.note(turn, self._part, ahead_ns)

    def _note(self, state: SingularityState) -> None:
        """Keep the smallest margins; NaN, for a posture that is not assembled or a margin that the robot does not have,
        is ignored."""
        if self._halted and all(abs(rate) <= self._slow for rate in state.joint_velocity):
            self._halted = False
        values = (
            min(state.type1_margin, default=nan),
            state.type2_margin,
            state.constraint_margin,
            min(state.limb_margin, default=nan),
        )
        for name, value in zip(MARGIN_NAMES, values, strict=True):
            if value < self._smallest(name):
                self._judged.margins[name] = value, state.stamp_ns
        if self._watch is not None:
            self._watch(self._part, state.seen_ns + self._ahead_ns, state)

    def _smallest(self, name: str) -> float:
        return self._judged.margins.get(name, (inf, 0))[0]

    def _rows(self, rows: QuietRows) -> None:
        """Note samples that were judged as columns."""
        self._exact(rows)
        self._judged.levels.add(self._part, list(islice(self._numbers, len(rows.joints))), (Level.OK, 0))
        if self._watch_rows is not None:
            self._watch_rows(self._part, self._ahead_ns, self.supervisor, rows)

    def _exact(self, rows: QuietRows) -> None:
        """Compute the smallest margins again as the supervisor does, and put them in the columns: their last digits
        count."""
        margins, poses = rows.postures.margins[rows.rows], rows.postures.pose[rows.rows]
        known = np.array([self._smallest(name) for name in MARGIN_NAMES])
        small = (margins <= np.minimum(margins.min(0), known) + SAME) & np.isfinite(margins)
        mechanism, assembly = self._machine.mechanism, self.supervisor.settings.assembly_mode
        found: dict[bytes, tuple[tuple[float, ...], tuple[float, ...]]] = {}
        for row in np.flatnonzero(small.any(1)).tolist():
            position = rows.joints.position[row]
            if (key := position.tobytes()) not in found:
                at = mechanism.posture(tuple(position.tolist()), assembly)
                found[key] = margins_of(at), at.pose
            margins[row], poses[row] = found[key]
            for name, value in zip(MARGIN_NAMES, margins[row].tolist(), strict=True):
                if value < self._smallest(name):
                    self._judged.margins[name] = value, int(rows.joints.stamp_ns[row])

    def finish(self) -> None:
        """Note what counts for the whole supervision."""
        self._judged.rejections.update(self.supervisor.rejections)


def _machine_of(first: Configuration, files: Sequence[Path]) -> Robot:
    """The recorded robot. Raises KinematicsError."""
    try:
        return robot_from_record(first.machine, files)
    except KinematicsError:
        raise
    except ValueError as error:
        raise BadInput(f"not the record of a robot: {error}") from None


def _event(given: Input, machine: Robot) -> Event:
    """An event for the core: settings are checked here, once."""
    if isinstance(given, Configuration):
        return Configure(given.received_ns, given.seen_ns, settings_from(given.values, machine))
    return given
