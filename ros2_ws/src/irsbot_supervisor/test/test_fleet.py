"""Many bags as one fleet: which bags, what a row says, what is kept, the same on any cluster, also a failing one."""

from __future__ import annotations

import json
import logging
import os
import re
import shutil
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import polars as pl
import pytest
from command import irsbot
from dask_processes import dask_cluster, kill_worker, once

from irsbot_kinematics import BadInput
from irsbot_supervisor import report
from irsbot_supervisor.bag.errors import BagError
from irsbot_supervisor.cli.common import without_shared_folder
from irsbot_supervisor.fleet import cluster as fleet_cluster
from irsbot_supervisor.fleet import version
from irsbot_supervisor.fleet.bags import judge_fleet
from irsbot_supervisor.fleet.cluster import Cluster, JobFailed, run
from irsbot_supervisor.fleet.dataset import Dataset
from irsbot_supervisor.fleet.judging import ROW, judge
from irsbot_supervisor.fleet.records import BagCheck, BagJob, BagRow, Fleet, Options, row_from_text
from irsbot_supervisor.fleet.search import bags_in
from irsbot_supervisor.replay.judgement import judge_bag

BAGS = Path(__file__).parents[4] / "bags"
NAMES = ("type2", "constraint", "workspace_boundary", "stop_and_reset", "mode_flip", "pick_and_place")

pytestmark = pytest.mark.skipif(not BAGS.is_dir(), reason="installed without the bags beside it")


def job_of(bag: Path, samples: bool = False, page: bool = False) -> BagJob:
    return BagJob(bag.name, str(bag), Options(), samples, page)


def jobs(samples: bool = False) -> list[BagJob]:
    """Six bags, and one that cannot be judged."""
    return [job_of(BAGS / name, samples) for name in NAMES] + [job_of(BAGS / "none", samples)]


@pytest.fixture(scope="module")
def rows() -> list[BagRow]:
    """Of `jobs`, without any cluster."""
    return [judge(job).row for job in jobs()]


# --- which bags ------------------------------------------------------------------------------------------------------


def test_folders_are_searched_and_every_bag_is_taken_once(tmp_path: Path) -> None:
    for name in ("b", "a/deep"):
        shutil.copytree(BAGS / "type2", tmp_path / name)
    single = shutil.copy(BAGS / "type2" / "type2_0.mcap", tmp_path / "c.mcap")
    (tmp_path / "empty").mkdir()
    nested = tmp_path / "several"
    nested.mkdir()
    shutil.move(tmp_path / "a", nested / "a")
    shutil.move(tmp_path / "b", nested / "b")
    assert bags_in([nested, Path(single), nested / "b"]) == [nested / "a" / "deep", nested / "b", Path(single)]
    assert bags_in([BAGS / "type2"]) == [BAGS / "type2"]
    shutil.copy(single, nested)
    assert bags_in([nested]) == [nested, nested / "a" / "deep", nested / "b"], "none is hidden by a file beside it"
    assert bags_in([nested / "b", nested / "b" / "type2_0.mcap"]) == [nested / "b"], "a file of a bag is no second one"
    with pytest.raises(BagError, match="holds none"):
        bags_in([tmp_path / "empty"])
    with pytest.raises(BagError, match="'nowhere' does not exist"):
        bags_in([Path("nowhere")])


@pytest.mark.parametrize(
    ("names", "one"),
    [
        (("a.mcap",), True),
        (("a_0.mcap", "a_1.mcap"), True),
        (("a_9.mcap", "a_10.mcap.zstd"), True),
        (("a_0.mcap", "b_0.mcap"), False),
        (("a_0.mcap", "a_2.mcap"), False),
        (("a.2.mcap", "a.3.mcap"), False),
        (("irsbot_20261125_101500.mcap", "irsbot_20261125_111500.mcap"), False),
        (("a_0.mcap", "b_0.mcap", "metadata.yaml"), True),
    ],
)
def test_separate_bags_in_one_folder_stay_apart_and_parts_of_one_stay_together(
    tmp_path: Path, names: tuple[str, ...], one: bool
) -> None:
    files = [tmp_path / name for name in names]
    for file in files:
        file.write_bytes(b"")
    assert bags_in([tmp_path]) == ([tmp_path] if one else files)


# --- what a row says -------------------------------------------------------------------------------------------------


def test_a_row_says_what_the_replay_of_the_bag_says(rows: list[BagRow]) -> None:
    for name, row in zip(NAMES, rows, strict=False):
        found = judge_bag(BAGS / name)
        nearest = {one["margin"]: one["value"] - one["stop_limit"] for one in found.summary["smallest_margins"]}
        assert (row.bag, row.error, row.samples) == (name, "", len(found.judged.levels))
        assert row.value is not None
        assert row.value - row.stop_limit == min(nearest.values()) == nearest[row.margin]
        assert (row.stops, row.false_stops) == (len(found.summary["stops"]), found.measures["false_stops"])
        assert [(check.name, check.count) for check in row.checks] == [(one.name, 0) for one in found.checks]
    assert rows[-1].result == "not judged"
    assert "under the same path" in rows[-1].error


def test_nobody_knows_a_false_stop_without_an_expectation(tmp_path: Path) -> None:
    shutil.copy(BAGS / "type2" / "type2_0.mcap", tmp_path / "alone.mcap")
    row = judge(job_of(tmp_path / "alone.mcap")).row
    assert (row.stops, row.false_stops) == (1, None)


def test_a_row_survives_as_text_and_the_fleet_adds_up(rows: list[BagRow]) -> None:
    check = BagCheck("expected story", 30, ("first", "second"))
    differs = replace(rows[0], checks=(check,), unseen=2, missing=3, false_stops=4)
    assert row_from_text(differs.to_text()) == differs
    total = Fleet((*rows, differs)).as_json()
    assert (total["bags"], total["same"], total["differ"], total["not_judged"]) == (8, 6, 1, 1)
    assert (total["lost"], total["false_stops"]) == (5, 4)
    assert total["worst_bag"] == "mode_flip", "its Type 2 margin of 0.036 is far below its limit of 0.15"


def test_links_to_folders_that_were_searched_lead_nowhere(tmp_path: Path) -> None:
    (tmp_path / "one").mkdir()
    bag = tmp_path / "one" / "one_0.mcap"
    bag.touch()
    for name in ("a", "b"):
        (tmp_path / name).symlink_to(tmp_path)
        (tmp_path / "one" / name).symlink_to(tmp_path)
    assert bags_in([tmp_path, tmp_path / "one"]) == [tmp_path / "one"]


def test_the_key_changes_with_everything_that_the_result_depends_on(tmp_path: Path) -> None:
    bag = tmp_path / "bag"
    shutil.copytree(BAGS / "type2", bag)
    keys = [job_of(bag).key, job_of(bag, samples=True).key]
    assert keys[0] == keys[1], "what is wanted changes nothing"
    keys = keys[:1]
    keys.append(replace(job_of(bag), options=Options(topic="joint_states")).key)
    (bag / "expected.json").write_text("{}")
    keys.append(job_of(bag).key)
    (tmp_path / "mechanism.py").write_text("")
    keys.append(job_of(bag).key)
    with (bag / "type2_0.mcap").open("ab") as file:
        file.write(b"\0")
    keys.append(job_of(bag).key)
    assert len(set(keys)) == 5


def test_the_key_changes_with_the_file_of_the_mechanism_wherever_it_is(tmp_path: Path) -> None:
    robots, mechanisms = tmp_path / "robots", tmp_path / "mechanisms"
    robots.mkdir()
    mechanisms.mkdir()
    robot, mechanism = robots / "mine.yaml", mechanisms / "mine.py"
    robot.write_text("mechanism: ../mechanisms/mine.py:Mine\n")
    mechanism.write_text("LENGTH = 1.0\n")
    job = replace(job_of(BAGS / "type2"), options=Options(robot=str(robot)))
    before = replace(job).key
    assert before == replace(job).key
    mechanism.write_text("LENGTH = 1.1\n")
    changed = replace(job).key
    (mechanisms / "used.py").write_text("WIDTH = 1.0\n")
    assert len({before, changed, replace(job).key}) == 3
    robot.write_text(": no YAML [")
    assert replace(job).key not in (before, changed)


def test_the_key_changes_with_the_robot_and_the_tubes_that_other_files_name(tmp_path: Path) -> None:
    bag, robots = tmp_path / "bag", tmp_path / "robots"
    shutil.copytree(BAGS / "type2", bag)
    robots.mkdir()
    robot, tubes, mechanism = robots / "mine.yaml", robots / "tubes.yaml", tmp_path / "other" / "mine.py"
    mechanism.parent.mkdir()
    settings = tmp_path / "settings.yaml"
    stated = {"robot": "../robots/mine.yaml", "settings": {"tubes": str(tubes)}, "false_stops": 0}
    (bag / "expected.json").write_text(json.dumps(stated))
    settings.write_text(f"tubes: {tubes}\n")
    jobs = [
        job_of(bag),
        replace(job_of(BAGS / "type2"), options=Options(settings=str(settings), mechanisms=(str(mechanism),))),
    ]
    keys = [replace(job).key for job in jobs]
    for file, text, changes in (
        (robot, "l1: 0.4", (True, False)),
        (robot, "l1: 0.3", (True, False)),
        (tubes, "1", (True, True)),
        (tubes, "2", (True, True)),
        (mechanism, "L = 1", (False, True)),
        (mechanism.with_name("used.py"), "W = 1", (False, True)),
    ):
        file.write_text(text)
        now = [replace(job).key for job in jobs]
        assert tuple(key != before for key, before in zip(now, keys, strict=True)) == changes, file
        keys = now


# --- what is kept ----------------------------------------------------------------------------------------------------


def test_the_samples_of_bags_of_different_robots_are_one_table(tmp_path: Path) -> None:
    names, dataset = ("type2", "orthoglide"), Dataset(tmp_path / "fleet")
    for name in names:
        dataset.add(job_of(BAGS / name), judge(job_of(BAGS / name, samples=True)))
    table = pl.scan_parquet(tmp_path / "fleet" / "samples" / "*.parquet").collect()
    for name in names:
        found, mine = judge_bag(BAGS / name), table.filter(pl.col("bag") == name)
        assert mine["time_s"].to_list() == found.series.times.tolist()
        levels = [(int(level), causes) for level, causes in found.judged.levels.values()]
        assert list(zip(mine["level"], mine["causes"], strict=True)) == levels
        assert mine["joint_position"].to_list() == found.series["joint"].tolist()
        assert mine["type2_margin"].min() == min(value for margin, value, _time in found.margins if margin == "type2")


def test_a_bag_that_is_there_is_not_judged_again_and_a_broken_file_is(tmp_path: Path) -> None:
    job, dataset = job_of(BAGS / "type2", samples=True), Dataset(tmp_path / "fleet")
    found = judge(job)
    assert dataset.known(job) is None
    dataset.add(job, found)
    assert dataset.known(job) == found.row
    assert dataset.known(replace(job, page=True)) is None, "its page is not there"
    assert judge_fleet([job], Cluster("tcp://127.0.0.1:1"), dataset) == [found.row], "no cluster was asked"
    (file,) = (tmp_path / "fleet" / "samples").iterdir()
    whole = pl.read_parquet(file)
    for spoilt in ("", "3", "[]", "{}", "[" * 100_000):
        whole.write_parquet(file, metadata={ROW: spoilt})
        assert dataset.known(job) is None
    file.write_bytes(file.read_bytes()[:-20])
    assert dataset.known(job) is None


def test_a_folder_with_other_files_is_refused(tmp_path: Path) -> None:
    (tmp_path / "mine.txt").write_text("mine")
    with pytest.raises(BadInput, match="holds other files"):
        Dataset(tmp_path)
    with pytest.raises(BadInput, match="is a file"):
        Dataset(tmp_path / "mine.txt")


# --- on clusters of real processes -----------------------------------------------------------------------------------


@pytest.mark.parametrize("workers", [1, 3])
def test_rows_do_not_depend_on_the_number_of_workers(workers: int, rows: list[BagRow]) -> None:
    assert judge_fleet(jobs(), Cluster(workers=workers)) == rows


def test_a_worker_that_is_killed_loses_nothing(rows: list[BagRow], tmp_path: Path) -> None:
    with dask_cluster() as (address, _scheduler, nanny):
        again = judge_fleet(
            jobs(samples=True), Cluster(address), Dataset(tmp_path / "fleet"), once(lambda: kill_worker(nanny), 1)
        )
    assert again == rows
    assert len(list((tmp_path / "fleet" / "samples").iterdir())) == len(NAMES)


def test_a_scheduler_that_goes_away_is_told_and_the_next_run_goes_on(rows: list[BagRow], tmp_path: Path) -> None:
    folder = tmp_path / "fleet"
    with dask_cluster() as (address, scheduler, _nanny), pytest.raises(BadInput, match=f"{address} went away"):
        judge_fleet(jobs(samples=True), Cluster(address), Dataset(folder), once(scheduler.kill, 2))
    done = sorted((folder / "samples").iterdir())
    assert 2 <= len(done) < len(NAMES)
    assert [file for file in folder.rglob("*") if file.suffix == ".part" or file.name.startswith("fleet.p")] == []
    times = {file: file.stat().st_mtime_ns for file in done}
    assert judge_fleet(jobs(samples=True), Cluster(workers=1), Dataset(folder)) == rows
    assert {file: file.stat().st_mtime_ns for file in done} == times
    assert pl.read_parquet(folder / "fleet.parquet")["result"].to_list() == [row.result for row in rows]


def test_a_scheduler_that_is_not_there_is_one_sentence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fleet_cluster, "ANSWER_S", 0.5)
    words = ("replay", BAGS, "-o", tmp_path / "fleet", "--scheduler")
    for address, why in (
        ("tcp://127.0.0.1:1", "no Dask scheduler answers at tcp://127.0.0.1:1"),
        ("here", "tcp://host"),
    ):
        done = irsbot(*words, address)
        assert done.code == 2
        assert why in done.refusal
        assert list(tmp_path.iterdir()) == []


def test_workers_with_other_code_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fleet_cluster, "code_version", lambda: "0.0+other")
    with pytest.raises(BadInput, match=r"a worker has irsbot \S+, must have 0.0\+other as here"):
        list(run(abs, [-1], Cluster(workers=1)))


def test_a_job_that_fails_fails_alone() -> None:
    found = {answer.place: answer.result for answer in run(int, ["7", "seven"], Cluster(workers=1))}
    assert found[0] == 7
    assert isinstance(found[1], JobFailed)
    assert "ValueError: invalid literal" in found[1].text


def test_ctrl_c_is_for_the_command_and_dask_says_nothing_besides() -> None:
    ask = "__import__('signal').getsignal(__import__('signal').SIGINT).name"
    assert [answer.result for answer in run(eval, [ask], Cluster(workers=1))] == ["SIG_IGN"]
    assert not logging.getLogger("distributed.client").isEnabledFor(logging.ERROR)


def test_a_change_in_the_look_of_a_page_is_another_version() -> None:
    pages = [file for file in (Path(report.__file__).parent / "page").iterdir() if file.is_file()]
    assert len(pages) > 3
    assert {file.suffix for file in pages} <= set(version.KINDS)


@pytest.mark.slow
def test_a_job_that_ends_every_worker_is_given_up() -> None:
    (answer,) = run(os._exit, [1], Cluster(workers=1))
    assert isinstance(answer.result, JobFailed)
    assert "one worker process after another" in answer.result.text


# --- the commands ----------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A good bag, one that is not as expected, and one that is none."""
    found = tmp_path_factory.mktemp("bags")
    for name in ("good", "other"):
        shutil.copytree(BAGS / "type2", found / name)
    (found / "other" / "expected.json").write_text((BAGS / "pick_and_place" / "expected.json").read_text())
    return found


def test_replay_of_many_bags_tells_one_line_a_bag_and_writes_junit(folder: Path, tmp_path: Path) -> None:
    kept, report = tmp_path / "fleet", tmp_path / "report.xml"
    done = irsbot("replay", folder, "-o", kept, "--junit", report, "--workers", 1)
    assert done.code == 1
    assert "1 of 2 bags differ, the first: " in done.err
    lines = done.out.splitlines()
    assert max(map(len, (line for line in lines if line.startswith(("bag ", "good ", "other "))))) <= 80
    assert [line.split()[-1] for line in lines if line.startswith(("good ", "other "))] == ["same", "differs"]
    root = ElementTree.parse(report).getroot()
    assert (root.tag, root.get("failures"), root.get("errors")) == ("testsuites", "2", "0"), "story and measures"
    assert [suite.get("name") for suite in root] == [str(folder / "good"), str(folder / "other")]
    (tmp_path / "broken.mcap").write_bytes(b"no bag")
    done = irsbot("replay", folder, tmp_path / "broken.mcap", "-o", kept, "--json", "--workers", 1)
    assert done.code == 2
    assert '"not_judged": 1' in done.out
    assert "1 of 3 bags could not be judged" in done.refusal


def test_report_of_many_bags_writes_a_page_each_and_one_of_all(folder: Path, tmp_path: Path) -> None:
    kept = tmp_path / "pages"
    done = irsbot("report", folder / "good", folder / "other", "-o", kept, "--workers", 1)
    assert done.code == 0, done.err
    page = (kept / "fleet.html").read_text()
    links = re.findall(r'href="([^"]+)"', page)
    assert len(links) == 2
    assert all("<title>" in (kept / link).read_text() for link in links)
    assert "differs" in page
    done = irsbot("report", folder / "good", "-o", tmp_path / "alone", "--workers", 1)
    assert done.code == 0, done.err
    assert len(re.findall(r'href="([^"]+)"', (tmp_path / "alone" / "fleet.html").read_text())) == 1


def test_names_of_bags_are_shown_below_the_folder_that_they_share() -> None:
    assert without_shared_folder(["a/b/c", "a/d"]) == ("a", ["b/c", "d"])
    assert without_shared_folder(["c", "d"]) == ("", ["c", "d"])
    assert without_shared_folder(["a/c", "/b/d"]) == ("", ["a/c", "/b/d"]), "none is shared by the two kinds"


def test_options_that_do_not_go_together_are_refused(tmp_path: Path) -> None:
    many = (BAGS / "type2", BAGS / "constraint")
    for words, why in (
        (("replay", *many, "--expect", BAGS / "type2" / "expected.json"), "are for one bag"),
        (("replay", *many, "--scheduler", "tcp://a:1", "--workers", 2), "--workers is for this machine"),
        (("report", *many, "-o", tmp_path / "x.html"), "need a folder"),
        (("report", many[0], "-o", tmp_path / "x.html", "--scheduler", "tcp://a:1"), "for a folder of pages"),
        (("evaluate", "irsbot2", many[0], "-o", tmp_path / "x.csv", "--scheduler", "tcp://a:1"), "folder of tables"),
    ):
        done = irsbot(*words)
        assert done.code == 2
        assert why in done.refusal
