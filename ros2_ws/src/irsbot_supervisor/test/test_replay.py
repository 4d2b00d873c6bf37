"""A recorded run judged again: the same twice, and every way in which a recording can differ is named."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Sequence
from pathlib import Path
from xml.etree import ElementTree

import fake_failing_mechanism
import pytest
from command import irsbot
from fake_failing_mechanism import fake_robot_of
from typer.testing import CliRunner

import irsbot_supervisor.replay.stepping
from irsbot_msgs_py.records import Cause, JointSample, Level, SingularityState, Tick, Verdict
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.bag.bag import Bag
from irsbot_supervisor.bag.bag_writer import BagWriter
from irsbot_supervisor.bag.errors import BagError
from irsbot_supervisor.bag.journal import Configuration, configured, write_entry
from irsbot_supervisor.cli.app import app
from irsbot_supervisor.cli.junit import Suite, write_junit
from irsbot_supervisor.configuration.feasibility import settings_from
from irsbot_supervisor.configuration.loading import read_settings, shipped_values
from irsbot_supervisor.core.events import Configure, Event
from irsbot_supervisor.core.supervisor import Supervisor
from irsbot_supervisor.fleet.records import BagCheck
from irsbot_supervisor.replay.comparison import against_recording
from irsbot_supervisor.replay.expectation import measures_of
from irsbot_supervisor.replay.judged import Judged
from irsbot_supervisor.replay.recording import Recording, read_recording
from irsbot_supervisor.replay.rejudge import Assumption, judge_again
from irsbot_supervisor.replay.run_summary import ExpectedOutcome, outcome
from irsbot_supervisor.sim.closed_loop import cycles, record
from irsbot_supervisor.sim.simulation import simulation_from

Change = Callable[[object], object]
SECONDS = 1.0
RATE_HZ = 500.0


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Work with a NaN, silence, a jump that is latched, and a reset that is refused."""
    settings, robot = read_settings("irsbot2")
    shipped = {key: shipped_values(robot)[key] for key in ("velocity_limit", "deceleration_limit")}
    simulation = simulation_from({**shipped, "rate_hz": RATE_HZ}, robot)
    faults = "nan:at=0.27,count=1; drop:at=0.45,lasting=0.1; glitch:by=0.5,at=0.8,lasting=0.1"
    target = tmp_path_factory.mktemp("bag") / "run.mcap"
    record(cycles(simulation, robot, settings, faults, (0.95,)), SECONDS, robot, settings, target)
    return target


def copied(bag: Path, target: Path, change: Change) -> Path:
    """The bag with some of its records changed, or left out where the change returns None."""
    with Bag(bag) as opened, BagWriter(target) as writer:
        for entry in opened.records():
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
    levels = [interval.level for interval in first.intervals]
    assert {Level.OK, Level.UNKNOWN} <= set(levels)
    causes = 0
    for interval in first.intervals:
        causes |= interval.causes
    assert causes & Cause.NONFINITE
    assert causes & Cause.STALE
    assert causes & Cause.BRANCH
    assert first.intervals[-1].latched
    assert (first.unseen, first.missing) == (0, 0)
    assert len(first.levels) == len(recording.states) > 300


def test_an_error_inside_is_judged_unknown_as_in_the_node_and_the_replay_goes_on(
    bag: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recording = read_recording(bag)
    right = judge_again(recording)
    before_the_faults = sorted(sample.position[0] for sample in recording.samples[:130])
    monkeypatch.setattr(fake_failing_mechanism, "FAILS_ABOVE", before_the_faults[80])
    monkeypatch.setattr(
        irsbot_supervisor.replay.stepping, "robot_from_record", lambda record, _files: fake_robot_of(record["name"])
    )
    judged = judge_again(recording)
    assert len(judged.levels) == len(right.levels)
    failed = [interval for interval in judged.intervals if interval.causes & Cause.INTERNAL]
    assert failed
    assert {interval.level for interval in failed} == {Level.UNKNOWN}
    assert "ArithmeticError: a fake error of the mechanism" in failed[0].text
    assert any(interval.since_ns > failed[0].since_ns and interval.level == Level.OK for interval in judged.intervals)
    assert (Level.UNKNOWN, Cause.INTERNAL) in judged.levels.values()
    assert "a fake error of the mechanism" in judged.errors[0]
    checks = faults_of(recording, judged)
    assert checks["errors inside"] == tuple(judged.errors)
    assert checks["recorded states"]
    stated = CliRunner().invoke(app, ["replay", str(bag)])
    assert stated.exit_code == 1
    assert "a fake error of the mechanism" in " ".join(stated.output.split())


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


def test_an_altered_sample_is_named_with_its_consequences(bag: Path, tmp_path: Path) -> None:
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


def test_missing_samples_and_samples_without_a_state_are_counted(bag: Path, tmp_path: Path) -> None:
    seen = {JointSample: 0, SingularityState: 0}

    def lose(record: object) -> object:
        for kind, lost in ((JointSample, 60), (SingularityState, 90)):
            if isinstance(record, kind):
                seen[kind] += 1
                return None if seen[kind] == lost else record
        return record

    judged = judge_again(read_recording(copied(bag, tmp_path / "gap.mcap", lose)))
    assert (judged.missing, judged.unseen) == (2, 1)


def active(supervisor: Supervisor, change: Configuration, events: Sequence[Event], writer: BagWriter) -> None:
    """A supervisor from its activation until it falls silent, as its node publishes it."""
    writer.add("supervisor/journal", write_entry(change), change.received_ns)
    into_force = Configure(change.received_ns, change.seen_ns, settings_from(change.values, supervisor.robot))
    for event in (into_force, *events):
        step = supervisor.step(event)
        if step.state is not None:
            writer.add("supervisor/state", step.state, event.received_ns)
        if step.verdict is not None:
            writer.add("supervisor/verdict", step.verdict, event.received_ns)


def in_two_activations(bag: Path, target: Path, *, restarted: bool, rebooted: bool = False) -> Path:
    """The samples of the first 0.3 s, a gap, and the rest; a jump of the second part is latched in it. restarted: by
    another supervisor with other settings instead of the same one. rebooted: its steady clock begins again, too."""
    settings, robot = read_settings("irsbot2")
    samples = read_recording(bag).samples
    first, gap, second = samples[:150], samples[150:200], samples[200:]
    if rebooted:
        behind_ns = second[0].seen_ns - NS_PER_S
        second = [sample._replace(seen_ns=sample.seen_ns - behind_ns) for sample in second]
    supervisor = Supervisor(settings, robot)
    with BagWriter(target) as writer:
        for sample in samples:
            writer.add("joint_states", sample, sample.received_ns)
        active(supervisor, configured(settings, robot, first[0].received_ns - 1, first[0].seen_ns - 1), first, writer)
        if restarted:
            settings = read_settings("irsbot2", {"dwell_s": 0.02})[0]
            supervisor = Supervisor(settings, robot)
        again = configured(settings, robot, gap[-1].received_ns + 1, second[0].seen_ns - 1)
        active(supervisor, again, second, writer)
    return target


@pytest.mark.parametrize("rebooted", [False, True])
def test_a_bag_with_two_supervisors_one_after_another_is_judged_by_two(
    bag: Path, tmp_path: Path, rebooted: bool
) -> None:
    recording = read_recording(in_two_activations(bag, tmp_path / "b.mcap", restarted=True, rebooted=rebooted))
    judged = judge_again(recording)
    assert faults_of(recording, judged) == {"recorded verdicts": (), "recorded states": ()}
    assert (judged.missing, judged.unseen) == (0, 50)
    assert [len(one.states) for one in recording.sessions] == [150, len(recording.samples) - 200]
    assert [one.journal[0].values["dwell_s"] for one in recording.sessions] == [0.05, 0.02]
    assert len(judged.levels) == len(recording.states) == len(recording.samples) - 50
    assert [part[0].level for part in judged.parts] == [Level.UNKNOWN, Level.UNKNOWN]
    assert judged.parts[1][0].causes == Cause.NO_DATA
    first_end_ns, silence = recording.sessions[0].states[-1].received_ns, judged.parts[0][-1]
    assert (silence.level, silence.since_ns) == (Level.UNKNOWN, first_end_ns + NS_PER_S // 10)  # nobody said anything


def test_a_supervisor_that_goes_on_after_a_pause_is_the_same(bag: Path, tmp_path: Path) -> None:
    recording = read_recording(in_two_activations(bag, tmp_path / "one.mcap", restarted=False))
    judged = judge_again(recording)
    assert faults_of(recording, judged) == {"recorded verdicts": (), "recorded states": ()}
    assert (judged.missing, judged.unseen, len(judged.parts)) == (0, 50, 1)
    assert any(interval.causes & Cause.STALE for interval in judged.intervals)  # the pause is a silence of the joints


def test_a_silence_in_which_a_bag_ends_is_noticed_as_it_was(bag: Path, tmp_path: Path) -> None:
    settings, robot = read_settings("irsbot2")
    samples = read_recording(bag).samples[:100]
    begin, last = samples[0], samples[-1]
    late = [last.seen_ns + step * NS_PER_S // 100 for step in range(1, 10)]
    ticks = [Tick(last.received_ns + seen_ns - last.seen_ns, seen_ns) for seen_ns in late]
    target = tmp_path / "silent.mcap"
    with BagWriter(target) as writer:
        for sample in samples:
            writer.add("joint_states", sample, sample.received_ns)
        change = configured(settings, robot, begin.received_ns - 1, begin.seen_ns - 1)
        active(Supervisor(settings, robot), change, [*samples, *ticks], writer)
    recording = read_recording(target)
    assert recording.verdicts[-1][1].causes & Cause.STALE
    judged = judge_again(recording)
    assert faults_of(recording, judged) == {"recorded verdicts": (), "recorded states": ()}
    assert judged.intervals[-1].causes & Cause.STALE


def test_times_count_from_the_first_joint_state_on_every_clock_and_in_every_output(bag: Path, tmp_path: Path) -> None:
    """The supervisor is active half a second before, and its steady clock has nothing to do with the time of day."""
    settings, robot = read_settings("irsbot2")
    samples = [sample for sample in read_recording(bag).samples if sample.position[0] == sample.position[0]]
    begin_ns, target = samples[0].stamp_ns, tmp_path / "early.mcap"
    with BagWriter(target) as writer:
        for sample in samples:
            writer.add("joint_states", sample, sample.received_ns)
        change = configured(settings, robot, samples[0].received_ns - NS_PER_S // 2, samples[0].seen_ns - NS_PER_S // 2)
        active(Supervisor(settings, robot), change, samples, writer)
    recording = read_recording(target)
    stated = json.loads(CliRunner().invoke(app, ["replay", str(target), "--json"]).stdout)["chapters"]
    found = outcome(recording, ExpectedOutcome(stop=False))
    assert stated[0]["time_s"] == pytest.approx(-0.5)
    assert stated[1]["level"] == "OK"
    assert stated[1]["time_s"] == pytest.approx(
        2.0 * settings.stale_s + settings.dwell_s
    )  # after the first joint state
    assert found.begin_ns == recording.begin_ns == begin_ns
    unknown_ns = next(state.stamp_ns for state in recording.states if state.causes & Cause.IMPLAUSIBLE)
    later = [row for row in stated[2:] if "IMPLAUSIBLE" in row["causes"]]
    assert later[0]["time_s"] == pytest.approx((unknown_ns - begin_ns) / NS_PER_S)
    measured = measures_of(recording, judge_again(recording))
    assert 0.0 < measured["hold_share"] < 1.0


def test_an_altered_verdict_of_the_second_supervisor_is_found(bag: Path, tmp_path: Path) -> None:
    both = in_two_activations(bag, tmp_path / "both.mcap", restarted=True)
    began = 0

    def lie(record: object) -> object:
        nonlocal began
        if isinstance(record, Verdict):
            began += record.sequence == 1
            if began == 2 and record.level == Level.OK:
                return record._replace(level=Level.WARN)
        return record

    recording = read_recording(copied(both, tmp_path / "lie.mcap", lie))
    faults = faults_of(recording, judge_again(recording))
    assert faults["recorded states"] == ()
    assert "recorded WARN" in faults["recorded verdicts"][0]


@pytest.fixture(scope="module")
def side_by_side(bag: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two robots of a kind in one bag: the one on the right does for half a second what the left one does."""
    target = tmp_path_factory.mktemp("bag") / "two.mcap"
    half_ns = read_recording(bag).samples[0].received_ns + NS_PER_S // 2
    with Bag(bag) as opened, BagWriter(target) as writer:
        for entry in opened.records():
            writer.add(f"/left/{entry.topic}", entry.record, entry.log_ns)
            if entry.log_ns < half_ns:
                writer.add(f"/cell/right/{entry.topic}", entry.record, entry.log_ns)
    return target


def test_each_of_several_robots_in_a_bag_is_judged_as_if_it_were_alone(bag: Path, side_by_side: Path) -> None:
    with pytest.raises(BagError, match=r"namespaces /cell/right, /left; choose one with --namespace"):
        read_recording(side_by_side)
    with pytest.raises(BagError, match=r"no robot in the namespace /middle; there are robots in /cell/right, /left"):
        read_recording(side_by_side, "middle")
    left, right = read_recording(side_by_side, "left"), read_recording(side_by_side, "/cell/right/")
    assert judge_again(left) == judge_again(read_recording(bag))
    assert len(right.samples) < len(left.samples) == len(read_recording(bag).samples)
    assert faults_of(right, judge_again(right)) == {"recorded verdicts": (), "recorded states": ()}


def test_the_command_takes_the_namespace_and_info_lists_them(side_by_side: Path) -> None:
    run = CliRunner()
    assert run.invoke(app, ["replay", str(side_by_side), "--namespace", "left"]).exit_code == 0
    assert run.invoke(app, ["replay", str(side_by_side)]).exit_code != 0
    stated = json.loads(run.invoke(app, ["info", str(side_by_side), "--json"]).stdout)
    named = [(one["namespace"], one["robot"], one["joint_states"]) for one in stated["robots"]]
    assert named == [
        ("/cell/right", "irsbot2", ["/cell/right/joint_states"]),
        ("/left", "irsbot2", ["/left/joint_states"]),
    ]
    assert {one["config_hash"] for one in stated["robots"]} == {read_settings("irsbot2")[0].config_hash}


def test_the_namespace_is_kept_with_the_expectations(side_by_side: Path, tmp_path: Path) -> None:
    run, expected = CliRunner(), tmp_path / "expected.json"
    words = ["replay", str(side_by_side), "--namespace", "left", "--write-expect", str(expected)]
    assert run.invoke(app, words).exit_code == 0
    stated = json.loads(expected.read_text())
    assert stated.pop("namespace") == "left"
    del stated["draft"]
    expected.write_text(json.dumps({**stated, "namespace": "/cell/right"}))
    right = run.invoke(app, ["replay", str(side_by_side), "--expect", str(expected)])
    assert right.exit_code == 1
    assert "expected story" in str(right.exception)  # the right one's run is shorter
    expected.write_text(json.dumps({**stated, "namespace": "left"}))
    assert run.invoke(app, ["replay", str(side_by_side), "--expect", str(expected)]).exit_code == 0


def test_info_prints_the_configuration_of_the_verdicts_of_a_bag(bag: Path) -> None:
    stated = json.loads(CliRunner().invoke(app, ["info", str(bag), "--json"]).stdout)
    assert stated["config_hash"] == read_settings("irsbot2")[0].config_hash


def test_joint_states_that_were_remapped_belong_to_the_only_supervisor(bag: Path, tmp_path: Path) -> None:
    target = tmp_path / "remapped.mcap"
    with Bag(bag) as opened, BagWriter(target) as writer:
        for entry in opened.records():
            moved = isinstance(entry.record, JointSample)
            writer.add("/drives/states" if moved else f"/{entry.topic}", entry.record, entry.log_ns)
    assert judge_again(read_recording(target)) == judge_again(read_recording(bag))


@pytest.mark.parametrize("share", [0.4, 0.6, 0.8])
def test_a_truncated_bag_is_judged_up_to_its_end_and_the_loss_is_reported(
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
    assert [one.same_as(two) for one, two in zip(judged.intervals, whole.intervals, strict=False)].count(False) == 0


def samples_of(bag: Path, target: Path) -> Path:
    """The joint states of a bag alone."""
    return copied(bag, target, lambda record: record if isinstance(record, JointSample) else None)


def test_a_bag_of_joint_states_alone_is_judged_with_the_settings_of_the_given_robot(bag: Path, tmp_path: Path) -> None:
    recording = read_recording(samples_of(bag, tmp_path / "alone.mcap"))
    assert not recording.states
    with pytest.raises(BagError, match="--robot NAME"):
        judge_again(recording)
    judged = judge_again(recording, Assumption("irsbot2"))
    assert against_recording(recording, judged) == []
    again = [interval.level for interval in judged.intervals]
    assert Level.OK in again
    assert again[-1] == Level.UNKNOWN


def test_given_settings_count_only_for_a_bag_of_joint_states_alone(bag: Path, tmp_path: Path) -> None:
    recording = read_recording(samples_of(bag, tmp_path / "alone.mcap"))
    first_work = {}
    for dwell_s in (0.05, 0.1):
        intervals = judge_again(recording, Assumption("irsbot2", {"dwell_s": dwell_s})).intervals
        first_work[dwell_s] = next(interval.since_ns for interval in intervals if interval.level == Level.OK)
    assert first_work[0.1] - first_work[0.05] == pytest.approx(0.05 * NS_PER_S)
    with pytest.raises(BagError, match=r"nonsense"):
        judge_again(recording, Assumption("irsbot2", {"nonsense": 1}))
    with pytest.raises(BagError, match="robot"):
        judge_again(read_recording(bag), Assumption("irsbot2"))


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
    story = BagCheck("expected story", 2, ("first <&>", "second"))
    write_junit(report, [Suite("run", [BagCheck("recorded verdicts", 0, ()), story])])
    suite = ElementTree.parse(report).getroot()
    assert (suite.get("name"), suite.get("tests"), suite.get("failures")) == ("run", "2", "1")
    good, bad = suite.findall("testcase")
    assert good.find("failure") is None
    failure = bad.find("failure")
    assert failure is not None
    assert (failure.get("message"), failure.text) == ("first <&>", "first <&>\nsecond")


def test_a_replay_that_cannot_be_made_is_an_error_in_the_report(bag: Path, tmp_path: Path) -> None:
    expectation, report = tmp_path / "story.json", tmp_path / "report.xml"
    expectation.write_text("no story")
    done = irsbot("replay", bag, "--expect", expectation, "--junit", report)
    assert done.code == 2
    suite = ElementTree.parse(report).getroot()
    assert (suite.get("name"), suite.get("tests"), suite.get("errors")) == (str(bag), "1", "1")
    error = suite.find("testcase/error")
    assert error is not None
    assert done.refusal == f"irsbot: {error.get('message')}"


def test_every_report_is_named_after_its_bag(bag: Path, tmp_path: Path) -> None:
    report = tmp_path / "report.xml"
    assert irsbot("replay", bag, "--junit", report).code == 0
    assert ElementTree.parse(report).getroot().get("name") == str(bag)


PRR3 = Path(__file__).parents[4] / "docs" / "examples" / "prr3"


@pytest.fixture
def bag_of_an_own_mechanism(tmp_path: Path) -> Path:
    """Its class lay in a folder that is not there any more."""
    there = tmp_path / "there"
    shutil.copytree(PRR3, there)
    settings, robot = read_settings(str(there / "prr3.yaml"))
    shipped = {key: shipped_values(robot)[key] for key in ("velocity_limit", "deceleration_limit")}
    simulation = simulation_from({**shipped, "rate_hz": RATE_HZ, "scenario": str(there / "approach.yaml")}, robot)
    target = tmp_path / "bags" / "run" / "run.mcap"
    target.parent.mkdir(parents=True)
    record(cycles(simulation, robot, settings), 0.2, robot, settings, target)
    shutil.rmtree(there)
    return target.parent


@pytest.mark.parametrize("place", ["bags/run", "bags", "elsewhere"])
def test_a_bag_finds_the_file_of_its_mechanism_by_its_hash(
    bag_of_an_own_mechanism: Path, tmp_path: Path, place: str
) -> None:
    assert "is not there any more" in irsbot("replay", bag_of_an_own_mechanism).refusal
    (tmp_path / place).mkdir(exist_ok=True)
    file = tmp_path / place / "renamed.py"
    source = (PRR3 / "prr3.py").read_text()
    told = ["--mechanism", file] if place == "elsewhere" else []
    file.write_text("raise RuntimeError('a file of another hash is never run')\n" + source)
    refused = irsbot("replay", bag_of_an_own_mechanism, *told)
    assert (refused.code, "none of 1 other files is it" in refused.refusal) == (2, True)
    file.write_text(source)
    assert irsbot("replay", bag_of_an_own_mechanism, *told).code == 0
    assert irsbot("report", bag_of_an_own_mechanism, *told, "-o", tmp_path / "run.html").code == 0


def test_the_given_robot_is_kept_with_the_expectations(bag: Path, tmp_path: Path) -> None:
    alone = str(samples_of(bag, tmp_path / "alone.mcap"))
    limits, expected = tmp_path / "limits.yaml", tmp_path / "expected.json"
    limits.write_text("dwell_s: 0.1")
    run = CliRunner()
    nothing = run.invoke(app, ["replay", alone])
    assert nothing.exit_code != 0
    assert "--robot NAME" in str(nothing.exception)
    words = ["replay", alone, "--robot", "irsbot2", "--settings", str(limits), "--write-expect", str(expected)]
    assert run.invoke(app, words).exit_code == 0
    stated = json.loads(expected.read_text())
    assert (stated["robot"], stated["settings"]) == ("irsbot2", {"dwell_s": 0.1})
    del stated["draft"]
    expected.write_text(json.dumps(stated))
    again = run.invoke(app, ["replay", alone])  # finds its expectations beside it
    assert again.exit_code == 0, again.exception
    assert "robot: irsbot2 with other settings" in again.stdout
    other = run.invoke(app, ["replay", alone, "--robot", "irsbot2_beta45"])
    assert other.exit_code == 1
    assert "robot: irsbot2_beta45 with its shipped settings" in other.stdout


def test_the_command_fails_with_the_first_difference_from_an_expectation_file(bag: Path, tmp_path: Path) -> None:
    expectation, report = tmp_path / "story.json", tmp_path / "report.xml"
    expectation.write_text(json.dumps({"story": [{"level": "UNKNOWN"}, {"level": "STOP"}]}))
    assert CliRunner().invoke(app, ["replay", str(bag), "--json"]).exit_code == 0
    words = ["replay", str(bag), "--expect", str(expectation), "--junit", str(report), "--json"]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 1
    assert "expected story" in str(done.exception)
    rows = json.loads(done.stdout)["checks"]
    assert [row["name"] for row in rows if row["faults"]] == ["expected story"]
    assert ElementTree.parse(report).getroot().get("failures") == "1"


def test_the_page_of_a_run_shows_settings_with_units_and_the_origin_of_times(bag: Path, tmp_path: Path) -> None:
    page = tmp_path / "run.html"
    assert CliRunner().invoke(app, ["report", str(bag), "-o", str(page)]).exit_code == 0
    text = page.read_text()
    assert "<tr><td>stale_s</td><td>0.05</td><td>s</td></tr>" in text
    assert "<tr><td>payload_kg</td><td>0.0</td><td>kg</td></tr>" in text
    assert "Times count from the first joint state" in text
