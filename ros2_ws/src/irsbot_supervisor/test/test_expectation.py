"""Expectation files: what they bound, what is refused, and what a run is measured by."""

from __future__ import annotations

import json
from math import inf, isnan
from pathlib import Path

import pytest

from irsbot_msgs_py.records import Cause, JointSample, Level
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.bag.errors import BagError
from irsbot_supervisor.configuration.loading import read_settings
from irsbot_supervisor.replay.comparison import against_expectation
from irsbot_supervisor.replay.expectation import MEASURES, Expectation, measures_of, read_expectation, write_draft
from irsbot_supervisor.replay.judged import Interval, Judged
from irsbot_supervisor.replay.recording import Recording
from irsbot_supervisor.replay.rejudge import Assumption

NAMES = ("a", "b")
SETTINGS = read_settings("irsbot2", {"joint_names": NAMES})[0]


def interval(time_s: float, level: Level, causes: Cause = Cause.NONE) -> Interval:
    return Interval(round(time_s * NS_PER_S), level, int(causes), False, 0, "")


def recording_of(speeds: list[float], period_s: float = 0.1) -> Recording:
    """A recording of joint states alone, one per period; joint `b` moves."""
    times = [round(k * period_s * NS_PER_S) for k in range(len(speeds))]
    samples = [JointSample(ns, ns, ns, NAMES, (0.0, 0.0), (0.0, v)) for ns, v in zip(times, speeds, strict=True)]
    return Recording(Path("run"), samples=samples)


def judged_of(*intervals: Interval) -> Judged:
    return Judged([list(intervals)], {}, 0, 0, settings=[(0, SETTINGS)])


START = interval(0.0, Level.UNKNOWN, Cause.NO_DATA)
RUN = recording_of([0.0, 2.0, 2.0, 2.0, 1.0, 0.01, 0.0, 0.0, 0.0, 2.0, 2.0])
"""Moves from 0.1 s, brakes at 0.3 s, stands (below 0.02) from 0.5 s, moves again; ends at 1.0 s."""
JUDGED = judged_of(
    START,
    interval(0.1, Level.OK),
    interval(0.2, Level.WARN, Cause.TYPE2),
    interval(0.3, Level.STOP, Cause.TYPE2),
    interval(0.35, Level.STOP, Cause.TYPE2 | Cause.LATCHED),
    interval(0.5, Level.UNKNOWN, Cause.STALE),
    interval(0.8, Level.OK),
)


def story_of(tmp_path: Path, stated: object) -> Expectation:
    file = tmp_path / "expected.json"
    file.write_text(stated if isinstance(stated, str) else json.dumps(stated))
    return read_expectation(file)


def faults(tmp_path: Path, stated: object, run: Recording = RUN, judged: Judged = JUDGED) -> list[str]:
    return [fault for check in against_expectation(run, judged, story_of(tmp_path, stated)) for fault in check.faults]


# --- measures ---------------------------------------------------------------------------------------------------


def test_a_run_is_measured_from_the_moment_in_which_work_began():
    found = measures_of(RUN, JUDGED)
    assert found["time_to_stop_s"] == pytest.approx(0.5 - 0.3)
    assert found["hold_share"] == pytest.approx((0.8 - 0.3) / (1.0 - 0.1))
    assert found["time_to_resume_s"] == pytest.approx(0.8 - 0.3)  # STOP that becomes UNKNOWN is one halt
    assert found["false_stops"] == 2.0


def test_expected_stops_do_not_count_as_false_stops(tmp_path):
    told = [{"level": level} for level in ("UNKNOWN", "OK", "WARN", "STOP")]
    assert measures_of(RUN, JUDGED, story_of(tmp_path, {"story": told}))["false_stops"] == 1.0


def test_a_run_without_a_stop_has_no_time_to_stop_and_a_robot_that_never_stands_has_an_infinite_one():
    fine = measures_of(RUN, judged_of(START, interval(0.1, Level.OK)))
    assert isnan(fine["time_to_stop_s"])
    assert isnan(fine["time_to_resume_s"])
    assert (fine["hold_share"], fine["false_stops"]) == (0.0, 0.0)
    moving = recording_of([0.0, 2.0, 2.0, 2.0, 2.0])
    stopped = judged_of(START, interval(0.1, Level.OK), interval(0.2, Level.STOP, Cause.TYPE1))
    assert measures_of(moving, stopped)["time_to_stop_s"] == inf
    assert isnan(measures_of(moving, judged_of(START))["hold_share"])


def test_velocities_that_are_none_do_not_count_as_standing():
    lost = recording_of([0.0, 2.0, 2.0, float("nan"), 0.0])
    stopped = judged_of(START, interval(0.1, Level.OK), interval(0.25, Level.UNKNOWN, Cause.NONFINITE))
    assert measures_of(lost, stopped)["time_to_stop_s"] == pytest.approx(0.4 - 0.25)


def test_the_joints_of_the_robot_stand_by_its_own_settings():
    """A conveyor runs on, and a gripper with a message of its own has stood all the time."""
    samples = [
        message
        for one in RUN.samples
        for message in (
            one._replace(names=("conveyor", *NAMES), position=(0.0, 0.0, 0.0), velocity=(1.0, *one.velocity)),
            one._replace(names=("gripper",), position=(0.0,), velocity=(0.0,)),
        )
    ]
    run = Recording(Path("run"), samples=samples)
    assert measures_of(run, JUDGED)["time_to_stop_s"] == pytest.approx(0.5 - 0.3)
    for speed, stands_s in ((0.005, 0.6), (1.5, 0.4)):
        judged = judged_of(*JUDGED.intervals)
        judged.settings = [(0, read_settings("irsbot2", {"joint_names": NAMES, "standstill_speed": speed})[0])]
        assert measures_of(run, judged)["time_to_stop_s"] == pytest.approx(stands_s - 0.3)


# --- what differs -----------------------------------------------------------------------------------------------

STORY = [
    {"level": "UNKNOWN", "causes": ["NO_DATA"], "since_s": 0},
    {"level": "OK", "since_s": [0.05, 0.15]},
    {"level": "WARN", "optional": True},
    {"level": "STOP", "causes": ["TYPE2", "LATCHED"], "since_s": [0.25, 0.3]},
    {"level": "UNKNOWN"},
    {"level": "OK"},
]


def test_a_run_that_meets_its_expectation_has_no_faults(tmp_path):
    measures = {"time_to_stop_s": [0.1, 0.2], "hold_share": [0.5, 0.6], "time_to_resume_s": 0.5, "false_stops": 0}
    assert faults(tmp_path, {"story": STORY, **measures}) == []


def test_an_optional_level_may_be_missing_and_no_other(tmp_path):
    without = judged_of(*[entry for entry in JUDGED.intervals if entry.level != Level.WARN])
    assert faults(tmp_path, {"story": STORY}, judged=without) == []
    strict = [{k: v for k, v in entry.items() if k != "optional"} for entry in STORY]
    assert "expected UNKNOWN, OK, WARN, STOP" in faults(tmp_path, {"story": strict}, judged=without)[0]
    late = [*STORY[:3], {**STORY[3], "since_s": [0.0, 0.1]}, *STORY[4:]]
    assert "story[3] (STOP) begins" in faults(tmp_path, {"story": late}, judged=without)[0]  # the number in the file
    shorter = judged_of(*JUDGED.intervals[:-1])
    assert "expected" in faults(tmp_path, {"story": STORY}, judged=shorter)[0]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"level": "WARN"}, "story[3] at 0.300 s is STOP, expected WARN"),
        ({"causes": ["TYPE1"]}, "story[3] has TYPE2, LATCHED, expected TYPE1"),
        ({"since_s": [0.25, 0.29]}, "begins at 0.300 s, expected 0.25 to 0.29"),
        ({"since_s": [0.31, 0.4]}, "begins at 0.300 s"),
    ],
)
def test_a_difference_of_a_run_is_named_with_its_interval(change, words, tmp_path):
    expectation = [*STORY[:3], {**STORY[3], **change}, *STORY[4:]]
    assert words in faults(tmp_path, {"story": expectation})[0]


@pytest.mark.parametrize(
    "measure",
    [{"time_to_stop_s": [0.0, 0.19]}, {"hold_share": 0}, {"time_to_resume_s": [0.51, 9]}, {"false_stops": [0, 1]}],
)
def test_a_measure_out_of_its_bounds_is_named_with_its_meaning(measure, tmp_path):
    (name,) = measure
    stated = faults(tmp_path, measure)[0]
    assert stated.startswith(f"{name} is ")
    assert MEASURES[name] in stated


def test_a_measure_that_a_run_does_not_have_is_out_of_any_bounds(tmp_path):
    fine = judged_of(START, interval(0.1, Level.OK))
    assert "time_to_stop_s is nan" in faults(tmp_path, {"time_to_stop_s": [0, 1e9]}, judged=fine)[0]


# --- files ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("stated", "words"),
    [
        ("{", "not JSON"),
        pytest.param("[" * 100_000, "not JSON: brackets are nested too deeply", id="deep"),
        ("[]", "must be a mapping"),
        ("{}", "nothing is expected"),
        ({"storey": []}, "unknown key 'storey'"),
        ({"story": {}}, "story must be a list"),
        ({"story": ["OK"]}, "story[0] must be a mapping"),
        ({"story": [{"level": "FINE"}]}, "story[0].level must be one of OK, WARN, STOP, UNKNOWN"),
        ({"story": [{"level": "OK"}, {"causes": []}]}, "story[1].level"),
        ({"story": [{"level": "OK", "cause": []}]}, "unknown key 'cause'"),
        ({"story": [{"level": "OK", "causes": "TYPE1"}]}, "story[0].causes"),
        ({"story": [{"level": "OK", "causes": ["TYPE9"]}]}, "story[0].causes"),
        ({"story": [{"level": ["OK"]}]}, "story[0].level must be one of"),
        ({"story": [{"level": "OK", "causes": [["TYPE1"]]}]}, "story[0].causes must be a list of"),
        ({"false_stops": 10**400}, "false_stops must be"),
        ({"story": [{"level": "OK", "since_s": [1]}]}, "story[0].since_s must be [low, high]"),
        ({"story": [{"level": "OK", "since_s": [2, 1]}]}, "low not above high"),
        ({"story": [{"level": "OK", "since_s": "1"}]}, "story[0].since_s"),
        ({"story": [{"level": "OK", "optional": 1}]}, "story[0].optional"),
        ({"hold_share": [True, 1]}, "hold_share must be"),
        ({"story": []}, "story is empty"),
        ({"false_stops": -1}, "false_stops is never negative, got -1"),
        ({"hold_share": [-0.5, 1]}, "hold_share is never negative"),
        ({"false_stops": 0, "namespace": 5}, "namespace must be a namespace of the bag, got 5"),
        ({"false_stops": 0, "topic": 5}, "topic must be a topic of the bag, got 5"),
        ({"false_stops": 0, "robot": 5}, "robot must be the name"),
        ({"false_stops": 0, "robot": "irsbot2", "settings": []}, "settings must be a mapping"),
        ({"false_stops": 0, "settings": {"dwell_s": 1}}, "settings need robot"),
        ('{"hold_share": [NaN, 1]}', "low not above high"),
    ],
)
def test_an_invalid_expectation_is_refused_in_one_line_with_the_place(stated, words, tmp_path):
    with pytest.raises(BagError) as caught:
        story_of(tmp_path, stated)
    assert words in str(caught.value)
    assert "expected.json" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_file_that_is_not_there_is_refused(tmp_path):
    with pytest.raises(BagError, match="No such file"):
        read_expectation(tmp_path / "expected.json")


def test_the_path_of_a_robot_is_relative_to_the_file_that_names_it(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    draft, file = tmp_path / "bag" / "expected.json", tmp_path / "robots" / "mine.yaml"
    draft.parent.mkdir()
    for robot, stated in (("robots/mine.yaml", "../robots/mine.yaml"), (str(file), "../robots/mine.yaml")):
        write_draft(RUN, JUDGED, draft, Assumption(robot))
        assert json.loads(draft.read_text())["robot"] == stated
        with monkeypatch.context() as elsewhere:
            elsewhere.chdir("/")
            assert Path(read_expectation(draft).assumption.robot).resolve() == file
        draft.unlink()
    write_draft(RUN, JUDGED, draft, Assumption("irsbot2"))
    assert read_expectation(draft).assumption.robot == "irsbot2"


def test_a_draft_has_the_findings_and_fails(tmp_path):
    file = tmp_path / "expected.json"
    write_draft(RUN, JUDGED, file)
    expectation = read_expectation(file)
    assert "person has to read" in against_expectation(RUN, JUDGED, expectation)[0].faults[0]
    stated = json.loads(file.read_text())
    del stated["draft"]
    assert faults(tmp_path, stated) == []
    assert [entry["level"] for entry in stated["story"]] == ["UNKNOWN", "OK", "WARN", "STOP", "UNKNOWN", "OK"]
    with pytest.raises(BagError, match="never replaced"):
        write_draft(RUN, JUDGED, file)
