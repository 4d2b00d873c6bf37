"""A recorded run judged again: the same twice, and every way in which a recording can differ is named."""

from __future__ import annotations

import json
from pathlib import Path

import fake_failing_mechanism
import pytest
from fake_failing_mechanism import fake_robot_of
from replayed import copied, faults_of, samples_of
from typer.testing import CliRunner

import irsbot_supervisor.replay.stepping
from irsbot_msgs_py.records import Cause, JointSample, Level, SingularityState, Verdict
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.bag.bag import Bag
from irsbot_supervisor.bag.bag_writer import BagWriter
from irsbot_supervisor.bag.errors import BagError
from irsbot_supervisor.bag.journal import read_entry, write_entry
from irsbot_supervisor.cli.app import whole_app
from irsbot_supervisor.replay.comparison import against_recording
from irsbot_supervisor.replay.recording import read_recording
from irsbot_supervisor.replay.rejudge import Assumption, judge_again

START_NS = 1_700_000_000 * NS_PER_S


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
    stated = CliRunner().invoke(whole_app(), ["replay", str(bag)])
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


def test_samples_without_a_state_are_judged_at_times_between_those_of_their_neighbours(
    bag: Path, tmp_path: Path
) -> None:
    """Two of three states are gone, as at a high rate: not those that change the verdict or precede a silence."""
    whole = read_recording(bag)
    right = judge_again(whole)
    told = {verdict.since_ns for _log, verdict in whole.verdicts}
    silences = [a.seen_ns for a, b in zip(whole.states, whole.states[1:], strict=False) if b.seen_ns > a.seen_ns + 2e7]
    kept = {whole.states[0].seen_ns, whole.states[-1].seen_ns, *told, *silences}
    gone = 0

    def lose(record: object) -> object:
        nonlocal gone
        if isinstance(record, SingularityState) and record.sequence % 3 and record.seen_ns not in kept:
            gone += 1
            return None
        return record

    few = read_recording(copied(bag, tmp_path / "few.mcap", lose))
    judged = judge_again(few)
    assert gone > 0.5 * len(whole.states)
    assert (judged.missing, judged.unseen, judged.between) == (0, 0, gone)
    assert judged.levels.items() == right.levels.items()
    assert faults_of(few, judged) == {"recorded verdicts": (), "recorded states": ()}


def test_of_more_samples_than_were_received_between_two_states_the_newest_are_judged(bag: Path, tmp_path: Path) -> None:
    """Ten states are gone, and the supervisor counted nine: it had skipped a sample."""

    def lose(record: object) -> object:
        if not isinstance(record, SingularityState) or record.sequence <= 60:
            return record
        return None if record.sequence <= 70 else record._replace(sequence=record.sequence - 1)

    whole = read_recording(bag)
    watched: list[SingularityState] = []
    few = read_recording(copied(bag, tmp_path / "skipped.mcap", lose))
    judged = judge_again(few, watch=lambda _part, _now_ns, state: watched.append(state))
    assert (judged.missing, judged.unseen, judged.between) == (0, 1, 9)
    right = [state for state in whole.states if state.sequence != 61]
    assert [state.stamp_ns for state in watched] == [state.stamp_ns for state in right]
    assert [state.seen_ns for state in watched] == [state.seen_ns for state in right]  # all arrive equally late


def test_nothing_is_assumed_of_samples_between_states_that_count_another_number(bag: Path, tmp_path: Path) -> None:
    """Ten states are gone, and one of their samples: it may have been any of the ten."""
    rows = {JointSample: 0, SingularityState: 0}

    def lose(record: object) -> object:
        for kind, first, last in ((JointSample, 65, 65), (SingularityState, 61, 70)):
            if isinstance(record, kind):
                rows[kind] += 1
                return None if first <= rows[kind] <= last else record
        return record

    judged = judge_again(read_recording(copied(bag, tmp_path / "gap.mcap", lose)))
    assert (judged.missing, judged.unseen, judged.between) == (10, 9, 0)


def test_missing_samples_and_samples_without_a_state_are_counted(bag: Path, tmp_path: Path) -> None:
    seen = {JointSample: 0, SingularityState: 0}

    def lose(record: object) -> object:
        for kind, lost in ((JointSample, 60), (SingularityState, 90)):
            if isinstance(record, kind):
                seen[kind] += 1
                return None if seen[kind] == lost else record
        return record

    judged = judge_again(read_recording(copied(bag, tmp_path / "gap.mcap", lose)))
    assert (judged.missing, judged.unseen, judged.between) == (1, 0, 1)


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


def test_settings_and_resets_come_at_their_times_also_without_states(bag: Path, tmp_path: Path) -> None:
    """The journal tells both clocks. Without states the samples have the time of their recording alone."""
    count, changed = 0, tmp_path / "changed.mcap"
    with Bag(bag) as opened, BagWriter(changed) as writer:
        for entry in opened.records():
            if isinstance(entry.record, JointSample):
                count += 1
            elif isinstance(entry.record, str) and '"configure"' in entry.record:
                first = read_entry(entry.record)
            writer.add(entry.topic, entry.record, entry.log_ns)
            if count == 100:
                count += 1
                later_ns = entry.log_ns - first.received_ns
                again = first._replace(received_ns=entry.log_ns, seen_ns=first.seen_ns + later_ns)
                again.values["dwell_s"] = 0.2
                writer.add("/supervisor/journal", write_entry(again), entry.log_ns)
    no_states = tmp_path / "no_states.mcap"
    copied(changed, no_states, lambda record: None if isinstance(record, SingularityState | Verdict) else record)
    right, found = judge_again(read_recording(changed)), judge_again(read_recording(no_states))
    assert [since_ns for since_ns, _ in found.settings] == [since_ns for since_ns, _ in right.settings]
    assert found.intervals[-1].latched
    assert found.intervals[1:] == right.intervals[1:]  # both begin with UNKNOWN: settings come before the samples


def test_the_journal_of_another_program_is_none_of_a_supervisor(bag: Path, tmp_path: Path) -> None:
    alone, target = samples_of(bag, tmp_path / "alone.mcap"), tmp_path / "noted.mcap"
    with Bag(alone) as opened, BagWriter(target) as writer:
        writer.add("/app/journal", "hello", START_NS)
        for entry in opened.records():
            writer.add(entry.topic, entry.record, entry.log_ns)
    told = Assumption("irsbot2")
    assert judge_again(read_recording(target), told) == judge_again(read_recording(alone), told)


@pytest.mark.parametrize(
    "change",
    [
        {"seen_ns": None},
        {"received_ns": "now"},
        {"received_ns": 1e400},
        {"seen_ns": 10**30},
        {"values": []},
        {"machine": []},
        {"machine": {}},
        {"values": {}},
        {"machine": {"assembly_mode": "x"}},
        {"machine": {"geometry": {"l1": "x"}}},
    ],
)
def test_a_malformed_entry_of_a_journal_is_refused_in_one_sentence(
    change: dict[str, object], bag: Path, tmp_path: Path
) -> None:
    def spoil(record: object) -> object:
        if not isinstance(record, str) or '"configure"' not in record:
            return record
        entry = json.loads(record)
        whole = {key: {**entry[key], **value} if value and key == "machine" else value for key, value in change.items()}
        return json.dumps({**entry, **whole})

    target = copied(bag, tmp_path / "spoilt.mcap", spoil)
    with pytest.raises(BagError, match="spoilt") as caught:
        judge_again(read_recording(target))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("others", [0, 1])
def test_log_times_that_are_too_large_are_refused(others: int, tmp_path: Path) -> None:
    target = tmp_path / "late.mcap"
    with BagWriter(target) as writer:
        for k in range(100):
            sample = JointSample(k, k, k, ("a", "b"), (0.0, 0.0), (0.0, 0.0))
            writer.add("/joint_states", sample, 2**63 + 2 * k)
            if others:
                writer.add("/text", "hello", 2**63 + 2 * k + 1)
    with pytest.raises(BagError, match="a log time is 92233720368547758"):
        read_recording(target)


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
