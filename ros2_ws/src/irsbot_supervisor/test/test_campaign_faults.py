"""The fault campaign in small: every row that needs no ROS, its oracles shown to bite, and what is true."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import cycle
from typing import Any

import numpy as np
import pytest
from fake_supervisors import FakeHesitantSupervisor, FakeTimidSupervisor

from irsbot_msgs_py.records import JointSample, Level
from irsbot_supervisor.configuration.feasibility import settings_from
from irsbot_supervisor.configuration.loading import read_settings
from irsbot_supervisor.core import assessment, latch, margins
from irsbot_supervisor.core import supervisor as pipeline
from irsbot_supervisor.core import validation as intake
from irsbot_supervisor.core.estimation import frozen, jumps, silence
from irsbot_supervisor.core.settings import InvalidSettings
from irsbot_supervisor.core.stopping import StoppingPredictor
from irsbot_supervisor.gate import velocity_gate
from irsbot_supervisor.gate.velocity_gate import Gate
from irsbot_supervisor.sim.trajectory import joint_move
from irsbot_supervisor.trajectory.joint_path import joint_limits_of
from irsbot_supervisor.validation.harness import oracle as truth
from irsbot_supervisor.validation.harness.case import Case
from irsbot_supervisor.validation.harness.motion import Motion, played, work
from irsbot_supervisor.validation.harness.rows import FALSE_STOPS, RECOVERY_S, TO_STOP_S, Job, Row, Tally
from irsbot_supervisor.validation.harness.stream import WARM_UP, InputStream, prepared
from irsbot_supervisor.validation.in_process import (
    approach,
    changes,
    clean,
    delivery,
    escape,
    garbage,
    loci,
    reachable,
    stamps,
    swings,
)
from irsbot_supervisor.validation.registry import ENTRIES
from irsbot_supervisor.validation.with_nodes import resets

pytestmark = pytest.mark.slow

AMOUNTS = {
    "approach": 4,
    "swings": 3,
    "adversary": 2,
    "clean": 400,
    "escape": 2,
    "delivery": 10,
    "stamps": 24,
    "garbage": 270,
    "loci": 26,
    "settings": 30,
    "reset-abuse": 80,
}
"""Cases of each row here: seconds each."""

THREE = ("irsbot2", "orthoglide", "rrr3")
FEW = {
    "approach": (*THREE, "five_bar"),
    "swings": THREE,
    "adversary": ("irsbot2",),
    "clean": ("irsbot2", "five_bar", "orthoglide", "rrr3_base", "ruu4"),
    "loci": THREE,
    "escape": ("irsbot2", "rrr3_base"),
}
"""Robots of the rows that take long for each of them."""


def quiet(_cases: int) -> None:
    pass


def job(amount: int, *robots: str, seed: int = 1) -> Job:
    return Job(amount, seed, quiet, robots)


@pytest.mark.parametrize("name", AMOUNTS)
def test_the_row_is_met(name: str) -> None:
    entry = next(entry for entry in ENTRIES if entry.name == name)
    told: list[int] = []
    row = entry.run(Job(AMOUNTS[name], 5, told.append, FEW.get(name, ())))
    assert row.ok, row
    assert row.amount >= AMOUNTS[name]
    assert sum(told) == row.amount
    assert row.figures.get(FALSE_STOPS, 0.0) == 0.0
    assert row.figures.get(TO_STOP_S, 0.0) <= 0.06
    assert row.figures.get(RECOVERY_S, 0.0) <= 0.5


def test_the_rows_have_names_of_their_own_and_the_amounts_that_are_asked_for() -> None:
    names = [entry.name for entry in ENTRIES]
    assert len(set(names)) == len(names)
    full = {entry.name: entry.full for entry in ENTRIES}
    assert full["approach"] >= max(10_000, 1000 * len(truth.supervised()))
    assert full["clean"] >= 1_000_000
    assert min(full[name] for name in ("garbage", "loci", "settings")) >= 10_000
    assert full["escape"] >= 1000
    assert {"approach", "garbage"} <= {entry.name for entry in ENTRIES if entry.over_robots}, "for every mechanism"
    assert all(0 < entry.quick <= entry.full for entry in ENTRIES)


# --- the oracles bite: a supervisor that is broken in one place breaks the row ---------------------------------------


def blind(monkeypatch: pytest.MonkeyPatch) -> None:
    """The prediction is the present margins."""

    def now(self: Any, at: Any, *_rest: Any, **_more: Any) -> Any:
        return margins.margins_of(at)

    monkeypatch.setattr(pipeline.StoppingPredictor, "predict", now)


def timid(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every margin may vanish."""

    class Timid(StoppingPredictor):
        def predict(self, *_rest: Any, **_more: Any) -> Any:
            return (0.0,) * 4

    monkeypatch.setattr(pipeline, "StoppingPredictor", Timid)  # the settings are checked with the right one


def trusting(monkeypatch: pytest.MonkeyPatch) -> None:
    """Stamps are believed whatever they are."""
    monkeypatch.setattr(intake.Intake, "_stamp_fault", lambda *_: None)


def careless(monkeypatch: pytest.MonkeyPatch) -> None:
    """Joints are taken in the order in which they come."""

    def learn(self: Any, names: tuple[str, ...]) -> str:
        self._names, self._pick = names, lambda values: values[: len(self._joints)]
        return "" if len(names) >= len(self._joints) else "too few"

    monkeypatch.setattr(intake.Intake, "_learn", learn)


def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Silence is no reason."""
    monkeypatch.setattr(pipeline.Supervisor, "_pass_time", lambda *_: False)


def credulous(monkeypatch: pytest.MonkeyPatch) -> None:
    """No jump is too far, and nothing is frozen."""
    monkeypatch.setattr(jumps.Jumps, "fault", lambda *_: "")
    monkeypatch.setattr(frozen.Frozen, "look", lambda *_: frozen.Suspicion())


def gullible(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same, and nothing happens between two samples."""
    credulous(monkeypatch)
    monkeypatch.setattr(silence.Silences, "region", lambda *_, **__: None)


def forgetful(monkeypatch: pytest.MonkeyPatch) -> None:
    """The working mode of the legs is not looked at."""
    monkeypatch.setattr(assessment.Assessor, "_mode_fault", lambda *_: "")


def obliging(monkeypatch: pytest.MonkeyPatch) -> None:
    """A robot stands whatever its joints do."""
    monkeypatch.setattr(pipeline.Supervisor, "standing", True)


def hesitant(monkeypatch: pytest.MonkeyPatch) -> None:
    """A stop is told a tenth of a second after it is due."""
    monkeypatch.setattr(loci, "Supervisor", FakeHesitantSupervisor)


def forgiving(monkeypatch: pytest.MonkeyPatch) -> None:
    """A reset does not ask whether a cause is active."""
    judged = latch.Latch.reset
    monkeypatch.setattr(
        latch.Latch, "reset", lambda self, event, at_ns, standing, _: judged(self, event, at_ns, standing, [])
    )


def permissive(monkeypatch: pytest.MonkeyPatch) -> None:
    """No command leads beyond a limit."""
    monkeypatch.setattr(Gate, "_beyond", lambda *_: None)


def generous(monkeypatch: pytest.MonkeyPatch) -> None:
    """A way out may lose what a margin has."""
    monkeypatch.setattr(velocity_gate, "DIP", 0.5)
    monkeypatch.setattr(escape, "DIP", 0.5, raising=False)  # also where the row knows of it


def absent_minded(monkeypatch: pytest.MonkeyPatch) -> None:
    """A change of one setting is lost."""
    monkeypatch.setattr(
        changes, "settings_from", lambda values, robot: settings_from({**values, "load_force_n": 50.0}, robot)
    )


def unwilling(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every change is refused."""

    def refuse(*_: Any) -> None:
        raise InvalidSettings("no")

    monkeypatch.setattr(changes, "settings_from", refuse)


@pytest.mark.parametrize(
    ("broken", "run", "work"),
    [
        (blind, approach.run, job(3, "irsbot2")),
        (blind, swings.run, job(3, "irsbot2")),
        (permissive, escape.run, job(1, "irsbot2")),
        (generous, escape.run, job(1, "irsbot2")),
        (absent_minded, changes.run, job(60)),
        (unwilling, changes.run, job(60)),
        (hesitant, loci.run, job(8, "irsbot2")),
        (forgiving, resets.run, job(60)),
        (trusting, stamps.run, job(12)),
        (patient, delivery.run, job(8)),
        (credulous, delivery.run, job(8)),
        (careless, garbage.run, job(54)),
        (gullible, loci.run, job(8, "irsbot2")),
        (forgetful, loci.run, job(30, "irsbot2")),
        (timid, loci.run, job(8, "irsbot2")),
        (obliging, resets.run, job(60)),
    ],
)
def test_a_row_finds_a_broken_supervisor(
    broken: Callable[[pytest.MonkeyPatch], None],
    run: Callable[[Job], Row],
    work: Job,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    broken(monkeypatch)
    row = run(work)
    assert row.unsafe + row.failed > 0
    assert row.note


@pytest.mark.parametrize(("periods", "unsafe"), [(1.9, False), (5.0, True)])
def test_a_position_that_is_farther_off_than_motion_can_be_must_not_be_allowed(
    monkeypatch: pytest.MonkeyPatch, periods: float, unsafe: bool
) -> None:
    credulous(monkeypatch)
    work = InputStream("irsbot2", np.random.default_rng(1))
    work.run(WARM_UP)
    work.advance()
    off = periods * 1e-3 * work.settings.velocity_limit[0]

    def shifted(sample: JointSample, _rng: np.random.Generator) -> JointSample:
        return sample._replace(position=(sample.position[0] + off, *sample.position[1:]))

    tally = Tally("one", job(1))
    assert bool(garbage._try(work, shifted, np.random.default_rng(1), tally)[0]) is unsafe


def test_robots_that_are_led_nowhere_fail_the_row_escape(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(escape, "FEW", 0)
    monkeypatch.setattr(escape.GuidedRobot, "way_out", ())
    row = escape.run(job(4, "five_bar"))
    assert row.failed == 1
    assert "five_bar: " in row.note
    assert "did not lead it out" in row.note


@pytest.mark.parametrize(
    ("held", "back", "fails"), [(0, 0, False), (2, 2, False), (3, 3, True), (10, 5, False), (10, 6, True)]
)
def test_half_of_the_robots_that_are_held_at_rest_must_be_led_out(held: int, back: int, fails: bool) -> None:
    assert escape.led_nowhere(held, back) is fails


def test_a_supervisor_that_stops_too_early_has_false_stops_and_warns_at_work(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(clean, "Supervisor", FakeTimidSupervisor)
    row = clean.run(job(600, "irsbot2"))
    assert row.failed >= row.figures[FALSE_STOPS] > row.amount // 2
    assert row.figures["warnings at work"] > 0


def test_only_samples_that_are_clear_are_judged(monkeypatch: pytest.MonkeyPatch) -> None:
    """Limits that hardly a posture keeps, known to the oracle: nothing is wrong but that there is nothing to judge."""
    settings, robot = read_settings("irsbot2")
    strict = replace(settings, type2_stop=0.9, type2_warn=0.9)
    monkeypatch.setattr(clean, "read_settings", lambda _name: (strict, robot))
    monkeypatch.setattr(clean, "works", tuple)
    monkeypatch.setattr(clean, "swings", lambda *_: work(robot, settings))
    row = clean.run(job(100, "irsbot2"))
    assert row.figures[FALSE_STOPS] == 0.0
    assert row.amount < 100
    assert row.failed == 1
    assert "are clear" in row.note


def test_a_batch_in_which_no_robot_moves_yet_has_no_clear_sample(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(clean, "BATCH", 50)
    monkeypatch.setitem(reachable.POINTS, 3, 2)  # corners will do
    row = clean.run(job(60, "rrr3_base"))
    assert (row.amount, row.failed) == (60, 0), row


def test_a_motion_ends_where_a_stop_is_due_and_another_one_begins(monkeypatch: pytest.MonkeyPatch) -> None:
    """It would not obey, and a robot that goes on after a stop is rightly warned of wherever it is."""
    settings, robot = read_settings("irsbot2")
    good, bad = (0.574, 2.33), (1.474, 1.43)
    assert (truth.margins(robot, settings, np.array([bad])) < truth.limits(settings, "stop")).any()
    begun = 0

    def into_a_limit(*_: object) -> Motion:
        nonlocal begun
        begun += 1
        limits = joint_limits_of(settings)
        for here, there in cycle(((good, bad), (bad, good))):
            yield from played(joint_move(here, there, limits, 0.2))

    monkeypatch.setattr(clean, "works", tuple)
    monkeypatch.setattr(clean, "swings", into_a_limit)
    row = clean.run(job(1000, "irsbot2"))
    assert (row.amount, row.failed) == (1000, 0), row
    assert begun >= 3


def test_a_verdict_that_allows_motion_too_long_after_the_last_true_sample_is_unsafe() -> None:
    tally = Tally("one", job(1))
    case = Case("irsbot2", 0.5, np.random.default_rng(1), tally)
    case.stream.run(WARM_UP)
    assert case.stream.level == Level.OK
    case.watch(case.stream.now_ns - case.limit_ns)
    assert not case.unsafe
    case.watch(case.stream.now_ns - case.limit_ns - 1)
    assert case.unsafe


# --- what is true -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", truth.supervised())
def test_good_postures_are_in_the_configured_modes_and_within_the_joint_ranges(name: str) -> None:
    settings, robot = read_settings(name)
    low, high = truth.joint_ranges(robot)
    for joints in truth.good_postures(robot, settings, 3, np.random.default_rng(2)):
        assert (low <= joints).all()
        assert (joints <= high).all()
        at = robot.posture(joints, settings.assembly_mode)
        assert at.working_mode == settings.working_mode
        assert min(at.type1) >= settings.type1_warn
        assert at.type2 >= settings.type2_warn


def test_a_line_moves_no_faster_than_its_joints_can_and_reports_how_fast() -> None:
    line = InputStream("orthoglide", np.random.default_rng(3))
    before = np.array(line.position)
    for _ in range(3000):
        line.run(1)
        moved = (np.array(line.position) - before) / 1e-3
        before = np.array(line.position)
        assert (
            np.abs(moved - line.velocity).max() <= 0.5 * 40.0 * 1e-3 + 2e-5 / 1e-3
        )  # half a period of braking, and steps
    assert [level for _ns, level in line.changes] == [Level.OK]


def test_a_ramp_is_judged_on_the_branch_of_its_first_sample() -> None:
    """The labels 1 and 2 of this machine change places between the start of the ramp and its first sample."""
    settings, robot = read_settings("rails2")
    start, rates = np.array([0.79030511, 0.21791414, 0.35185108]), np.array([0.43223083, -0.38703907, 0.31327091])
    ramp = approach.Ramp(start, rates, latency_s=0.00057, age_s=0.003, phase_s=0.00077, burst=1)
    at_start = robot.mechanism.posture(tuple(start.tolist()), settings.assembly_mode)
    first = robot.mechanism.posture(ramp.read(0, settings), settings.assembly_mode)
    assert abs(first.type2 - at_start.type2) > 0.5
    seen_s = approach.stop_time(ramp, replace(settings, latency_s=ramp.latency_s), robot)
    assert (approach.spare_of(ramp, seen_s, settings, robot) > 0.0).all()


def test_a_stream_begins_where_the_configured_assembly_mode_names_the_branch_of_the_work() -> None:
    work = prepared("rails2")  # two branches with the same label
    way = np.array([position for position, _velocity in work.points])
    first = work.robot.posture(way[0], work.settings.assembly_mode)
    named = [work.robot.posture(joints, work.settings.assembly_mode).pose for joints in way[::50]]
    followed = [at.pose for at in truth.followed(work.robot, way, first)][::50]
    same = np.abs(np.array(named) - followed).max(axis=1) < 1e-4
    assert same.any()
    assert not same.all()
    begins = np.zeros(len(way), dtype=bool)
    begins[list(work.begins)] = True
    begun = [bool(begins[k : k + 50].any()) for k in range(0, len(way) - 50, 50)]
    assert [k for k in range(len(begun)) if begun[k] and not (same[k] or same[k + 1])] == []
    assert sum(begun) >= sum(same) - 1
