"""The command `replay`: reports, exit codes, expectation files, pages."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from xml.etree import ElementTree

import pytest
from command import irsbot
from replayed import RATE_HZ, samples_of
from typer.testing import CliRunner

from irsbot_supervisor.cli.app import whole_app
from irsbot_supervisor.cli.junit import Suite, write_junit
from irsbot_supervisor.configuration.loading import read_settings, shipped_values
from irsbot_supervisor.fleet.records import BagCheck, BagJob, Options
from irsbot_supervisor.sim.closed_loop import cycles, record
from irsbot_supervisor.sim.simulation import simulation_from


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
    nothing = run.invoke(whole_app(), ["replay", alone])
    assert nothing.exit_code != 0
    assert "--robot NAME" in str(nothing.exception)
    words = ["replay", alone, "--robot", "irsbot2", "--settings", str(limits), "--write-expect", str(expected)]
    assert run.invoke(whole_app(), words).exit_code == 0
    stated = json.loads(expected.read_text())
    assert (stated["robot"], stated["settings"]) == ("irsbot2", {"dwell_s": 0.1})
    del stated["draft"]
    expected.write_text(json.dumps(stated))
    again = run.invoke(whole_app(), ["replay", alone])  # finds its expectations beside it
    assert again.exit_code == 0, again.exception
    assert "robot: irsbot2 with other settings" in again.stdout
    other = run.invoke(whole_app(), ["replay", alone, "--robot", "irsbot2_beta45"])
    assert other.exit_code == 1
    assert "robot: irsbot2_beta45 with its shipped settings" in other.stdout


def test_single_files_of_one_folder_have_expectations_of_their_own(bag: Path, tmp_path: Path) -> None:
    for name in ("a.mcap", "b.mcap"):
        shutil.copy(bag, tmp_path / name)
    right, wrong = {"false_stops": [0, 99]}, {"false_stops": 99}
    (tmp_path / "a.expected.json").write_text(json.dumps(right))
    (tmp_path / "expected.json").write_text(json.dumps(wrong))
    assert [irsbot("replay", tmp_path / name).code for name in ("a.mcap", "b.mcap")] == [0, 1]
    before = BagJob("a", str(tmp_path / "a.mcap"), Options()).key
    (tmp_path / "a.expected.json").write_text(json.dumps(wrong))
    assert BagJob("a", str(tmp_path / "a.mcap"), Options()).key != before


def test_the_command_fails_with_the_first_difference_from_an_expectation_file(bag: Path, tmp_path: Path) -> None:
    expectation, report = tmp_path / "story.json", tmp_path / "report.xml"
    expectation.write_text(json.dumps({"story": [{"level": "UNKNOWN"}, {"level": "STOP"}]}))
    assert CliRunner().invoke(whole_app(), ["replay", str(bag), "--json"]).exit_code == 0
    words = ["replay", str(bag), "--expect", str(expectation), "--junit", str(report), "--json"]
    done = CliRunner().invoke(whole_app(), words)
    assert done.exit_code == 1
    assert "expected story" in str(done.exception)
    rows = json.loads(done.stdout)["checks"]
    assert [row["name"] for row in rows if row["faults"]] == ["expected story"]
    assert ElementTree.parse(report).getroot().get("failures") == "1"


def test_the_page_of_a_run_shows_settings_with_units_and_the_origin_of_times(bag: Path, tmp_path: Path) -> None:
    page = tmp_path / "run.html"
    assert CliRunner().invoke(whole_app(), ["report", str(bag), "-o", str(page)]).exit_code == 0
    text = page.read_text()
    assert "<tr><td>stale_s</td><td>0.05</td><td>s</td></tr>" in text
    assert "<tr><td>payload_kg</td><td>0.0</td><td>kg</td></tr>" in text
    assert "Times count from the first joint state" in text
