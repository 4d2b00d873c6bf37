"""Replay of bags with several supervisors: one after another, or side by side."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import pytest
from replayed import copied, faults_of
from typer.testing import CliRunner

from irsbot_msgs_py.records import Cause, JointSample, Level, Tick, Verdict
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.bag.bag import Bag
from irsbot_supervisor.bag.bag_writer import BagWriter
from irsbot_supervisor.bag.errors import BagError
from irsbot_supervisor.bag.journal import Configuration, configured, write_entry
from irsbot_supervisor.cli.app import whole_app
from irsbot_supervisor.configuration.feasibility import settings_from
from irsbot_supervisor.configuration.loading import read_settings
from irsbot_supervisor.core.events import Configure, Event
from irsbot_supervisor.core.supervisor import Supervisor
from irsbot_supervisor.replay.expectation import measures_of
from irsbot_supervisor.replay.recording import read_recording
from irsbot_supervisor.replay.rejudge import judge_again
from irsbot_supervisor.replay.run_summary import ExpectedOutcome, outcome


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


def test_a_supervisor_without_any_joint_state_is_judged(bag: Path, tmp_path: Path) -> None:
    """It was started again, and the robot is off."""
    settings, robot = read_settings("irsbot2")
    samples = read_recording(bag).samples[:100]
    target = tmp_path / "off.mcap"
    with BagWriter(target) as writer:
        for sample in samples:
            writer.add("joint_states", sample, sample.received_ns)
        change = configured(settings, robot, samples[0].received_ns - 1, samples[0].seen_ns - 1)
        active(Supervisor(settings, robot), change, samples, writer)
        begin = Tick(samples[-1].received_ns + NS_PER_S, samples[-1].seen_ns + NS_PER_S)
        ticks = [Tick(begin.received_ns + ms * 10**6, begin.seen_ns + ms * 10**6) for ms in range(10, 300, 10)]
        active(Supervisor(settings, robot), configured(settings, robot, *begin), ticks, writer)
    recording = read_recording(target)
    judged = judge_again(recording)
    assert len(recording.sessions) == 2
    assert faults_of(recording, judged) == {"recorded verdicts": (), "recorded states": ()}
    assert {interval.level for interval in judged.parts[1]} == {Level.UNKNOWN}


def test_runs_of_two_robots_one_after_another_under_one_name_are_refused(bag: Path, tmp_path: Path) -> None:
    target, count = tmp_path / "two.mcap", 0

    def other(record: object) -> object:
        nonlocal count
        if isinstance(record, str) and '"configure"' in record:
            count += 1
            return record.replace('"name": "irsbot2"', '"name": "mine"') if count == 2 else record
        return record

    copied(in_two_activations(bag, tmp_path / "one.mcap", restarted=True), target, other)
    with pytest.raises(BagError, match="irsbot2 and mine"):
        judge_again(read_recording(target))


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
    stated = json.loads(CliRunner().invoke(whole_app(), ["replay", str(target), "--json"]).stdout)["chapters"]
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


@pytest.mark.parametrize("stamp_s", [-1.7e9, -0.1, 1.0])
def test_times_count_from_the_recording_of_a_first_joint_state_whose_stamp_is_wrong(
    stamp_s: float, bag: Path, tmp_path: Path
) -> None:
    """A driver that is not yet synchronised. stamp_s: from the time of its recording."""
    count = 0

    def wrong(record: object) -> object:
        nonlocal count
        if isinstance(record, JointSample):
            count += 1
            if count == 1:
                return record._replace(stamp_ns=record.stamp_ns + round(stamp_s * NS_PER_S))
        return record

    recording = read_recording(copied(bag, tmp_path / "wrong.mcap", wrong))
    assert recording.begin_ns == recording.samples[0].seen_ns == read_recording(bag).samples[0].seen_ns


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
            writer.add(f"/left{entry.topic}", entry.record, entry.log_ns)
            if entry.log_ns < half_ns:
                writer.add(f"/cell/right{entry.topic}", entry.record, entry.log_ns)
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
    assert run.invoke(whole_app(), ["replay", str(side_by_side), "--namespace", "left"]).exit_code == 0
    assert run.invoke(whole_app(), ["replay", str(side_by_side)]).exit_code != 0
    stated = json.loads(run.invoke(whole_app(), ["info", str(side_by_side), "--json"]).stdout)
    named = [(one["namespace"], one["robot"], one["joint_states"]) for one in stated["robots"]]
    assert named == [
        ("/cell/right", "irsbot2", ["/cell/right/joint_states"]),
        ("/left", "irsbot2", ["/left/joint_states"]),
    ]
    assert {one["config_hash"] for one in stated["robots"]} == {read_settings("irsbot2")[0].config_hash}


def test_the_namespace_is_kept_with_the_expectations(side_by_side: Path, tmp_path: Path) -> None:
    run, expected = CliRunner(), tmp_path / "expected.json"
    words = ["replay", str(side_by_side), "--namespace", "left", "--write-expect", str(expected)]
    assert run.invoke(whole_app(), words).exit_code == 0
    stated = json.loads(expected.read_text())
    assert stated.pop("namespace") == "left"
    del stated["draft"]
    expected.write_text(json.dumps({**stated, "namespace": "/cell/right"}))
    right = run.invoke(whole_app(), ["replay", str(side_by_side), "--expect", str(expected)])
    assert right.exit_code == 1
    assert "expected story" in str(right.exception)  # the right one's run is shorter
    expected.write_text(json.dumps({**stated, "namespace": "left"}))
    assert run.invoke(whole_app(), ["replay", str(side_by_side), "--expect", str(expected)]).exit_code == 0


def test_info_prints_the_configuration_of_the_verdicts_of_a_bag(bag: Path) -> None:
    stated = json.loads(CliRunner().invoke(whole_app(), ["info", str(bag), "--json"]).stdout)
    assert stated["config_hash"] == read_settings("irsbot2")[0].config_hash


def test_joint_states_that_were_remapped_belong_to_the_only_supervisor(bag: Path, tmp_path: Path) -> None:
    target = tmp_path / "remapped.mcap"
    with Bag(bag) as opened, BagWriter(target) as writer:
        for entry in opened.records():
            moved = isinstance(entry.record, JointSample)
            writer.add("/drives/states" if moved else f"/{entry.topic}", entry.record, entry.log_ns)
    assert judge_again(read_recording(target)) == judge_again(read_recording(bag))
