"""What a live page is told: the newest look, the last seconds without a hole, and nothing old as if it were present."""

from __future__ import annotations

import json
from dataclasses import asdict
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import irsbot_kinematics as irs
from irsbot_kinematics.conformance.samples import Machine
from irsbot_kinematics.description.robot_record import robot_record
from irsbot_kinematics.mechanism import Status
from irsbot_msgs_py.cdr import encode_state, encode_verdict
from irsbot_msgs_py.records import Level, SingularityState, unknown_state
from irsbot_supervisor.bag.journal import write_entry
from irsbot_supervisor.configuration.loading import read_settings
from irsbot_supervisor.core.margins import MARGIN_CAUSES
from irsbot_supervisor.live.feed import BOX_EVERY, HISTORY_S, Feed, Known
from irsbot_supervisor.live.scene import COLUMNS, Scene, drawn
from irsbot_supervisor.processes.observed import Observed
from irsbot_supervisor.replay.recording import Recording, read_recording
from irsbot_supervisor.replay.run_summary import margin_of

BAGS = Path(__file__).resolve().parents[4] / "bags"
FRAME_S = 1.0 / 30.0


@pytest.fixture(scope="module")
def run() -> Recording:
    return read_recording(BAGS / "type2")


class Told:
    """A feed of a recorded run, told at the times of its recording, and who asked for its drawing."""

    def __init__(self, run: Recording) -> None:
        self.asked: list[tuple[Scene, SingularityState]] = []
        self.feed = Feed(lambda scene, state: self.asked.append((scene, state)))
        self.observed = Observed()
        for entry in run.journal:
            self.observed.hear_journal(write_entry(entry))
        ahead_ns = run.sessions[0].ahead_ns
        heard = [(log_ns - ahead_ns, verdict) for log_ns, verdict in run.verdicts]
        self._messages = sorted([*heard, *((state.seen_ns, state) for state in run.states)], key=lambda one: one[0])
        self.now_s = self._messages[0][0] * 1e-9

    def look(self, seconds: float = FRAME_S) -> None:
        """Let that time pass."""
        self.now_s += seconds
        while self._messages and self._messages[0][0] * 1e-9 <= self.now_s:
            time_ns, message = self._messages.pop(0)
            if isinstance(message, SingularityState):
                self.observed.hear_states([encode_state(message)], [time_ns * 1e-9])
            else:
                self.observed.hear_verdicts([encode_verdict(message)], [time_ns * 1e-9])
        self.feed.hear(self.observed.look(self.now_s), self.now_s)

    def play(self) -> None:
        """The whole run."""
        while self._messages:
            self.look()

    def answer(self, known: Known | None = None) -> dict[str, Any]:
        found: dict[str, Any] = json.loads(self.feed.answer(known or Known()))
        return found


def test_it_tells_the_newest_state_and_its_limits(run: Recording) -> None:
    told = Told(run)
    told.play()
    last, answer = run.states[-1], told.answer()
    _time, level, columns, pose, _low, _high = answer["rows"][-1]
    joints = answer["now"]["joints"]
    assert level == run.verdicts[-1][1].level.name
    assert columns[:2] == pytest.approx([min(last.type1_margin), last.type2_margin], rel=1e-8)
    assert pose == pytest.approx(last.pose, rel=1e-8)
    assert {f"{value:.6f}" for value in last.joint_position} <= {f"{value:.6f}" for value in joints.values()}
    (settings,) = [entry.values for entry in run.journal]
    limits = {(one["of"], one["kind"]): one["value"] for one in answer["setup"]["limits"]}
    assert limits["Type 2 margin", "stop"] == settings["type2_stop"]
    assert answer["now"]["stop_limit"] == last.stop_limit


def test_a_verdict_is_told_when_it_says_something_else(run: Recording) -> None:
    told, page = Told(run), Known()
    told.play()
    last = run.verdicts[-1][1]
    assert told.answer(page)["verdict"]["text"] == last.text
    for verdict, said in (
        (last._replace(sequence=last.sequence + 1, stamp_ns=last.stamp_ns + 1), False),
        (last._replace(speed_scale=0.25), True),
        (last._replace(speed_scale=0.25, findings=()), True),
    ):
        told.observed.hear_verdicts([encode_verdict(verdict)], [told.now_s])
        told.look()
        answer = told.answer(page)
        assert ("verdict" in answer) == said
    assert answer["verdict"]["findings"] == []


def test_pages_that_ask_seldom_and_often_get_the_same_rows(run: Recording) -> None:
    told, often, seldom = Told(run), Known(), Known()
    rows: dict[str, list[Any]] = {"often": [], "seldom": []}
    for number in range(60):
        told.look()
        rows["often"] += told.answer(often)["rows"]
        if number % 7 == 0 or number == 59:
            rows["seldom"] += told.answer(seldom)["rows"]
    assert rows["often"] == rows["seldom"]
    assert len(rows["often"]) == 60
    again = told.answer(often)
    assert again["rows"] == []
    assert "verdict" not in again
    assert "setup" not in again
    assert "changes" not in again


def test_a_page_that_comes_late_gets_the_history_and_no_more(run: Recording) -> None:
    told = Told(run)
    told.play()
    for _ in range(round(1.5 * HISTORY_S / FRAME_S)):
        told.look()
    rows = told.answer()["rows"]
    assert rows[-1][0] - rows[0][0] == pytest.approx(HISTORY_S, abs=2 * FRAME_S)
    assert rows[-1][0] == told.now_s


def test_silence_is_unknown_and_shows_no_posture(run: Recording) -> None:
    told = Told(run)
    while told.answer()["now"].get("level") not in ("OK", "WARN"):
        told.look()
    before = told.answer()
    assert before["now"]["silent"] is False
    assert before["rows"][-1][3]
    told.feed.hear(told.observed.look(told.now_s + 0.15), told.now_s + 0.15)  # nothing came
    after = told.answer()
    assert after["now"]["level"] == "UNKNOWN"
    assert after["now"]["silent"] is True
    assert after["rows"][-1][1:] == ["UNKNOWN", [], [], [], []]
    assert after["box"] == []
    assert after["now"]["joints"] == {}


def test_the_drawing_is_asked_for_once_and_told_to_every_page(run: Recording) -> None:
    told, page = Told(run), Known()
    told.play()
    ((scene, state),) = told.asked
    assert "view" not in told.answer(page)["setup"]
    view = drawn(scene.record, scene.settings.working_mode, state.pose)
    told.feed.show(scene, view)
    shown = told.answer(page)["setup"]["view"]
    assert shown["loci"]
    assert {link["joint"] for link in shown["links"] if link["axis"]} == set(scene.joints(state))
    assert "setup" not in told.answer(page)


def test_a_section_through_another_height_is_asked_for_while_somebody_looks() -> None:
    settings, robot = read_settings("orthoglide")
    postures = [at for at in Machine(robot, 20, 11).postures if at.status == Status.SOLVED]
    low, high = min(postures, key=lambda at: at.pose[2]), max(postures, key=lambda at: at.pose[2])
    state = unknown_state((0, 0, 0), "orthoglide", 1, 0, (low.joints, (0.0,) * 3), (3, 0))
    seen = Observed().look(0.0)._replace(limits=asdict(settings), machine=robot_record(robot), state_age_s=0.0)
    asked: list[float] = []
    feed = Feed(lambda _scene, state: asked.append(state.pose[2]))
    for now_s, at, looked_at, heights in (
        (0.0, low, False, [low]),
        (1.0, high, True, [low]),  # a moment later
        (10.0, low, True, [low]),  # as it is drawn
        (20.0, high, False, [low]),  # for nobody
        (30.0, high, True, [low, high]),
    ):
        feed.hear(seen._replace(state=state._replace(pose=low.pose)), now_s - 0.02)  # forgets who looked
        feed.hear(seen._replace(state=state._replace(pose=low.pose)), now_s - 0.01)
        if looked_at:
            feed.answer(Known())
        feed.hear(seen._replace(state=state._replace(joint_position=at.joints, pose=at.pose)), now_s)
        assert asked == [one.pose[2] for one in heights]


@pytest.mark.parametrize("name", irs.robots())
def test_a_moving_robot_of_every_kind_is_told_with_its_joints_and_where_it_may_get(name: str) -> None:
    settings, robot = read_settings(name)
    at = next(at for at in Machine(robot, 20, 11).postures if at.status == Status.SOLVED)
    rates = tuple(0.01 * limit for limit in settings.velocity_limit)
    sizes = len(at.pose), robot.mechanism.limb_count
    state = unknown_state((0, 0, 0), name, 1, 0, (at.joints, rates), sizes)._replace(
        pose=at.pose, assembly_mode=at.assembly_mode
    )
    seen = (
        Observed()
        .look(0.0)
        ._replace(limits=asdict(settings), machine=robot_record(robot), state=state, state_age_s=0.0, state_hz=1000.0)
    )
    feed = Feed(lambda *_: None)
    for number in range(2 * BOX_EVERY):
        feed.hear(seen, 0.1 * number)
        told = json.loads(feed.answer(Known()))
    names = [one.name for one in robot.mechanism.joints]
    assert [told["now"]["joints"][name] for name in names] == list(at.joints)
    assert told["rows"][-1][3] == list(at.pose)
    assert told["box"]


def test_other_limits_of_the_same_robot_keep_its_drawing(run: Recording) -> None:
    told = Told(run)
    told.play()
    scene, _state = told.asked[0]
    told.feed.show(scene, {"links": []})
    (entry,) = run.journal
    told.observed.hear_journal(write_entry(entry._replace(values={**entry.values, "type2_warn": 0.35})))
    told.look()
    setup = told.answer()["setup"]
    assert setup["view"] == {"links": []}
    assert {"of": "Type 2 margin", "kind": "warn", "value": 0.35} in setup["limits"]
    assert len(told.asked) == 1


def test_a_robot_that_cannot_be_built_is_named_with_the_reason(run: Recording) -> None:
    told = Told(run)
    (entry,) = run.journal
    told.observed.hear_journal(write_entry(entry._replace(machine={**entry.machine, "geometry": {}})))
    told.look()
    setup = told.answer()["setup"]
    assert setup["robot"] == entry.machine["name"]
    assert setup["note"]
    assert told.answer()["rows"][-1][2:] == [[], [], [], []]
    assert told.answer()["now"]["joints"] == {}


def test_nothing_heard_is_no_level_but_unknown() -> None:
    feed = Feed(lambda *_: None)
    feed.hear(Observed().look(5.0), 5.0)
    told = json.loads(feed.answer(Known()))
    assert told["now"]["level"] == Level.UNKNOWN.name
    assert told["verdict"] is None
    assert told["now"]["verdict_age_s"] is None
    assert told["rows"] == [[5.0, "UNKNOWN", [], [], [], []]]


def test_no_margin_between_two_looks_is_hidden(run: Recording) -> None:
    """Each row holds the smallest and the largest of every state since the row before, read one by one."""
    told, known, spans = Told(run), Known(), []
    while told._messages:
        until_s = told.now_s + FRAME_S
        between = [one for ns, one in told._messages if ns * 1e-9 <= until_s and isinstance(one, SingularityState)]
        told.look()
        (row,) = told.answer(known)["rows"]
        margins = np.array([_columns(state) for state in between]).reshape(-1, len(COLUMNS))
        finite = np.isfinite(margins)
        for column, (low, high) in enumerate(zip(row[4], row[5], strict=True)):
            values = margins[finite[:, column], column]
            assert [low, high] == (pytest.approx([values.min(), values.max()]) if len(values) else [None, None])
            spans += [high - low] if len(values) else []
        assert bool(row[4]) == bool(between)
    assert max(spans) > 1e-3  # one value per look would not have told


def _columns(state: SingularityState) -> list[float]:
    return [*[margin_of(state, kind) for kind in MARGIN_CAUSES], state.stop_margin]


def test_a_dip_of_one_sample_and_a_stop_of_one_verdict_stay_in_their_row(run: Recording) -> None:
    told, known = Told(run), Known()
    told.look()
    while not told.answer()["rows"][-1][2]:
        told.look()
    told.answer(known)
    state = run.states[0]._replace(seen_ns=0)
    calm, dip = (state._replace(type2_margin=value, limb_margin=()) for value in (0.5, 0.01))
    unknown = unknown_state((0, 0, 0), state.robot, 7, 0, ((0.0,) * 3, ()), (1, 2))  # another layout
    stop = run.verdicts[0][1]._replace(level=Level.STOP)
    shifted = dip._replace(pose=(0.0,), pressure_angle=(*dip.pressure_angle, 0.0), type2_margin=0.005)
    assert len(encode_state(shifted)) == len(encode_state(dip))  # with margins at other places
    for one in (calm, dip, shifted, unknown, calm):
        told.observed.hear_states([encode_state(one)], [told.now_s])
    told.observed.hear_states([encode_state(calm)[:40]], [told.now_s])
    for verdict in (stop, stop._replace(level=Level.OK)):
        told.observed.hear_verdicts([encode_verdict(verdict)], [told.now_s])
    told.observed.hear_states([encode_state(calm)], [told.now_s])
    told.feed.hear(told.observed.look(told.now_s + 0.001), told.now_s + 0.001)
    (row,) = told.answer(known)["rows"]
    assert [row[part][1] for part in (2, 4, 5)] == [0.5, 0.005, 0.5]
    assert row[1] == "STOP"
    assert told.answer(known)["now"]["level"] == "OK"
    told.feed.hear(told.observed.look(told.now_s + 0.002), told.now_s + 0.002)
    assert told.answer(known)["rows"][-1][1] == "OK"


def test_the_reachable_box_holds_the_rest_of_every_stop(run: Recording) -> None:
    """Where the robot stood in the end lies between the corners, in the joints, found by the inverse kinematics."""
    (entry,) = run.journal
    scene = Scene(entry.values, entry.machine)
    stopping = next(v for _log, v in run.verdicts if v.level == Level.STOP)
    state = max((s for s in run.states if s.seen_ns <= stopping.since_ns), key=lambda s: s.seen_ns)
    lines = scene.reachable(state, 0.01)
    assert len(lines) == 4
    mode = run.states[0].working_mode
    joints = np.array([_inverse(scene, pose, mode) for line in lines for pose in line])
    rest = np.array(run.states[-1].joint_position)
    assert np.abs(rest - np.array(state.joint_position)).max() > 0.01
    assert (joints.min(axis=0) - 1e-3 <= rest).all()
    assert (rest <= joints.max(axis=0) + 1e-3).all()
    assert (joints.min(axis=0) < state.joint_position).all()
    middle = 0.5 * (joints.min(axis=0) + joints.max(axis=0))
    assert (np.sign(middle - state.joint_position) == np.sign(state.joint_velocity)).all()  # farther where it moves to
    assert scene.reachable(state._replace(joint_velocity=(float("nan"),) * 2), 0.01) == []


def _inverse(scene: Scene, pose: tuple[float, ...], mode: tuple[int, ...]) -> list[float]:
    from irsbot_kinematics import Robot

    found = [float(q) for q in Robot(scene.mechanism, scene.name).inverse(pose, mode)]
    assert all(map(isfinite, found))
    return found
