"""The data behind a page: nothing is hidden by thinning out, and every number is that of the replay."""

from __future__ import annotations

import contextlib
import json
import re
import sys
from collections.abc import Sequence
from dataclasses import replace
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command import irsbot
from hypothesis import given, settings
from hypothesis import strategies as st

import irsbot_kinematics as irs
from irsbot_kinematics.conformance.samples import Machine
from irsbot_kinematics.mechanism import Posture, Status
from irsbot_kinematics.numerics.arithmetic import Array
from irsbot_msgs_py.records import Cause, JointSample, Level
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.bag.bag_writer import BagWriter
from irsbot_supervisor.bag.errors import BagError
from irsbot_supervisor.replay.judgement import BagJudgement, judge_bag
from irsbot_supervisor.replay.recording import read_recording
from irsbot_supervisor.replay.series import Series
from irsbot_supervisor.report.decimation import breaks_in, kept_rows, rows_of_places
from irsbot_supervisor.report.drawing import view
from irsbot_supervisor.report.json_values import plain
from irsbot_supervisor.report.page import page, page_data
from irsbot_supervisor.report.series import posture_table

BAGS = Path(__file__).resolve().parents[4] / "bags"
TYPE2 = BAGS / "type2"


def judged(bag: Path, robot: str | None = None) -> BagJudgement:
    return judge_bag(bag, robot)


def data_of(found: BagJudgement) -> dict[str, Any]:
    return page_data(found)


def alone(target: Path, samples: list[JointSample]) -> Path:
    """A bag of joint states and nothing else."""
    with BagWriter(target) as bag:
        for sample in samples:
            bag.add("/joint_states", sample, sample.seen_ns)
    return target


@pytest.fixture(scope="module")
def type2() -> BagJudgement:
    return judged(TYPE2)


@pytest.fixture(scope="module")
def samples() -> list[JointSample]:
    return read_recording(TYPE2).samples


# --- thinning out -----------------------------------------------------------------------------------------------

NUMBERS = st.one_of(st.floats(-1e6, 1e6), st.just(np.nan), st.just(np.inf))


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(NUMBERS, NUMBERS), min_size=1, max_size=400), st.integers(4, 60), st.data())
def test_no_extreme_and_no_break_is_lost(rows: list[tuple[float, float]], most: int, draw: st.DataObject) -> None:
    columns = list(np.array(rows, dtype=float).T)
    breaks = np.array(sorted(draw.draw(st.sets(st.integers(1, len(rows)), max_size=5))), dtype=int)
    breaks = breaks[breaks < len(rows)]
    kept = kept_rows(columns, breaks, most)
    assert (np.diff(kept) > 0).all()
    assert {0, len(rows) - 1, *breaks, *(breaks - 1)} <= set(kept.tolist())
    for column in columns:
        finite = column[np.isfinite(column)]
        if len(finite):
            left = column[kept][np.isfinite(column[kept])]
            assert (left.min(), left.max()) == (finite.min(), finite.max())
        assert np.isfinite(column).all() == np.isfinite(column[kept]).all()


def test_a_spike_of_one_sample_in_600_000_stays_and_the_page_stays_small() -> None:
    rng = np.random.default_rng(3)
    values: Array = rng.normal(size=600_000)
    values[413_222], values[90_001] = 99.0, np.nan
    kept = kept_rows([values, np.roll(values, 1000)], np.array([], dtype=int))
    assert {413_222, 90_001} <= set(kept.tolist())
    assert len(kept) < 10_000


def test_every_place_of_a_long_path_is_kept_with_its_smallest_margin() -> None:
    turn = np.linspace(0.0, 400.0 * np.pi, 200_000)
    poses = np.column_stack((np.cos(turn), np.sin(turn)))
    margins = 0.5 + 0.1 * np.random.default_rng(5).random(len(turn))
    margins[123_456] = 0.01
    poses[7] = np.nan
    rows = rows_of_places(poses, margins, 3000)
    assert 123_456 in rows
    assert 7 not in rows
    assert len(rows) <= 3000
    angles = np.sort(np.arctan2(poses[rows, 1], poses[rows, 0]))
    assert np.diff(angles, append=angles[0] + 2.0 * np.pi).max() < 0.02
    assert len(rows_of_places(np.full((4, 2), np.nan), np.full(4, np.nan))) == 0


def test_a_break_is_where_nothing_came_for_long() -> None:
    assert breaks_in(np.array([0.0, 0.01, 0.2, 0.21, np.nan]), 0.1).tolist() == [2, 4]


# --- numbers ----------------------------------------------------------------------------------------------------


def test_smallest_margins_are_those_of_the_recorded_states(type2: BagJudgement) -> None:
    stated = {one["cause"]: one for one in data_of(type2)["summary"]["smallest_margins"]}
    states = [state for state in type2.recording.states if isfinite(state.type2_margin)]
    least = min(states, key=lambda state: state.type2_margin)
    assert stated["TYPE2"]["value"] == least.type2_margin
    assert stated["TYPE2"]["time_s"] == pytest.approx(
        (least.received_ns - type2.recording.begin_ns) / NS_PER_S, abs=1e-9
    )
    assert stated["TYPE2"]["pose"] == dict(zip(("x", "z"), least.pose, strict=True))
    assert stated["TYPE1"]["value"] == min(min(state.type1_margin) for state in states)
    assert "LIMB" not in stated  # this robot has none


def test_a_stop_has_its_time_and_its_distance(type2: BagJudgement) -> None:
    (stop,) = data_of(type2)["summary"]["stops"]
    heard = next(verdict for _log, verdict in type2.recording.verdicts if verdict.level == Level.STOP)
    at_stop = next(s for s in type2.recording.states if s.seen_ns >= heard.since_ns)
    slow = 1e-2
    rest = next(
        s for s in type2.recording.states if s.seen_ns > heard.since_ns and max(map(abs, s.joint_velocity)) < slow
    )
    assert stop["until_rest_s"] == pytest.approx((rest.seen_ns - heard.since_ns) / NS_PER_S, abs=0.005)
    straight = np.hypot(*(np.array(rest.pose) - np.array(at_stop.pose)))  # a vertical motion: way and distance agree
    assert stop["platform_m"] == pytest.approx(straight, rel=0.02)
    assert straight > 0.01
    assert stop["allowed"]["way"] <= stop["allowed"]["allowed"]


def test_the_page_has_the_results_of_replay(tmp_path: Path) -> None:
    for bag in (TYPE2, BAGS / "glitch"):
        target = tmp_path / f"{bag.name}.html"
        assert irsbot("report", bag, "-o", target).code == 0
        held = json.loads(re.search(r'<script type="application/json" id="data">(.*?)</script>', target.read_text())[1])
        stated = json.loads(irsbot("replay", bag, "--json").out)
        for part in ("chapters", "summary", "measures", "checks"):
            assert held[part] == stated[part]
        assert stated["summary"]["smallest_margins"]


def test_rejected_input_is_counted_by_reason() -> None:
    found = judged(BAGS / "nan_positions")
    rejected = data_of(found)["summary"]["rejected"]
    bad = sum(not all(map(isfinite, sample.position)) for sample in found.recording.samples)
    assert bad > 0
    assert rejected[Cause.NONFINITE.name] == bad


def test_a_plot_of_a_short_run_has_every_sample(type2: BagJudgement) -> None:
    margins, *others = data_of(type2)["tracks"]
    assert margins["columns"][1]["name"] == "Type 2 margin"
    recorded = [state.type2_margin for state in type2.recording.states]
    assert margins["columns"][1]["values"] == pytest.approx(recorded, rel=1e-8)
    assert {limit["kind"] for limit in margins["limits"]} == {"stop", "warn"}
    titles = {track["title"] for track in others}
    assert {"Pressure angles", "Leg forces", "Joint positions", "Joint rates", "Platform pose", "Latency"} <= titles


# --- every run --------------------------------------------------------------------------------------------------


def test_joint_states_alone_give_the_page_of_the_run(
    type2: BagJudgement, samples: list[JointSample], tmp_path: Path
) -> None:
    known = data_of(type2)
    own = data_of(judged(alone(tmp_path / "alone.mcap", samples), known["settings"]["robot"]))
    assert [one["value"] for one in own["summary"]["smallest_margins"]] == pytest.approx(
        [one["value"] for one in known["summary"]["smallest_margins"]]
    )
    assert len(own["summary"]["stops"]) == 1
    assert own["posture"]["joints"] == known["posture"]["joints"]
    assert "Type 2 margin" in page(own)


def test_runs_of_one_sample_or_only_unknown_have_pages(samples: list[JointSample], tmp_path: Path) -> None:
    one = data_of(judged(alone(tmp_path / "one.mcap", samples[:1]), "irsbot2_beta45"))
    assert one["summary"]["judged"] == 1
    assert one["span"][0] < one["span"][1]
    assert page(one)
    nan = [sample._replace(position=(np.nan,) * len(sample.position)) for sample in samples[:50]]
    unknown = data_of(judged(alone(tmp_path / "nan.mcap", nan), "irsbot2_beta45"))
    assert unknown["summary"]["verdict"] == {"last": "UNKNOWN", "worst_at_work": None}
    assert unknown["summary"]["rejected"] == {"NONFINITE": 50}
    assert "No posture was known" in page(unknown)
    assert "Nothing ended work" in page(unknown)


def test_a_truncated_bag_reports_its_loss(tmp_path: Path) -> None:
    whole = (TYPE2 / "type2_0.mcap").read_bytes()
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(whole[: int(len(whole) * 0.8)])
    text = page(data_of(judged(cut)))
    assert "The bag is damaged" in text
    assert "never closed" in text


def test_a_run_without_judged_samples_is_refused(type2: BagJudgement) -> None:
    with pytest.raises(BagError, match="not one joint state"):
        page_data(replace(type2, series=Series()))


def test_a_machine_without_jinja2_gets_one_sentence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "jinja2", None)
    monkeypatch.delitem(sys.modules, "irsbot_supervisor.report.page")
    refused = irsbot("report", TYPE2, "-o", tmp_path / "run.html")
    assert (refused.code, "pip install jinja2" in refused.refusal) == (2, True)
    assert list(tmp_path.iterdir()) == []


def test_names_from_a_bag_cannot_become_markup(type2: BagJudgement) -> None:
    data = data_of(type2)
    data["title"] = data["chapters"][0]["text"] = "</script><b>bold"
    text = page(data)
    assert "<b>bold" not in text
    assert "&lt;b&gt;bold" in text


def solved(robot: irs.Robot) -> list[Posture]:
    """Random postures."""
    return [at for at in Machine(robot, 20, 11).postures if at.status == Status.SOLVED]


@pytest.mark.parametrize("name", irs.robots())
def test_every_robot_has_its_drawing_and_its_loci(name: str) -> None:
    mechanism = irs.make_robot(name).mechanism
    at = solved(irs.make_robot(name))[0]
    shown = plain(view(mechanism, at.working_mode, np.array([at.pose])))
    assert shown["links"]
    assert shown["loci"]
    assert bool(shown["section"]) == (not shown["planar"])
    assert shown["planar"] == ({one.name for one in mechanism.task} - {"phi"} != {"x", "y", "z"})
    for locus in shown["loci"]:
        assert all(len(point) == 2 + (not shown["planar"]) for point in locus["points"])


@pytest.mark.parametrize("name", ["rrr3", "rpr3", "orthoglide", "uranesx", "ruu4"])
def test_a_locus_on_a_grid_is_where_the_margin_vanishes(name: str) -> None:
    """A pose on a Type 2 locus has a Type 2 margin near 0, found by the inverse kinematics alone."""
    robot = irs.make_robot(name)
    at = solved(robot)[0]
    points = [
        point
        for locus in view(robot.mechanism, at.working_mode, np.array([at.pose]))["loci"]
        if locus["kind"] == "type2"
        for point in locus["points"]
    ]
    assert points
    margins = []
    for x, y, *rest in points[:: max(1, len(points) // 20)]:
        assert rest == pytest.approx([at.pose[2]] * len(rest), rel=1e-8)
        with contextlib.suppress(irs.Unreachable):
            pose = (x, y, *at.pose[2:])
            joints = robot.inverse(pose, at.working_mode)
            margins.append(min(robot.mechanism.at(tuple(joints), pose, at.assembly_mode, (1.0, 1.0)).cos_pressure))
    assert margins
    assert np.median(margins) < 0.02


@pytest.mark.parametrize("name", ["orthoglide", "linear_delta", "triaglide", "hybridglide", "uranesx", "ruu4"])
def test_the_boundary_of_a_section_parts_what_is_reached_from_what_is_not(name: str) -> None:
    """A step aside from the middle of a chord, either way, by the inverse kinematics alone."""
    robot = irs.make_robot(name)
    for at in solved(robot)[:3]:
        loci_ = view(robot.mechanism, at.working_mode, np.array([at.pose]))["loci"]
        parted = chords = 0
        for points in (np.array(locus["points"]) for locus in loci_ if locus["kind"] == "type1"):
            size = np.ptp(points[:, :2], axis=0).max()
            for (x, y, _z), (to_x, to_y, _) in zip(points[:-1:5], points[1::5], strict=False):
                long = np.hypot(to_x - x, to_y - y)
                if long > 1e-3 * size:
                    aside = 0.01 * size / long
                    sides = [
                        (0.5 * (x + to_x) + way * (y - to_y), 0.5 * (y + to_y) + way * (to_x - x))
                        for way in (aside, -aside)
                    ]
                    parted += len({_reached(robot, (*side, *at.pose[2:]), at.working_mode) for side in sides}) == 2
                    chords += 1
        assert parted > 0.8 * chords > 5  # others are too near a corner


def _reached(robot: irs.Robot, pose: Sequence[float], mode: Sequence[int]) -> bool:
    try:
        robot.inverse(pose, mode)
    except irs.Unreachable:
        return False
    return True


def test_a_section_of_surfaces_is_taken_where_it_is_asked_for() -> None:
    robot = irs.make_robot("orthoglide")
    low, high = sorted(solved(robot)[:2], key=lambda at: at.pose[2])
    poses = np.array([low.pose, high.pose])
    shown = view(robot.mechanism, low.working_mode, poses, low.pose)
    (height,) = {point[2] for locus in shown["loci"] for point in locus["points"]}
    assert height == pytest.approx(low.pose[2], rel=1e-8)
    assert shown["section"] == f"z = {low.pose[2]:.4g} m"
    assert shown["section"] in shown["note"]


def test_a_mechanism_without_a_skeleton_is_drawn_as_a_point_with_a_note(
    type2: BagJudgement, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert type2.judged.machine is not None
    mechanism = type2.judged.machine.mechanism
    monkeypatch.setattr(type(mechanism), "skeleton", lambda self: None)
    shown = view(mechanism, (1, -1), type2.series["pose"])
    assert "does not describe its links" in shown["note"]
    assert shown["links"] == []
    assert set(posture_table(type2.series, mechanism)["joints"]) == {one.name for one in mechanism.joints}
