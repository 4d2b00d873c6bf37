"""The benchmark measures what it says and prints what it promises. No time is judged: machines differ."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from math import inf, nan
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command import irsbot
from counted import Counted
from supervised import settings_of

import irsbot_kinematics as irs
from irsbot_msgs_py.process import fastdds
from irsbot_supervisor.cli.bench import bench
from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.core.stopping import CUTS_IF_CLEAR, CUTS_OF_A_SAMPLE, StoppingPredictor
from irsbot_supervisor.fleet.version import code_version
from irsbot_supervisor.processes.suite import free_domain
from irsbot_supervisor.sim.scenario_file import scenario_robots
from irsbot_supervisor.validation.bench import history, loop_closure, noise, one_sample
from irsbot_supervisor.validation.bench.high_rate import HighRate
from irsbot_supervisor.validation.bench.loop_closure import LoopClosure
from irsbot_supervisor.validation.bench.one_sample import OneSample
from irsbot_supervisor.validation.bench.recorder import Recorder
from irsbot_supervisor.validation.bench.report import Measured, Row, rows
from irsbot_supervisor.validation.bench.startup import Start
from irsbot_supervisor.validation.bench.transport import RAW, SUPERVISED, TYPED, Run, match

PATIENCE_S = 300.0
START = Start(0.1, 0.2, 50.0)
COMMAND = [sys.executable, "-c", "import typer; from irsbot_supervisor.cli.bench import bench; typer.run(bench)"]


def run_bench(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([*COMMAND, *arguments], capture_output=True, text=True, timeout=PATIENCE_S, check=False)


def facts_of(*arguments: str) -> dict[str, Any]:
    done = run_bench("--quick", "--json", *arguments)
    assert done.returncode == 0, done.stderr
    facts: dict[str, Any] = json.loads(done.stdout)
    return facts


def run_of(subject: str, p50_us: float, p99_us: float = 1.0, cpu_us: float = 1.0, lost: int = 0) -> Run:
    return Run(subject, 2.0, 2000, lost, p50_us, p99_us, cpu_us, 50.0)


# --- latencies and losses -----------------------------------------------------------------------------------------


def test_a_message_is_identified_by_its_stamp_in_any_order_of_arrival() -> None:
    sent = np.array([[10, 1_000], [20, 2_000], [30, 3_000]])
    seen = np.array([[30, 3_900], [5, 100], [10, 1_500], [20, 2_700]])
    latencies_us, lost = match(sent, seen)
    assert latencies_us == [0.5, 0.7, 0.9]
    assert lost == 0


def test_lost_messages_are_counted_and_have_no_latency() -> None:
    sent = np.array([[10, 1_000], [20, 2_000], [30, 3_000]])
    latencies_us, lost = match(sent, np.array([[20, 2_250]]))
    assert latencies_us == [0.25]
    assert lost == 2


def test_of_a_message_that_arrives_twice_the_first_arrival_counts() -> None:
    latencies_us, lost = match(np.array([[10, 1_000]]), np.array([[10, 4_000], [10, 9_000]]))
    assert latencies_us == [3.0]
    assert lost == 0


def test_where_nothing_arrives_everything_is_lost() -> None:
    latencies_us, lost = match(np.array([[10, 1_000], [20, 2_000]]), np.empty((0, 2), dtype=np.int64))
    assert latencies_us == []
    assert lost == 2


# --- goals --------------------------------------------------------------------------------------------------------


def test_a_ratio_compares_runs_of_the_same_round() -> None:
    # the machine slows down by 10 in the second round: 1.05, 1.00 and 1.20 within the rounds, median 1.05
    raw, ours = (100.0, 1000.0, 100.0), (105.0, 1000.0, 120.0)
    runs = [run_of(name, p50) for a, b in zip(raw, ours, strict=True) for name, p50 in ((RAW, a), (SUPERVISED, b))]
    runs += [run_of(TYPED, 200.0)] * 3
    found = {row.what: row.measured for row in rows(Measured(transport=runs))}
    assert found["latency p50 / raw relay"] == pytest.approx(1.05)
    assert found["latency p50 / typed relay"] == pytest.approx(0.6)  # of 105, 1000 and 120 over 200


def test_the_99th_percentiles_are_compared_by_their_lower_quartiles() -> None:
    # the quartile of 1, 2, 3, 4, 5 is 2; of 2, 6, 8, 9, 10 it is 6
    runs = [run_of(RAW, 1.0, p99) for p99 in (5.0, 1.0, 3.0, 2.0, 4.0)]
    runs += [run_of(SUPERVISED, 1.0, p99) for p99 in (10.0, 8.0, 2.0, 6.0, 9.0)]
    runs += [run_of(TYPED, 1.0)] * 5
    found = {row.what: row.measured for row in rows(Measured(transport=runs))}
    assert found["latency p99 / raw relay"] == pytest.approx(3.0)


def test_losses_of_the_supervisor_alone_miss_the_goal() -> None:
    runs = [run_of(RAW, 1.0, lost=7), run_of(TYPED, 1.0, lost=9), run_of(SUPERVISED, 1.0, lost=1)]
    (row,) = [row for row in rows(Measured(transport=runs)) if row.goal == "P3"]
    assert row.measured == 1
    assert not row.met


@pytest.mark.parametrize(("judged", "met"), [(100_000, True), (99_999, False)])
def test_every_sample_at_5_khz_is_judged_and_states_may_be_fewer(judged: int, met: bool) -> None:
    (row,) = rows(Measured(high_rate=HighRate(5000.0, 20.0, 100_000, judged, 25_000, 90.0)))
    assert (row.goal, row.what, row.measured) == ("P3", "samples not judged at 5 kHz", 100_000 - judged)
    assert row.met is met


@pytest.mark.parametrize(
    ("at_least", "measured", "met"),
    [
        (False, 12.0, True),
        (False, 12.1, False),
        (True, 12.0, True),
        (True, 11.9, False),
        (False, nan, False),
        (True, nan, False),
    ],
)
def test_a_goal_is_met_at_its_limit_and_never_by_nan(at_least: bool, measured: float, met: bool) -> None:
    assert Row("P", "what", 12.0, at_least, measured, "us").met is met


def test_the_default_robot_and_the_slowest_other_one_are_judged() -> None:
    medians = (("a", 9.0), ("b", 3.0), ("c", 26.0))
    plain = [OneSample(name, 10, median, median, 99.0, 99.0, 990.0) for name, median in medians]
    found = {row.what: row for row in rows(Measured(one_sample=plain))}
    assert found["one step, median, a, plain"].met
    assert found["one step, worst, a, plain"].measured == 99.0
    compiled = [result._replace(compiled=True) for result in plain]
    found = {row.what: row for row in rows(Measured(one_sample=compiled))}
    assert not found["one step, median, a, compiled"].met
    assert not found["one step, median, slowest other robot (c), compiled"].met


def test_the_recorder_is_compared_at_3000_messages_per_second() -> None:
    found = {row.what: row for row in rows(Measured(recorder=Recorder(2000.0, 11.0, 0.0009, 0.06, 290_000.0)))}
    share = found["recorder, of one core at 3000 messages/s"]
    assert share.measured == pytest.approx(3.3)
    assert [row.met for row in found.values()] == [False, False, True, False]


def test_pinocchio_has_goals_only_where_it_is_installed() -> None:
    assert rows(Measured(loop_closure=LoopClosure(10, 5.0, 0.1, nan, nan))) == []
    found = rows(Measured(loop_closure=LoopClosure(10, 5.0, 0.1, 60.0, 0.0)))
    assert [row.measured for row in found] == pytest.approx([12.0, 600.0])
    assert [row.met for row in found] == [True, False]


def test_pinocchio_closes_the_loop_at_the_same_poses() -> None:
    pytest.importorskip("pinocchio", reason="only compared with where it is installed: pip install pin")
    assert loop_closure.measure(lambda _text: None, quick=True).difference_m < 1e-9


# --- other processes ----------------------------------------------------------------------------------------------


def test_what_others_take_is_the_busy_time_that_is_not_ours(monkeypatch: pytest.MonkeyPatch) -> None:
    busy, own, now = iter((100.0, 112.0)), iter((10.0, 17.0)), iter((0.0, 10.0))
    monkeypatch.setattr(noise, "_busy_s", lambda: next(busy))
    monkeypatch.setattr(noise, "_own_s", lambda: next(own))
    monkeypatch.setattr(noise.time, "monotonic", lambda: next(now))
    with noise.Others() as others:
        assert not others.quiet, "unknown before the end"
    assert others.cores == pytest.approx(0.5)
    assert not others.quiet


def test_our_own_work_is_ours() -> None:
    begin = noise._own_s(), noise._busy_s()
    subprocess.run([sys.executable, "-c", "sum(i * i for i in range(10**6))"], check=True)
    assert noise._own_s() > begin[0], "a child that has ended counts"
    assert noise._busy_s() > begin[1]


# --- history ------------------------------------------------------------------------------------------------------


def facts_with(version: str, measured: float | None, limit: float = 10.0, *, at_least: bool = False) -> dict[str, Any]:
    goal = {"goal": "P4", "what": "one step", "limit": limit, "at_least": at_least, "measured": measured}
    return {"version": version, "goals": [goal]}


def test_a_history_keeps_every_benchmark_and_compares_it_with_its_goal(tmp_path: Path) -> None:
    file = tmp_path / "bench.jsonl"
    history.append(file, facts_with("a", 20.0))
    history.append(file, facts_with("b", 5.0))
    history.append(file, {"version": "c", "goals": []})
    kept = history.read(file)
    assert [facts["version"] for facts in kept] == ["a", "b", "c"]
    assert kept[:2] == [facts_with("a", 20.0), facts_with("b", 5.0)]
    assert history.ratios(kept) == {"P4 one step": [2.0, 0.5, None]}


def test_a_goal_that_wants_more_is_compared_the_other_way_round() -> None:
    kept = [facts_with("a", 20.0, at_least=True), facts_with("b", None), facts_with("c", 0.0)]
    assert history.ratios(kept) == {"P4 one step": [0.5, None, None]}
    assert history.ratios([facts_with("a", 3.0, limit=0.0)]) == {}, "nothing can be compared with 0"


def test_the_page_of_a_history_needs_nothing_else(tmp_path: Path) -> None:
    page = tmp_path / "bench.html"
    history.write_page([facts_with("a", 20.0), facts_with("b", 5.0)], page)
    text = page.read_text()
    assert "P4 one step" in text
    assert "1: a" in text
    assert "<script src=" not in text


def test_the_page_of_the_command_shows_earlier_results_and_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    file, page = tmp_path / "bench.jsonl", tmp_path / "bench.html"
    history.append(file, facts_with("earlier", 20.0))
    monkeypatch.setattr("irsbot_supervisor.cli.bench._measure", lambda parts, quick: Measured(startup=[START]))
    bench(history=file, page=page, as_json=True)
    assert history.read(file)[1] == json.loads(capsys.readouterr().out)
    assert [facts["version"] for facts in history.read(file)] == ["earlier", code_version()]
    text = page.read_text()
    assert "1: earlier" in text
    assert f"2: {code_version()}" in text


def test_a_history_that_lost_its_last_line_end_goes_on(tmp_path: Path) -> None:
    file = tmp_path / "bench.jsonl"
    file.write_text(json.dumps(facts_with("a", 20.0)))
    history.append(file, facts_with("b", 5.0))
    assert [facts["version"] for facts in history.read(file)] == ["a", "b"]


def test_compiled_and_plain_runs_are_compared_with_their_like_and_quick_ones_are_not_drawn(tmp_path: Path) -> None:
    kept = [{**facts_with("a", 20.0), "compiled": form} for form in (True, False)]
    assert history.ratios(kept) == {"P4 one step, compiled": [2.0, None], "P4 one step, plain": [None, 2.0]}
    history.write_page([*kept, {**facts_with("hasty", 5.0), "quick": True}], tmp_path / "page.html")
    assert "hasty" not in (tmp_path / "page.html").read_text()


def test_what_was_measured_is_printed_also_if_it_cannot_be_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def full(file: Path, facts: history.Facts) -> None:
        raise OSError("no space left")

    monkeypatch.setattr("irsbot_supervisor.cli.bench._measure", lambda parts, quick: Measured(startup=[START]))
    monkeypatch.setattr("irsbot_supervisor.cli.bench.append", full)
    with pytest.raises(OSError, match="no space"):
        bench(history=tmp_path / "bench.jsonl")
    assert "start-up" in capsys.readouterr().out


@pytest.mark.parametrize("option", ["--history", "--page"])
def test_a_folder_that_is_not_there_is_told_before_the_work_begins(tmp_path: Path, option: str) -> None:
    files = {"--history": tmp_path / "a.jsonl", "--page": tmp_path / "a.html"}
    files[option] = tmp_path / "gone" / files[option].name
    done = irsbot("bench", "--only", "batch", *(word for pair in files.items() for word in pair))
    assert done.code == 2
    assert f"there is no folder '{tmp_path / 'gone'}'" in done.refusal
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "line",
    [
        *(
            "no json",
            pytest.param("[" * 100_000, id="deep"),
            "[]",
            "{}",
            "\udcff",
            '{"version": "a", "goals": [{"limit": "x"}]}',
        ),
        '{"version": "a", "goals": [{"limit": 1}]}',
        '{"version": "a", "goals": [{"goal": "P4", "what": "x", "limit": 1, "at_least": false, "measured": "x"}]}',
        '{"version": "a", "goals": [{"goal": "P4", "what": "x", "limit": 1, "measured": 2}]}',
    ],
)
def test_a_file_that_is_no_history_is_left_alone(tmp_path: Path, line: str) -> None:
    file = tmp_path / "other.txt"
    text = f"{line}\n".encode(errors="surrogateescape")
    file.write_bytes(text)
    command = [sys.executable, "-m", "irsbot_supervisor", "bench", "--quick", "--only", "batch", "--history", str(file)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S, check=False)
    assert done.returncode == 2
    assert done.stderr == f"irsbot: {file}, line 1 is no benchmark: it must be a file of --history\n"
    assert file.read_bytes() == text


# --- the command --------------------------------------------------------------------------------------------------


def test_a_run_is_judged_offline_and_one_by_one() -> None:
    facts = facts_of("--only", "offline")
    found = facts["offline"]
    assert (found["robot"], found["samples"]) == ("irsbot2", 1000)
    (row,) = facts["goals"]
    assert row["goal"] == "P6"
    assert row["measured"] == pytest.approx(found["columns_s"] * 3600.0)


@pytest.mark.parametrize("name", ["irsbot2", "rrr3"])
def test_the_hardest_prediction_needs_every_cut(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """By a clock that shows the number of boxes that were bounded."""
    settings, robot = settings_of(name)
    counted = Counted(robot.mechanism)

    def predictor(settings: Settings, mechanism: irs.Mechanism) -> StoppingPredictor:
        assert mechanism is robot.mechanism
        return StoppingPredictor(settings, counted)

    monkeypatch.setattr(one_sample, "StoppingPredictor", predictor)
    monkeypatch.setattr(one_sample.time, "perf_counter_ns", lambda: counted.boxes)
    boxes = one_sample.hardest_prediction(settings, robot, 40, 2)
    assert 1 + 2 * CUTS_OF_A_SAMPLE <= boxes <= 3 + 2 * CUTS_IF_CLEAR


def test_parts_without_processes_give_every_robot_the_batch_and_their_goals() -> None:
    facts = facts_of("--only", "one-sample", "--only", "batch")
    assert [result["robot"] for result in facts["one_sample"]] == list(scenario_robots("pick_and_place"))
    for result in facts["one_sample"]:
        assert 0.0 < result["median_us"] <= result["p99_us"] <= result["worst_us"]
        assert 0.0 < result["with_state_us"] < inf
        assert 0.0 < result["hardest_us"] < inf
    # two joints in; status, pose, mode, margins of both types, constraint, angles, reach, residual out
    assert facts["batch"]["bytes_per_sample"] == 16 + 1 + 16 + 2 + 16 + 8 + 8 + 16 + 8 + 8
    # plain Python has a goal for the default robot alone
    steps = ["P4"] * (3 if facts["one_sample"][0]["compiled"] else 2)
    rates = [facts["batch"][f"{kind}samples_per_s"] for kind in ("", "compiled_", "anew_")]
    assert min(rates) > 0.0
    assert [goal["goal"] for goal in facts["goals"]] == [*steps, "P5", "P5", "P5"]
    assert [goal["measured"] * 1e6 for goal in facts["goals"][-3:]] == pytest.approx(rates)
    assert facts["transport"] == facts["startup"] == []


def test_tables_show_goal_measurement_and_whether_it_was_met() -> None:
    done = run_bench("--quick", "--only", "batch")
    assert done.returncode == 0, done.stderr
    assert "batch" in done.stderr  # progress
    for word in ("goal", "wanted", "measured", "met", "P5", "Msamples/s"):
        assert word in done.stdout


def test_help_has_an_example() -> None:
    assert "Example: irsbot bench" in run_bench("--help").stdout


@pytest.mark.ros
def test_who_listens_is_found_as_early_as_the_nodes(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("irsbot_msgs", reason="needs the built workspace")
    from std_msgs.msg import Bool

    from irsbot_supervisor.validation.bench.listening import next_message

    for name in (fastdds.TRANSPORTS, fastdds.PROFILES):
        monkeypatch.delenv(name, raising=False)
    with next_message(free_domain(), Bool, "anything"):
        assert os.environ[fastdds.PROFILES] in (fastdds.NETWORK, fastdds.LOCALHOST)


@pytest.mark.ros
@pytest.mark.slow
def test_relays_and_supervisor_pass_on_messages_and_a_fresh_supervisor_judges() -> None:
    pytest.importorskip("irsbot_msgs", reason="needs the built workspace")
    facts = facts_of("--only", "transport", "--only", "high-rate", "--only", "startup", "--only", "recorder")
    assert {run["subject"] for run in facts["transport"]} == {RAW, TYPED, SUPERVISED}
    for run in facts["transport"]:
        assert run["sent"] > run["lost"], run
        assert 0.0 < run["p50_us"] <= run["p99_us"]
        assert run["cpu_us"] > 0.0
    fast = facts["high_rate"]
    assert 0 < fast["states"] <= fast["judged"] <= fast["sent"]
    assert fast["cpu_us"] > 0.0
    for start in facts["startup"]:
        assert 0.0 < start["first_verdict_s"] <= start["first_judged_s"]
        assert start["resident_mb"] > 10.0
    recorder = facts["recorder"]
    assert recorder["messages_per_s"] > 0.0
    assert recorder["cpu_us"] > 0.0
    assert recorder["lost_s"] >= 0.0
    assert recorder["salvaged_per_s"] > 0.0
    assert {goal["goal"] for goal in facts["goals"]} == {"P1", "P2", "P3", "P7", "P8"}
