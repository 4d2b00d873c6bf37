"""Proposed limits against what they promise: forces, errors, warnings that come in time, files that are accepted."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import yaml
from supervised import settings_of
from typer.testing import CliRunner

import irsbot_kinematics as irs
from irsbot_kinematics import Status
from irsbot_msgs_py.records import JointSample, Level
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.cli.app import whole_app
from irsbot_supervisor.cli.common import Failed
from irsbot_supervisor.configuration.loading import read_settings, read_values
from irsbot_supervisor.configuration.proposal import LimitProposal, Plant, propose
from irsbot_supervisor.configuration.stopping_cost import prediction_delay
from irsbot_supervisor.core.settings import InvalidSettings
from irsbot_supervisor.core.stopping import limits_of
from irsbot_supervisor.core.supervisor import Supervisor
from irsbot_supervisor.sim.closed_loop import BEGIN_NS, cycles
from irsbot_supervisor.sim.simulation import simulation_from

pytestmark = pytest.mark.slow

RATE_HZ = 500.0
IRSBOT2 = Plant((12.0,), (400.0,), 0.01, RATE_HZ, 1e-5, 0.0, 0.0, 20.0 / 3.0)


@cache
def guided(name: str, **changes) -> tuple[LimitProposal, irs.Robot]:
    settings, robot = settings_of(name)
    plant = IRSBOT2._replace(
        speed=settings.velocity_limit, deceleration=settings.deceleration_limit, latency_s=settings.latency_s
    )
    return propose(robot, name, plant._replace(**changes)), robot


def values(proposed: LimitProposal) -> dict:
    return {one.name: one.value for one in proposed.proposals}


def reasons(proposed: LimitProposal) -> dict:
    return {one.name: one.why for one in proposed.proposals}


def random_postures(name: str, number: int = 20000) -> tuple[irs.Robot, np.ndarray, irs.Posture]:
    """Random joint positions of the usual modes, apart from the grid that the guide looks at."""
    robot, rng = irs.make_robot(name), np.random.default_rng(3)
    joints = robot.mechanism.joints
    low = [max(j.lower, -np.pi) if j.is_angle else j.lower for j in joints]
    high = [min(j.upper, np.pi) if j.is_angle else j.upper for j in joints]
    Q = rng.uniform(low, high, (number, len(joints)))
    found = robot.evaluate_many(Q)
    usual = (found.status == Status.SOLVED) & (found.working_mode == robot.mechanism.usual_working_mode).all(axis=1)
    return robot, Q[usual], found


# --- what the limits promise ------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["irsbot2", "five_bar"])
@pytest.mark.parametrize("ratio", [3.0, 10.0])
def test_no_leg_carries_more_than_the_force_ratio_where_the_type_2_limit_is_kept(name, ratio):
    limit = values(guided(name, force_ratio=ratio)[0])["type2_stop"]
    robot, Q, _found = random_postures(name, 4000)
    margins = robot.evaluate_many(Q).type2_margin
    kept = Q[margins >= limit][:500]
    worst = max(robot.reaction_max(robot.direct(q), q, 10.0).max() for q in kept) / 10.0
    assert worst <= ratio
    nearly = Q[(margins < limit) & (margins > 0.8 * limit)][:50]
    assert max(robot.reaction_max(robot.direct(q), q, 10.0).max() for q in nearly) / 10.0 > ratio, "no limit at all"


@pytest.mark.parametrize("error", [{"encoder_offset": 0.02}, {"geometry_tolerance_m": 0.002}])
def test_limits_grow_with_errors_until_twice_the_error_is_left(error):
    """Compared with margins that are computed at wrong joints, or with a wrong length of a crank."""
    stated = values(guided("irsbot2", force_ratio=50.0, **error)[0])
    robot, Q, _found = random_postures("irsbot2")
    found = robot.evaluate_many(Q)
    margin = found.type1_margin.min(axis=1)
    near = Q[np.abs(margin - 0.02) < 0.01]
    assert len(near) > 50
    if "encoder_offset" in error:
        offset = error["encoder_offset"]
        wrong = [robot.evaluate_many(near + offset * np.array(signs)) for signs in ((1, 1), (1, -1), (-1, 1))]
    else:
        geometry = robot.mechanism.geometry
        longer = irs.make_robot("irsbot2", l1=geometry.l1 + error["geometry_tolerance_m"])
        wrong = [longer.evaluate_many(near)]
    true = robot.evaluate_many(near).type1_margin.min(axis=1)
    seen = np.array([np.abs(other.type1_margin.min(axis=1) - true) for other in wrong])
    assert stated["type1_stop"] >= 2.0 * np.nanquantile(seen, 0.5)
    assert stated["type1_stop"] > 0.02  # 1/50 would be enough for forces
    assert "times that has to be left" in reasons(guided("irsbot2", force_ratio=50.0, **error)[0])["type1_stop"]


def way_of_heeding(speed: float, gain: float, brake: float, latency_s: float, period_s: float, error: float) -> float:
    """How far the far end of what a joint can reach moves after a warning that is one period late: the joint is braked
    in small steps, and at each of them what it could reach is integrated, in small steps too."""
    spans = [period_s * 2**k for k in range(20)]
    more = min([speed, *[4.0 * error / span + 0.5 * (gain + brake) * span for span in spans]])

    def farthest(v: float) -> float:
        way, step = 0.0, 1e-5
        for _ in range(round((2.0 * period_s + latency_s) / step)):
            faster = min(v + gain * step, speed)
            way, v = way + 0.5 * (v + faster) * step, faster
        return way + v * v / (2.0 * brake)

    went, v, ends = 0.0, speed, []
    while v > 0.0:
        ends.append(went + farthest(min(v + more, speed)))
        slower = max(v - brake * 2e-4, 0.0)
        went, v = went + 0.5 * (v + slower) * 2e-4, slower
    return speed * (period_s + latency_s) + max(ends) - farthest(speed)


@pytest.mark.parametrize(("gain", "latency_s"), [(400.0, 0.01), (100.0, 0.01), (400.0, 0.03)])
def test_warnings_come_early_enough_for_the_growth_of_the_reachable_box(gain, latency_s):
    stated = reasons(guided("irsbot2", acceleration=(gain,), latency_s=latency_s)[0])["type2_warn"]
    way = way_of_heeding(12.0, gain, 400.0, latency_s, 1.0 / RATE_HZ, 0.5e-5 + 5e-5 * 12.0)
    assert float(stated.split("still goes on by ")[1].split(" rad")[0]) == pytest.approx(way, rel=6e-3)


def test_a_warning_limit_is_the_margin_at_the_computed_distance_before_the_stop_limit():
    """On straight ways of both joints through random postures that end at the Type 2 limit."""
    stated = values(guided("irsbot2")[0])
    way = way_of_heeding(12.0, 400.0, 400.0, 0.01, 1.0 / RATE_HZ, 0.5e-5 + 5e-5 * 12.0)
    robot, Q, _found = random_postures("irsbot2")
    found = robot.evaluate_many(Q)
    near = np.abs(found.type2_margin - stated["type2_stop"]) < 0.02
    near &= (found.type1_margin.min(axis=1) > stated["type1_stop"]) & (
        found.constraint_margin > stated["constraint_stop"]
    )
    before = [
        robot.evaluate_many(Q[near] + way * np.array(sign)).type2_margin
        for sign in ((1, -1), (-1, 1), (1, 1), (-1, -1))
    ]
    most = np.nanmax(before, axis=0)
    assert near.sum() > 30
    assert 0.8 < (stated["type2_warn"] >= most - 0.02).mean() <= 1.0
    assert (stated["type2_warn"] < most + 0.05).any(), "no earlier than it has to be"


def test_times_follow_from_the_rate():
    stated = values(guided("irsbot2", rate_hz=100.0)[0])
    assert stated["stale_s"] == pytest.approx(4 * 0.01 + 0.02)  # two lost samples, and 20 ms of an ordinary kernel
    assert stated["age_limit_s"] == stated["stale_s"]
    assert stated["heartbeat_s"] == 0.01
    assert stated["standstill_speed"] == pytest.approx(2 * 1e-5 * 100.0)


def test_the_distances_are_those_of_constant_deceleration():
    proposed, robot = guided("irsbot2")
    for row in proposed.stopping:
        free_s = 0.01 + 2 * 0.002  # latency, one period until the next sample, no more to judge it
        assert row.needs == pytest.approx(12.0 * free_s + 12.0**2 / 800.0)
        speed = row.share * 12.0
        assert row.room == pytest.approx(speed * free_s + speed**2 / 800.0, rel=1e-9)
        assert 0.0 < row.platform_m <= row.needs * (robot.mechanism.geometry.l1 / 0.15)  # Type 2: at most 1/margin
    assert proposed.fault == ""


# --- closed loop ------------------------------------------------------------------------------------------------


def run(name: str, scenario: str, seconds: float, path: Path):
    """Levels with their times, and the least margins above the stop limits, of a run under settings from a file."""
    settings, robot = read_settings(name, read_values(path))
    stated = {"robot": name, "scenario": scenario, "rate_hz": RATE_HZ, "latency_s": settings.latency_s}
    stated |= {"velocity_limit": settings.velocity_limit, "deceleration_limit": settings.deceleration_limit}
    levels, way = [], []
    for cycle in cycles(simulation_from(stated, robot), robot, settings):
        time_s = (cycle.now_ns - BEGIN_NS) / NS_PER_S
        if time_s > seconds:
            break
        levels += [(time_s, verdict.level) for verdict in cycle.verdicts]
        way.append(cycle.position)
    found = robot.evaluate_many(np.array(way))
    constraint = np.where(np.isnan(found.constraint_margin), np.inf, found.constraint_margin)
    limb = found.limb_margin.min(axis=1) if found.limb_margin.shape[1] else np.full(len(way), np.inf)
    margins = np.column_stack((found.type1_margin.min(axis=1), found.type2_margin, constraint, limb))
    return levels, (margins - np.array(limits_of(settings, "stop"))).min(), np.ptp(np.array(way)[-20:], axis=0).max()


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """The file of proposed limits of a robot, written once."""

    @cache
    def file_of(name: str) -> Path:
        file = tmp_path_factory.mktemp(name) / "mine.yaml"
        done = CliRunner().invoke(whole_app(), ["limits", name, "--rate", f"{RATE_HZ:g}", "-o", str(file)])
        assert done.exit_code == 0, done.output
        return file

    return file_of


@pytest.mark.parametrize(
    ("name", "scenario"),
    [("irsbot2", "workspace_boundary"), ("irsbot2_beta45", "type2"), ("irsbot2_csc", "constraint")],
)
def test_a_robot_under_proposed_limits_is_warned_in_time_and_stands_before_a_stop_limit(name, scenario, written):
    file = written(name)
    levels, spare, moved = run(name, scenario, 1.0, file)
    warned = next(time_s for time_s, level in levels if level == Level.WARN)
    stopped = next(time_s for time_s, level in levels if level == Level.STOP)
    assert stopped - warned >= 0.01 + 0.002  # latency and a period: who heeds the warning is not stopped
    assert spare >= 0.0
    assert moved == 0.0


def true_minimum(robot: irs.Robot, q: np.ndarray, ways: np.ndarray) -> np.ndarray:
    """Margins on a grid over what the joints can reach."""
    axes = [np.linspace(a - way, a + way, 5) for a, way in zip(q, ways, strict=True)]
    found = robot.evaluate_many(np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(q)))
    constraint = np.where(np.isnan(found.constraint_margin), np.inf, found.constraint_margin)
    limb = found.limb_margin.min(axis=1) if found.limb_margin.shape[1] else np.full(len(found.status), np.inf)
    return np.column_stack((found.type1_margin.min(axis=1), found.type2_margin, constraint, limb)).min(axis=0)


@pytest.mark.parametrize("name", ["irsbot2", "irsbot2_beta45", "orthoglide"])
def test_work_far_from_singularities_keeps_the_warning_limits_wherever_drives_can_get(name, written):
    """Speeds are those between two positions, and 2 rad/s or 0.1 m/s more, as the observer knows them no better."""
    settings, robot = read_settings(name, read_values(written(name)))
    stated = {"robot": name, "scenario": "pick_and_place", "rate_hz": RATE_HZ, "latency_s": settings.latency_s}
    stated |= {"velocity_limit": settings.velocity_limit, "deceleration_limit": settings.deceleration_limit}
    most, brake = np.array(settings.velocity_limit), np.array(settings.deceleration_limit)
    more = 2.0 if name != "orthoglide" else 0.1
    free_s, last, margins = settings.latency_s + 2.0 / RATE_HZ, None, []
    for number, cycle in enumerate(cycles(simulation_from(stated, robot), robot, settings)):
        if number >= RATE_HZ:
            break
        q = np.array(cycle.position)
        if last is not None and number % 10 == 0:
            v = np.minimum(np.abs(q - last) * RATE_HZ + more, most)
            end = np.minimum(v + brake * free_s, most)
            margins.append(true_minimum(robot, q, 0.5 * (v + end) * free_s + end**2 / (2.0 * brake)))
        last = q
    assert len(margins) > 40
    assert (np.min(margins, axis=0) >= limits_of(settings, "warn")).all()


@pytest.mark.parametrize("name", ["irsbot2", "irsbot2_beta45", "orthoglide"])
def test_work_far_from_singularities_is_never_stopped(name, written):
    """Nor warned, where a few cuts prove that it need not: of the constraint margin of two robots they do not."""
    levels, spare, moved = run(name, "pick_and_place", 1.0, written(name))
    seen = {level for time_s, level in levels if time_s > 0.16}
    assert seen <= ({Level.OK, Level.WARN} if name in ("irsbot2", "irsbot2_beta45") else {Level.OK})
    assert spare > 0.0
    assert moved > 0.0


@pytest.mark.parametrize("rates", [(-12.0, 12.0), (12.0, -12.0), (-12.0, 0.0), (12.0, 0.0)])
def test_who_heeds_the_warning_is_not_stopped(rates, written):
    """Cranks speed up to a limit as hard as they can; the joints brake latency_s after the first WARN. They move only
    once it is known how often samples come, as nobody is warned in time before that."""
    file = written("irsbot2")
    known_s = 2.0 * read_values(file)["stale_s"]
    # Of the constraint margin nothing may be proved from the beginning on: the others have to warn.
    settings, robot = read_settings("irsbot2", {**read_values(file), "constraint_warn": 0.053})
    supervisor = Supervisor(settings, robot)
    q, speed, part = np.array(robot.inverse((0.0, -0.85))), np.zeros(2), 0.1 / RATE_HZ
    levels, braking_at, warned_at = [], np.inf, 0.0
    for k in range(200):
        t = k / RATE_HZ
        stamps = BEGIN_NS + round(t * NS_PER_S), BEGIN_NS + round(t * NS_PER_S), NS_PER_S + round(t * NS_PER_S)
        step = supervisor.step(JointSample(*stamps, settings.joint_names, tuple(q), tuple(speed)))
        levels += [step.state.level] if t > known_s else []
        if levels and levels[-1] == Level.WARN and braking_at == np.inf:
            braking_at, warned_at = t + settings.latency_s, np.abs(speed).max()
        for i in range(10):
            braking = t + (i + 0.5) * part > braking_at
            goal = np.zeros(2) if braking or t < known_s else np.array(rates)
            slower = speed + np.clip(goal - speed, -400.0 * part, 400.0 * part)
            q, speed = q + 0.5 * (speed + slower) * part, slower
    assert warned_at == 12.0
    assert Level.STOP not in levels
    assert np.abs(speed).max() == 0.0


# --- the command ------------------------------------------------------------------------------------------------


def test_the_file_has_the_reasons_and_is_read_back_with_the_same_numbers(written):
    file = written("irsbot2")
    stated = yaml.safe_load(file.read_text())["/**"]["ros__parameters"]
    proposed = {one.name: one.value for one in guided("irsbot2")[0].proposals}
    assert stated == {"robot": "irsbot2", **{k: list(v) if isinstance(v, tuple) else v for k, v in proposed.items()}}
    settings, _robot = read_settings("irsbot2", read_values(file))
    assert settings.type2_stop == stated["type2_stop"]
    assert file.read_text().count("  # ") == len(proposed)
    assert all(isinstance(value, (float, list, str)) for value in stated.values()), (
        "ROS refuses an integer for a double"
    )


def test_a_contradiction_is_reported_with_both_numbers_and_no_file_is_written(tmp_path):
    file = tmp_path / "mine.yaml"
    done = CliRunner().invoke(whole_app(), ["limits", "irsbot2", "--deceleration", "20", "-o", str(file)])
    assert isinstance(done.exception, Failed)
    assert "needs 3.72 rad to stop" in str(done.exception)
    assert not file.exists()
    assert "3.74 rad" in done.output  # with 2 ms until the next sample is judged: the table is there to find out why


def test_json_has_settings_reasons_and_distances():
    done = CliRunner().invoke(whole_app(), ["limits", "orthoglide", "--speed", "2", "--json"])
    stated = json.loads(done.output)
    assert stated["settings"]["velocity_limit"] == [2.0, 2.0, 2.0]
    assert set(stated["reasons"]) == set(stated["settings"]) - {"robot"}
    assert stated["stopping"][0]["needs"] == pytest.approx(2.0 * 0.012 + 4.0 / 80.0)
    assert stated["costs"][0]["machine"] == "as stated"
    assert stated["contradiction"] == ""


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"speed": (1.0, 2.0, 3.0)}, "velocity_limit has 3 values"),
        ({"speed": (-1.0,)}, "velocity_limit is -1.0"),
        ({"latency_s": float("nan")}, "latency_s"),
        ({"rate_hz": 0.0}, "the rate is 0.0"),
        ({"rate_hz": float("nan")}, "the rate is nan"),
        ({"force_ratio": 1.0}, "the force ratio is 1.0"),
        ({"encoder_offset": 1.0}, "encoder_offset is 1.0"),
    ],
)
def test_numbers_that_are_none_are_refused_by_name(changes, words):
    with pytest.raises(InvalidSettings, match=words):
        guided("irsbot2", **changes)


def test_errors_larger_than_any_margin_leave_a_guide_with_a_fault():
    proposed, _robot = guided("irsbot2", geometry_tolerance_m=0.1)
    assert proposed.fault
    assert all(row.share == 0.0 for row in proposed.stopping)


def test_a_stated_time_to_judge_is_part_of_every_distance_and_of_the_proposed_file() -> None:
    """Twice: while a sample is judged, the next one waits."""
    plain, timed = (guided("irsbot2", **stated)[0] for stated in ({}, {"judging_s": 0.0075, "bounding_s": 0.0005}))
    delays_s = [
        prediction_delay(settings_of("irsbot2", **one)[0], 1.0 / RATE_HZ) for one in ({}, {"judging_s": 0.0075})
    ]
    assert delays_s == pytest.approx([2.0 / RATE_HZ, 2.0 * 0.0075])
    grown_s = [after.free_s - before.free_s for after, before in zip(timed.costs, plain.costs, strict=True)]
    assert grown_s[0] == pytest.approx(2.0 * (0.0075 - 1.0 / RATE_HZ))
    assert timed.together < plain.together
    assert {"judging_s", "bounding_s"} & values(plain).keys() == set()
    assert (values(timed)["judging_s"], values(timed)["bounding_s"]) == (0.0075, 0.0005)


def test_with_fewer_cuts_less_speed_is_proved_to_be_stopped() -> None:
    together = [guided("irsbot2", judging_s=0.0027, bounding_s=box_s)[0].together for box_s in (0.0009, 0.0001)]
    assert together[0] < 0.9 * together[1]


@pytest.mark.parametrize("words", [("--speed", "3"), ("--urdf", "x.urdf"), ("--force-ratio", "3"), ("--latency", "1")])
def test_a_measurement_takes_no_data_of_another_machine(words: tuple[str, str]) -> None:
    done = CliRunner().invoke(whole_app(), ["limits", "irsbot2", "--measure", *words])
    assert isinstance(done.exception, irs.BadInput)
    assert "--seconds" in str(done.exception)
