"""What a recorded run came to: stops and doubts held against what was expected, rest, silence, and their picture."""

from __future__ import annotations

from pathlib import Path

import pytest
from matplotlib.figure import Figure

from irsbot_msgs_py.records import JointSample, Level, Verdict
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.configuration.loading import read_settings, shipped_values
from irsbot_supervisor.plots import run as picture
from irsbot_supervisor.replay.recording import Recording, SupervisorSession, read_recording
from irsbot_supervisor.replay.run_summary import ExpectedOutcome, Span, outcome, spans_heard
from irsbot_supervisor.sim.closed_loop import cycles, record
from irsbot_supervisor.sim.simulation import simulation_from

CLEAN = ExpectedOutcome(stop=False)


def run(target: Path, scenario: str, seconds: float, faults: str = "") -> Recording:
    settings, robot = read_settings("irsbot2")
    shipped = {key: shipped_values(robot)[key] for key in ("velocity_limit", "deceleration_limit")}
    simulation = simulation_from({**shipped, "rate_hz": 500.0, "scenario": scenario}, robot)
    record(cycles(simulation, robot, settings, faults), seconds, robot, settings, target)
    return read_recording(target)


@pytest.fixture(scope="module")
def stopped(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    return run(tmp_path_factory.mktemp("stopped") / "run.mcap", "workspace_boundary", 1.2)


def test_a_doubt_is_not_called_a_stop(tmp_path: Path) -> None:
    recording = run(tmp_path / "run.mcap", "pick_and_place", 0.5, "nan:count=10,at=0.3")
    assert "was UNKNOWN although the scenario does not expect it" in outcome(recording, CLEAN).fault
    assert outcome(recording, ExpectedOutcome(stop=False, unknown=True)).fault == ""
    assert outcome(recording, ExpectedOutcome(stop=False, unknown=False)).fault.startswith("the state of the robot was")
    assert outcome(recording, ExpectedOutcome(stop=True)).fault == "the robot was not stopped"


def test_an_expected_stop_must_come(tmp_path: Path, stopped: Recording) -> None:
    clean = run(tmp_path / "run.mcap", "pick_and_place", 0.5)
    assert outcome(clean, CLEAN).fault == ""
    assert "was never UNKNOWN" in outcome(clean, ExpectedOutcome(stop=False, unknown=True)).fault
    assert outcome(stopped, CLEAN).fault.startswith("a stop was called although the scenario expects none: Type 1")
    assert outcome(stopped, ExpectedOutcome(stop=True, unknown=False)).fault == ""


def test_the_standstill_is_the_first_rest_after_the_stop(stopped: Recording) -> None:
    stood_ns = outcome(stopped, CLEAN).stood_ns
    assert stood_ns is not None
    states = stopped.states
    (at,) = [number for number, state in enumerate(states) if state.stamp_ns == stood_ns]
    speeds = [max(map(abs, state.joint_velocity)) for state in states]
    assert speeds[at - 1] > 0.02 >= speeds[at]  # the shipped standstill_speed
    assert stood_ns < states[-1].stamp_ns - NS_PER_S // 10
    moved = [*states[:-5], *(state._replace(joint_velocity=(1.0, 1.0)) for state in states[-5:])]
    (session,) = stopped.sessions
    again = SupervisorSession(session.journal, moved, session.verdicts)
    assert outcome(Recording(stopped.path, stopped.samples, [again]), CLEAN).stood_ns == stood_ns


# --- silence ------------------------------------------------------------------------------------------------------


def heard(*words: tuple[float, Level]) -> Recording:
    """Verdicts that a recorder heard in a bag whose first joint state is at 0 s."""
    verdicts = [
        (round(time_s * NS_PER_S), Verdict(0, level, 0, False, 0, (), "", number, "", 0, 1.0, ()))
        for number, (time_s, level) in enumerate(words, 1)
    ]
    sample = JointSample(0, 0, 0, ("a",), (0.0,), (0.0,))
    return Recording(Path("run"), [sample], [SupervisorSession([], [], verdicts)])


def spans(recording: Recording, end_s: float) -> list[tuple[float, float, Level | None]]:
    return [
        (span.begin_ns / NS_PER_S, span.end_ns / NS_PER_S, span.level)
        for span in spans_heard(recording, round(end_s * NS_PER_S))
    ]


def test_a_verdict_counts_for_a_tenth_of_a_second_and_then_there_is_silence() -> None:
    words = [(0.2, Level.OK), (0.25, Level.OK), (0.3, Level.WARN), (18.4, Level.WARN), (18.5, Level.STOP)]
    assert spans(heard(*words), 20.0) == [
        (0.0, 0.2, None),
        (0.2, 0.3, Level.OK),
        (0.3, 0.4, Level.WARN),
        (0.4, 18.4, None),
        (18.4, 18.5, Level.WARN),
        (18.5, 18.6, Level.STOP),
        (18.6, 20.0, None),
    ]


def test_verdicts_before_the_first_joint_state_are_not_shown_and_a_bag_without_verdicts_shows_none() -> None:
    assert spans(heard((-1.0, Level.OK), (-0.05, Level.WARN), (0.04, Level.OK)), 0.1) == [
        (0.0, 0.04, Level.WARN),
        (0.04, 0.1, Level.OK),
    ]
    assert spans_heard(heard(), NS_PER_S) == []


def test_the_picture_names_silence_in_its_legend(
    stopped: Recording, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn: list[list[str]] = []

    def look(figure: Figure, *_: object, **__: object) -> None:
        drawn.append([text.get_text() for axes in figure.axes for text in axes.get_legend().get_texts()])

    monkeypatch.setattr(Figure, "savefig", look)
    picture.draw_run(stopped, outcome(stopped, CLEAN), tmp_path / "run.png")
    (session,) = stopped.sessions
    cut_ns = stopped.begin_ns + NS_PER_S // 5
    lost = [word for word in session.verdicts if not cut_ns < word[0] < cut_ns + NS_PER_S // 2]
    silent = Recording(stopped.path, stopped.samples, [SupervisorSession(session.journal, session.states, lost)])
    picture.draw_run(silent, outcome(silent, CLEAN), tmp_path / "run.png")
    assert "no verdict for 0.1 s: stop" not in drawn[0]
    assert drawn[1].count("no verdict for 0.1 s: stop") == 2  # once per part of the picture
    assert Span(0, 1, None) not in spans_heard(silent, NS_PER_S)
