"""A recorded run judged again: the same twice, and every way in which a recording can differ is named."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import pytest
from typer.testing import CliRunner

from irsbot_msgs_py.records import Cause, JointSample, Level, SingularityState, Verdict
from irsbot_supervisor.cli.app import app
from irsbot_supervisor.cli.replay import write_junit
from irsbot_supervisor.closed_loop import cycles, record
from irsbot_supervisor.mcap_writer import BagError
from irsbot_supervisor.replay import Judged, Recording, judge_again, read_recording
from irsbot_supervisor.settings_file import read_settings, shipped_values
from irsbot_supervisor.sim.simulation import simulation_from
from irsbot_supervisor.tape import Tape, TapeWriter
from irsbot_supervisor.verify import Check, against_recording

Change = Callable[[object], object]
SECONDS = 0.8
RATE_HZ = 500.0


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Work with a NaN, silence, a jump that is latched, and a reset that is refused."""
    settings, robot = read_settings("irsbot2")
    shipped = {key: shipped_values(robot)[key] for key in ("velocity_limit", "deceleration_limit")}
    simulation = simulation_from({**shipped, "rate_hz": RATE_HZ}, robot)
    faults = "nan:at=0.2,count=1; drop:at=0.35,lasting=0.1; glitch:by=0.5,at=0.6,lasting=0.1"
    target = tmp_path_factory.mktemp("bag") / "run.mcap"
    record(cycles(simulation, robot, settings, faults, (0.75,)), SECONDS, robot, settings, target)
    return target


def copied(bag: Path, target: Path, change: Change) -> Path:
    """The bag with some of its records changed, or left out where the change returns None."""
    with Tape(bag) as tape, TapeWriter(target) as writer:
        for entry in tape.records():
            record = change(entry.record)
            if record is not None:
                writer.add(entry.topic, record, entry.log_ns)
    return target


def faults_of(recording: Recording, judged: Judged) -> dict[str, tuple[str, ...]]:
    return {check.name: check.faults for check in against_recording(recording, judged)}


def test_a_run_is_judged_as_it_was_and_the_same_twice(bag: Path) -> None:
    recording = read_recording(bag)
    first, second = judge_again(recording), judge_again(recording)
    assert first == second == judge_again(read_recording(bag))
    assert faults_of(recording, first) == {"recorded verdicts": (), "recorded states": ()}
    levels = [chapter.level for chapter in first.chapters]
    assert {Level.OK, Level.UNKNOWN} <= set(levels)
    causes = 0
    for chapter in first.chapters:
        causes |= chapter.causes
    assert causes & Cause.NONFINITE
    assert causes & Cause.STALE
    assert causes & Cause.BRANCH
    assert first.chapters[-1].latched
    assert (first.unseen, first.missing) == (0, 0)
    assert len(first.levels) == len(recording.states) > 300


def test_an_altered_verdict_is_named_with_its_number_and_its_sample(bag: Path, tmp_path: Path) -> None:
    altered: list[Verdict] = []

    def lie(record: object) -> object:
        if isinstance(record, Verdict) and record.level == Level.OK and record.sequence > 20 and not altered:
            altered.append(record)
            return record._replace(level=Level.WARN)
        return record

    recording = read_recording(copied(bag, tmp_path / "lie.mcap", lie))
    faults = faults_of(recording, judge_again(recording))
    assert faults["recorded states"] == ()
    (fault,) = faults["recorded verdicts"]
    assert f"verdict {altered[0].sequence} at sample stamped {altered[0].stamp_ns / 1e9:.6f}" in fault
    assert "recorded WARN" in fault
    assert "judged again OK" in fault


def test_an_altered_sample_is_named_and_so_is_what_followed_from_it(bag: Path, tmp_path: Path) -> None:
    target, seen = 150, 0

    def lie(record: object) -> object:
        nonlocal seen
        if isinstance(record, JointSample):
            seen += 1
            if seen == target:
                return record._replace(position=(float("nan"), *record.position[1:]))
        return record

    recording = read_recording(copied(bag, tmp_path / "lie.mcap", lie))
    faults = faults_of(recording, judge_again(recording))
    assert f"sample {target} stamped" in faults["recorded states"][0]
    assert "judged again UNKNOWN (NONFINITE)" in faults["recorded states"][0]
    assert len(faults["recorded states"]) == 1


def test_samples_that_the_bag_lacks_are_counted_and_so_are_those_that_nobody_judged(bag: Path, tmp_path: Path) -> None:
    seen = {JointSample: 0, SingularityState: 0}

    def lose(record: object) -> object:
        for kind, lost in ((JointSample, 60), (SingularityState, 90)):
            if isinstance(record, kind):
                seen[kind] += 1
                return None if seen[kind] == lost else record
        return record

    judged = judge_again(read_recording(copied(bag, tmp_path / "gap.mcap", lose)))
    assert (judged.missing, judged.unseen) == (2, 1)


@pytest.mark.parametrize("share", [0.4, 0.6, 0.8])
def test_a_bag_that_is_cut_off_is_judged_as_far_as_it_goes_and_the_loss_is_said(
    bag: Path, tmp_path: Path, share: float
) -> None:
    data = bag.read_bytes()
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(data[: round(share * len(data))])
    whole = judge_again(read_recording(bag))
    recording = read_recording(cut)
    judged = judge_again(recording)
    assert 50 < len(judged.levels) < len(whole.levels)
    assert recording.loss
    assert judged.levels.items() <= whole.levels.items()
    assert [one.same_as(two) for one, two in zip(judged.chapters, whole.chapters, strict=False)].count(False) == 0


def test_a_bag_of_joint_states_alone_is_judged_with_the_shipped_settings(bag: Path, tmp_path: Path) -> None:
    alone = copied(bag, tmp_path / "alone.mcap", lambda record: record if isinstance(record, JointSample) else None)
    recording = read_recording(alone)
    assert not recording.states
    judged = judge_again(recording)
    assert against_recording(recording, judged) == []
    again = [chapter.level for chapter in judged.chapters]
    assert Level.OK in again
    assert again[-1] == Level.UNKNOWN


def test_a_bag_without_joint_states_is_refused(bag: Path, tmp_path: Path) -> None:
    empty = copied(bag, tmp_path / "none.mcap", lambda record: None if isinstance(record, JointSample) else record)
    with pytest.raises(BagError, match="no joint states"):
        read_recording(empty)


def test_settings_that_this_version_cannot_use_are_refused(bag: Path, tmp_path: Path) -> None:
    def spoil(record: object) -> object:
        return record.replace('"type1_stop": 0.15', '"type1_stop": 7.0') if isinstance(record, str) else record

    recording = read_recording(copied(bag, tmp_path / "old.mcap", spoil))
    with pytest.raises(BagError, match=r"type1_stop is 7\.0"):
        judge_again(recording)


# --- the command ------------------------------------------------------------------------------------------------


def test_the_report_has_one_case_per_check_and_names_every_difference(tmp_path: Path) -> None:
    report = tmp_path / "report.xml"
    write_junit(report, "run", [Check("recorded verdicts", ()), Check("expected story", ("first <&>", "second"))])
    suite = ElementTree.parse(report).getroot()
    assert (suite.get("name"), suite.get("tests"), suite.get("failures")) == ("run", "2", "1")
    good, bad = suite.findall("testcase")
    assert good.find("failure") is None
    failure = bad.find("failure")
    assert failure is not None
    assert (failure.get("message"), failure.text) == ("first <&>", "first <&>\nsecond")


def test_the_command_fails_with_the_first_difference_from_an_expectation_file(bag: Path, tmp_path: Path) -> None:
    story, report = tmp_path / "story.json", tmp_path / "report.xml"
    story.write_text(json.dumps({"story": [{"level": "UNKNOWN"}, {"level": "STOP"}]}))
    assert CliRunner().invoke(app, ["replay", str(bag), "--json"]).exit_code == 0
    words = ["replay", str(bag), "--expect", str(story), "--junit", str(report), "--json"]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 1
    assert "expected story" in str(done.exception)
    rows = json.loads(done.stdout)["checks"]
    assert [row["name"] for row in rows if row["faults"]] == ["expected story"]
    assert ElementTree.parse(report).getroot().get("failures") == "1"
