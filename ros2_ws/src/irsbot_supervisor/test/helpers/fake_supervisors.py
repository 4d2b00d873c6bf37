"""Fakes in place of the supervisor, for tests of what attacks it: one that holds, one that never stops, a timid one, a
hesitant one."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from irsbot_kinematics import Robot
from irsbot_msgs_py.records import JointSample, Level
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.core.estimation.sample_interval import SETTLING
from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.core.supervisor import Supervisor
from irsbot_supervisor.validation.harness.oracle import limits
from irsbot_supervisor.validation.in_process import reachable

WINDOW = 24
"""Samples that the fake remembers."""


class FakeBoxSupervisor:
    """Stops unless the oracle's whole box keeps the stop limits, by a grid. Tells levels and stop margins alone."""

    patient = True
    """Latches no STOP before it is known how often samples come."""

    def __init__(self, settings: Settings, robot: Robot) -> None:
        self._settings, self._robot = settings, robot
        self._samples: list[JointSample] = []
        self._begun_ns, self._gap_s = 0, 0.0
        self._level = Level.UNKNOWN

    def step(self, sample: JointSample) -> Any:
        """State and verdict as far as attacks look at them."""
        settings, past = self._settings, self._samples
        self._begun_ns = self._begun_ns or sample.seen_ns
        if past:
            self._gap_s = max(self._gap_s, (sample.seen_ns - past[-1].seen_ns) / NS_PER_S)
        self._samples = past = [*past[-WINDOW:], sample]
        stamps = np.array([one.stamp_ns - past[0].stamp_ns for one in past]) / NS_PER_S
        positions = np.array([one.position for one in past])
        age_s = (sample.received_ns - sample.stamp_ns) / NS_PER_S
        unseen_s = reachable.until_judged_s(self._gap_s, age_s)
        low, high = reachable.boxes(stamps, positions, settings, unseen_s)
        at = self._robot.mechanism.posture(sample.position, settings.assembly_mode)
        least = reachable.least_margins(self._robot, settings, low[-1:], high[-1:], [at])[0]
        stop = limits(settings, "stop")
        kind = int(((least - stop) / stop).argmin())
        waiting = sample.seen_ns - self._begun_ns < SETTLING * settings.stale_s * NS_PER_S
        now = Level.STOP if least[kind] < stop[kind] else Level.OK
        if waiting:
            now = max(now, Level.UNKNOWN) if self.patient or now != Level.STOP else now
        self._level = Level.STOP if self._level == Level.STOP else now
        state = SimpleNamespace(stop_margin=float(least[kind]), stop_limit=float(stop[kind]), level=now)
        return SimpleNamespace(state=state, verdict=SimpleNamespace(level=self._level))


class FakeHastySupervisor(FakeBoxSupervisor):
    """The same, latching a STOP from the first sample on, which tells nothing of speeds: nobody starts near a limit."""

    patient = False


class FakeTimidSupervisor(Supervisor):
    """The supervisor with Type 2 limits that hardly a posture keeps, whatever its settings say."""

    def __init__(self, settings: Settings, robot: Robot) -> None:
        super().__init__(replace(settings, type2_stop=0.9, type2_warn=0.9), robot)


class FakeLenientSupervisor(Supervisor):
    """The supervisor, whose every STOP is a warning."""

    def step(self, event: Any, report: bool = True) -> Any:
        step = super().step(event, report)
        verdict = step.verdict
        if verdict is not None and verdict.level == Level.STOP:
            verdict = verdict._replace(level=Level.WARN)
        return step._replace(verdict=verdict)


class FakeHesitantSupervisor(Supervisor):
    """The supervisor, which tells no stop for the first samples after it is due, once motion was allowed."""

    silent = 100
    """Samples for which it does not."""

    def __init__(self, settings: Settings, robot: Robot) -> None:
        super().__init__(settings, robot)
        self._told: Any = None
        self._allowed = False

    def step(self, event: Any, report: bool = True) -> Any:
        step = super().step(event, report)
        self._told = step.verdict or self._told
        stops = self._told is None or self._told.level > Level.WARN
        self._allowed = self._allowed or not stops
        if self._allowed and stops and self.silent:
            self.silent -= 1
            return step._replace(verdict=None)
        return step._replace(verdict=self._told)
