"""Every recorded run tells its story again, and the ways to a test of one's own work as bags/README.md says."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest
from command import IRSBOT, PATIENCE_S, Said, irsbot
from mcap.reader import make_reader

from irsbot_msgs_py.records import Level, SingularityState
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.bag.bag import Bag
from irsbot_supervisor.bag.bag_writer import BagWriter
from irsbot_supervisor.replay.comparison import against_expectation, against_recording
from irsbot_supervisor.replay.expectation import levels_of, read_expectation
from irsbot_supervisor.replay.recording import read_recording
from irsbot_supervisor.replay.rejudge import judge_again
from irsbot_supervisor.sim.closed_loop import BEGIN_NS

ROOT = Path(__file__).parents[1]
LAYOUTS = ROOT / "ros2_ws/src/irsbot_supervisor/layouts"
LOOKED_AT = {"/supervisor/state", "/supervisor/verdict"}
BAGS = sorted(path.parent for path in (ROOT / "bags").glob("*/expected.json"))


@pytest.mark.parametrize("bag", BAGS, ids=lambda bag: bag.name)
def test_every_bag_replays_to_its_expectation(bag: Path) -> None:
    recording = read_recording(bag)
    judged = judge_again(recording)
    assert judged == judge_again(recording), "two replays differ"
    assert (judged.unseen, judged.missing) == (0, 0)
    expectation = read_expectation(bag / "expected.json")
    assert expectation.levels
    assert expectation.measures
    for check in (*against_recording(recording, judged), *against_expectation(recording, judged, expectation)):
        assert check.faults == (), check.name
    assert sum(file.stat().st_size for file in bag.iterdir()) < 1_000_000


def test_there_are_ten_bags_and_the_list_of_them_is_complete() -> None:
    listed = re.findall(r"^\| (\w+) \| \w+ \| .* \|$", (ROOT / "bags" / "README.md").read_text(), re.MULTILINE)
    assert sorted(listed[listed.index("pick_and_place") :]) == [bag.name for bag in BAGS]
    assert len(BAGS) >= 10


@pytest.mark.parametrize("bag", BAGS, ids=lambda bag: bag.name)
def test_every_bag_has_the_topics_of_the_layouts_under_their_full_names(bag: Path) -> None:
    """As a recorder of ROS has them: a viewer takes `supervisor/state` for another topic than `/supervisor/state`."""
    (file,) = bag.glob("*.mcap")
    with file.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    names = {channel.topic for channel in summary.channels.values()}
    assert names == {"/joint_states", *(f"/supervisor/{name}" for name in ("journal", "state", "verdict"))}
    for text in ((LAYOUTS / name).read_text() for name in ("foxglove.json", "plotjuggler.xml")):
        assert set(re.findall(r'"(/supervisor/(?:state|verdict))\b', text)) == names & LOOKED_AT


@pytest.mark.parametrize(
    ("bag", "before", "after", "margin"),
    [
        ("cuspidal_loop", (0.08076, 0.03511, 1.22907), (0.21813, -0.10313, 1.77226), 0.12),
        ("cuspidal_struts", (0.10587, -0.13301, -0.09401), (-0.00727, 0.16984, 0.11306), 0.25),
    ],
)
def test_round_a_cusp_the_joints_come_back_and_the_supervisor_knows_the_other_pose(
    bag: str, before: tuple[float, ...], after: tuple[float, ...], margin: float
) -> None:
    """Poses of docs/explanation/algebra.md: found there by a proved path, here by the supervisor."""
    with Bag(ROOT / "bags" / bag) as opened:
        states = [entry.record for entry in opened.records() if isinstance(entry.record, SingularityState)]
    assert states[0].joint_position == states[-1].joint_position
    assert states[0].pose == pytest.approx(before, abs=2e-4)  # as fine as the encoders
    assert states[-1].pose == pytest.approx(after, abs=2e-4)
    assert min(state.type2_margin for state in states) > margin


def test_a_recording_that_begins_in_the_middle_of_the_work_is_judged_from_there(tmp_path: Path) -> None:
    """Settings are said once, long before; samples and verdicts begin after a hundred others."""
    target, skipped = tmp_path / "late.mcap", 0
    with Bag(ROOT / "bags" / "type2") as opened, BagWriter(target) as writer:
        for entry in opened.records():
            early = entry.log_ns < BEGIN_NS + NS_PER_S // 10 and not isinstance(entry.record, str)
            skipped += early
            if not early:
                writer.add(entry.topic, entry.record, entry.log_ns)
    assert skipped > 100
    recording = read_recording(target)
    judged = judge_again(recording)
    assert [check.faults for check in against_recording(recording, judged)] == [(), ()]
    levels = levels_of(judged.intervals)
    assert [entry.level for entry in levels] == [Level.UNKNOWN, Level.OK, Level.WARN, Level.STOP]
    waited_ns = levels[1].since_ns - levels[0].since_ns
    assert waited_ns == pytest.approx(
        0.15 * NS_PER_S
    )  # until samples are known to come, and the dwell time, from here on


def test_a_bag_becomes_a_test_that_fails_until_a_person_has_read_it(tmp_path: Path) -> None:
    bag = shutil.copytree(ROOT / "bags" / "type2", tmp_path / "mine", ignore=shutil.ignore_patterns("expected.json"))
    draft = bag / "expected.json"

    def replay(*more: object) -> Said:
        return irsbot("replay", bag, *more)

    assert replay("--write-expect", draft).code == 0
    unread = replay()
    assert unread.code == 1
    assert "a person has to read it" in unread.err
    stated = json.loads(draft.read_text())
    del stated["draft"]
    draft.write_text(json.dumps(stated))
    assert replay().code == 0
    again = replay("--write-expect", draft)
    assert again.code == 2
    assert "never replaced" in again.err
    stated["story"][-1]["causes"] = ["LIMB"]
    draft.write_text(json.dumps(stated))
    assert replay().code == 1


def test_the_lines_for_ci_report_every_bag_and_fail_if_one_differs(tmp_path: Path) -> None:
    lines = re.findall(r"```sh\n(.*?)```", (ROOT / "bags" / "README.md").read_text(), re.DOTALL)
    script = "".join(lines).replace("./irsbot", " ".join(IRSBOT))
    for name in ("type2", "constraint"):
        shutil.copytree(ROOT / "bags" / name, tmp_path / "bags" / name)
    good = subprocess.run(["bash", "-c", script], cwd=tmp_path, capture_output=True, text=True, timeout=PATIENCE_S)
    assert good.returncode == 0, good.stderr
    assert 'failures="0"' in (tmp_path / "report_type2.xml").read_text()
    (tmp_path / "bags" / "constraint" / "expected.json").write_text('{"false_stops": 0, "hold_share": 0}')
    bad = subprocess.run(["bash", "-c", script], cwd=tmp_path, capture_output=True, text=True, timeout=PATIENCE_S)
    assert bad.returncode == 1
    assert 'failures="1"' in (tmp_path / "report_constraint.xml").read_text()
    assert (tmp_path / "report_type2.xml").exists()
