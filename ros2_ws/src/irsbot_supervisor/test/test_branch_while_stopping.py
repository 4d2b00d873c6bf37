"""Whether the branch is known while a stop takes effect: after late samples, when limits change, and when a robot that
should stand moves all the same."""

from __future__ import annotations

from itertools import count
from math import inf

import pytest
from near_type2 import ALWAYS, FREE, along, distance_m, standing, stood_at, until_type2
from supervised import configure, expectation, feed, newest, sample, supervisor_of, tick

from irsbot_msgs_py.records import Cause, Level
from irsbot_supervisor.core.branch_proof import BranchProof
from irsbot_supervisor.core.estimation.estimate import Silence
from irsbot_supervisor.core.settings import Settings

STEP_MS = 0.01


class Drives:
    """Of rails3: they run to Type 2 at full acceleration, are stopped hard there, and return until they brake."""

    def __init__(self, settings: Settings, away_m: float, begin_ms: float) -> None:
        self.settings, self.away_m = settings, away_m
        self.met_ms, self.brake_ms = inf, inf
        self._speed, self._ms = 0.0, begin_ms

    def until(self, ms: float) -> float:
        """m: distance from Type 2 at this time."""
        while self._ms + STEP_MS <= ms:
            fastest, gain = self.settings.velocity_limit[0], self.settings.acceleration_limit[0]
            sign = 1.0 if self._ms >= self.met_ms else -1.0
            if self._ms >= self.brake_ms:
                sign, gain, fastest = -1.0, self.settings.deceleration_limit[0], inf
            speed = self._speed + sign * gain * STEP_MS / 1e3
            speed = max(speed, 0.0) if self._ms >= self.brake_ms else max(-fastest, min(fastest, speed))
            self.away_m += 0.5 * (self._speed + speed) * STEP_MS / 1e3
            self._speed, self._ms = speed, self._ms + STEP_MS
            if self.away_m <= 0.0 and self.met_ms == inf:
                self.away_m, self._speed, self.met_ms = 0.0, 0.0, self._ms
        return self.away_m


@pytest.mark.parametrize(
    ("hz", "latency_s", "away_m", "begin_ms", "missing"),
    [
        (250, 0.005, 0.01211, 0.27, range(2, 8)),
        (100, 0.005, 0.01922, 4.16, range(3, 5)),
        (100, 0.01, 0.0233, 6.29, range(3, 6)),
        (250, 0.02, 0.0302, 0.66, range(3, 15)),
    ],
    ids=["250 Hz", "100 Hz", "a longer latency", "longer than stale_s"],
)
def test_drives_that_a_late_sample_stops_may_have_met_type_2_until_they_stand(hz, latency_s, away_m, begin_ms, missing):
    """The region until the late sample is free of Type 2, and the drives go on until their brakes act."""
    supervisor = supervisor_of("rails3", latency_s=latency_s)
    names, near_m, period_ms = supervisor.settings.joint_names, distance_m(), 1000.0 / hz
    drives, steps = Drives(supervisor.settings, away_m, begin_ms), []
    for k in range(-round(400.0 / period_ms), round(200.0 / period_ms)):
        ms = k * period_ms
        if k not in missing:
            steps.append(supervisor.step(sample(ms, along(near_m - drives.until(ms)), names=names)))
        else:
            steps.append(supervisor.step(tick(ms)))
        verdict = steps[-1].verdict
        if k >= 0 and verdict is not None and verdict.level >= Level.STOP and drives.brake_ms == inf:
            drives.brake_ms = ms + 1e3 * latency_s
    assert drives.met_ms < drives.brake_ms < inf
    assert any(one.causes & Cause.BRANCH for one in expectation(steps))
    assert newest(steps).latched


@pytest.mark.parametrize(
    ("before", "after", "away_m"),
    [
        ({"velocity_limit": [2.0]}, {"velocity_limit": [0.5]}, 0.034),
        ({"velocity_limit": [2.0], "acceleration_limit": [60.0]}, {"acceleration_limit": [5.0]}, 0.03),
    ],
    ids=["velocity", "acceleration"],
)
def test_limits_that_are_lowered_during_a_silence_do_not_count_backwards(before, after, away_m):
    supervisor, near_m = supervisor_of("rails3", **before), distance_m()
    steps = feed(supervisor, standing(-300, 1, along(near_m - away_m)))
    assert newest(steps).level == Level.OK
    drives = Drives(supervisor.settings, away_m, 0.0)
    drives.until(49.0)
    assert drives.met_ms < 49.0
    feed(supervisor, [tick(ms) for ms in (10, 20, 30, 40)])
    supervisor.step(configure(49, supervisor, **after))
    drives.settings, drives.brake_ms = supervisor.settings, 65.0
    end = along(near_m - drives.until(400.0))
    feed(supervisor, [tick(ms) for ms in (50, 60, 70)])
    steps = feed(supervisor, standing(300, 600, end))
    assert newest(steps).causes & Cause.BRANCH


@pytest.mark.parametrize("robot", ["rails3", "orthoglide", "irsbot2_beta45"])
@pytest.mark.parametrize("hz", [100, 250])
@pytest.mark.parametrize("times", [1.5, 3.0])
def test_a_stopped_robot_that_is_pushed_faster_than_recovery_speed_to_type_2_and_back_has_lost_its_branch(
    robot, hz, times
):
    """The turn is halfway between two samples, which are equal then."""
    supervisor, period_ms = supervisor_of(robot), 1000.0 / hz
    names, (start, way) = supervisor.settings.joint_names, until_type2(robot)
    clock = count(step=period_ms)
    steps = [supervisor.step(sample(next(clock), start, names=names)) for _ in range(hz // 4)]
    steps.append(supervisor.step(configure(next(clock), supervisor, **ALWAYS)))
    steps += [supervisor.step(sample(next(clock), start, names=names)) for _ in range(hz // 4)]
    assert (newest(steps).level, newest(steps).latched) == (Level.STOP, True)
    rate = times * supervisor.settings.recovery_share * supervisor.settings.velocity_limit[0]
    share = rate * period_ms / 1e3 / max(map(abs, way))
    steps_out = int(1.0 / share)
    ways = [1.0 - share * abs(k - 0.5) for k in range(-steps_out, steps_out + 2)]
    for part in ways:
        position = tuple(q + max(part, 0.0) * step for q, step in zip(start, way, strict=True))
        steps.append(supervisor.step(sample(next(clock), position, names=names)))
    steps += [supervisor.step(sample(next(clock), start, names=names)) for _ in range(hz // 10)]
    assert newest(steps).causes & Cause.BRANCH


@pytest.mark.parametrize("gap_ms", [30, 40, 70])
def test_a_robot_that_is_led_out_of_a_stop_keeps_its_branch_if_samples_are_missing(gap_ms):
    supervisor = stood_at(FREE)
    supervisor.step(configure(0, supervisor, type2_stop=0.4, type2_warn=0.5))
    steps = feed(supervisor, standing(1, 200))
    assert (newest(steps).level, newest(steps).latched) == (Level.STOP, True)
    settings = supervisor.settings
    rate = 0.9 * settings.recovery_share * settings.velocity_limit[0] / 1e3
    for ms in [*range(200, 260, 4), *range(260 + gap_ms, 560, 4)]:
        steps.append(supervisor.step(sample(ms, along(-rate * (ms - 200)), names=settings.joint_names)))
    assert not any(one.causes & Cause.BRANCH for one in expectation(steps))


def test_a_proof_that_ends_in_an_error_proves_nothing(monkeypatch):
    supervisor = stood_at(FREE)
    mechanism, near_m = supervisor.robot.mechanism, distance_m()
    at = mechanism.posture(FREE, supervisor.settings.assembly_mode)
    proof = BranchProof(supervisor.settings, mechanism)
    ends = zip(FREE, along(1.01 * near_m), strict=True)
    silence = Silence(*map(tuple, zip(*[(min(a, b), max(a, b)) for a, b in ends], strict=True)), in_time=True)
    with monkeypatch.context() as broken:
        broken.setattr("irsbot_supervisor.core.box_search.BoxBounds.least", lambda *_: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            proof.holds(at, silence)
    assert not proof.holds(at, silence)
    small = Silence(tuple(q - 1e-6 for q in FREE), tuple(q + 1e-6 for q in FREE), in_time=True)
    assert proof.holds(at, small)
    assert not proof.holds(at, silence)
