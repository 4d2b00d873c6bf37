"""What attacks the supervisor: its own model of drives and errors, its oracle, and that the row tells good from bad."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from fake_supervisors import FakeBoxSupervisor, FakeHastySupervisor, FakeLenientSupervisor
from hypothesis import given
from hypothesis import strategies as st

from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.configuration.loading import read_settings
from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.validation.harness.oracle import Array, accelerations, stamp_jitter_s
from irsbot_supervisor.validation.harness.rows import Job, Row
from irsbot_supervisor.validation.in_process import adversary, assault, edges, reachable, schemes
from irsbot_supervisor.validation.in_process.deceit import BEGIN_NS, ERRORS, LAG_S, LIES, Attack, Deceit, Timing, told
from irsbot_supervisor.validation.in_process.hostile import DrivenMotion, Push

pytestmark = pytest.mark.slow

SEEDS = st.integers(0, 2**32 - 1)
FINE_S = 2e-5


def settings_of(coarse: bool = False) -> Settings:
    changes = {"encoder_resolution": 1e-3, "encoder_offset": 3e-4} if coarse else {}
    return read_settings("orthoglide", changes)[0]


def hostile(settings: Settings, seconds: float, rng: np.random.Generator) -> DrivenMotion:
    """Joints that go to and fro, each by itself, with braking up to 20 times harder than allowed for speeding up."""
    pushes, t, full = [], 0.0, np.array(settings.velocity_limit)
    while t < seconds:
        speeds = rng.choice((-2.0, -1.0, 0.0, 1.0, 2.0, rng.uniform(-1.0, 1.0)), len(full)) * full
        pushes.append(Push(t, speeds, rng.uniform(0.2, 1.0), 20.0 ** rng.random()))
        t += rng.choice((0.002, 0.01, 0.2)) * rng.random()
    return DrivenMotion(rng.uniform(0.0, 3.0, len(full)), pushes, settings)


def deceived(driven: DrivenMotion, settings: Settings, errors: str, number: int, rng: np.random.Generator) -> list[Any]:
    timing = Timing(float(rng.choice((0.0005, 0.001, 0.002))), 1, 0.0)
    deceit = Deceit.drawn("missing", errors, number, 3, rng)
    attack = Attack(rng.uniform(0.0, number * timing.period_s), rng.choice((-1.0, 1.0), 3))
    return [timing.period_s, *told(driven, attack, deceit, timing, settings, 0, 0, number)]


# --- the drives -----------------------------------------------------------------------------------------------------


@given(SEEDS)
def test_hostile_joints_keep_their_limits(seed: int) -> None:
    settings = settings_of()
    times = np.arange(0.0, 0.3, FINE_S)
    position, speed = hostile(settings, 0.3, np.random.default_rng(seed)).at(times)
    most, gain = np.array(settings.velocity_limit), np.array(accelerations(settings))
    assert (np.abs(speed) <= most * (1.0 + 1e-12)).all()
    assert (np.abs(np.diff(position, axis=0)) <= most * FINE_S * (1.0 + 1e-6)).all()
    assert (np.diff(np.abs(speed), axis=0) <= gain * FINE_S * (1.0 + 1e-6)).all(), "it speeds up too hard"
    # The positions are those of the speeds: by the trapezoid rule, whose error is an eighth of the change of speed.
    mean = 0.5 * (speed[1:] + speed[:-1])
    assert (np.abs(np.diff(position, axis=0) - mean * FINE_S) <= 20.0 * gain * FINE_S**2).all()


@given(SEEDS)
def test_brakes_take_exactly_as_long_as_promised(seed: int) -> None:
    settings, rng = settings_of(), np.random.default_rng(seed)
    driven, begin_s = hostile(settings, 0.2, rng), rng.uniform(0.0, 0.25)
    brakes = np.array(settings.deceleration_limit) * rng.uniform(1.0, 5.0, 3)
    braked, rest_s = driven.braked(begin_s, brakes)
    (position,), (speed,) = driven.at(np.array([begin_s]))
    assert rest_s == pytest.approx(begin_s + (np.abs(speed) / brakes).max())
    times = np.array([0.5 * begin_s, begin_s + 0.3 * (rest_s - begin_s), rest_s + 1e-9, rest_s + 1.0])
    where, how_fast = braked.at(times)
    assert where[0] == pytest.approx(driven.at(times)[0][0])
    passed = np.minimum(times[1] - begin_s, np.abs(speed) / brakes)
    assert how_fast[1] == pytest.approx(speed - np.sign(speed) * brakes * passed, abs=1e-9)
    assert not how_fast[2:].any()
    assert where[2] == pytest.approx(position + 0.5 * speed * np.abs(speed) / brakes)
    assert where[3] == pytest.approx(where[2])


# --- what is told ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("errors", ERRORS)
def test_positions_and_stamps_are_as_wrong_as_allowed_and_no_more(errors: str) -> None:
    settings, rng = settings_of(coarse=True), np.random.default_rng(4)
    driven = hostile(settings, 0.2, rng)
    period_s, *samples = deceived(driven, settings, errors, 300, rng)
    truth = driven.at(np.arange(300) * period_s)[0]
    wrong = np.array([sample.position for sample in samples]) - truth
    bound = 0.5 * settings.encoder_resolution + settings.encoder_offset
    assert 0.5 * settings.encoder_resolution * 0.9 < np.abs(wrong).max() <= bound * (1.0 + 1e-9)
    stamps = np.array([sample.stamp_ns for sample in samples])
    late_s = (stamps - BEGIN_NS) / NS_PER_S - np.arange(300) * period_s
    assert (np.diff(stamps) > 0).all()
    assert np.abs(late_s).max() <= stamp_jitter_s(settings) + 1e-9
    assert (np.abs(late_s).max() > 0.9 * stamp_jitter_s(settings)) == (errors != "rounded")


def test_the_false_velocities_match_their_names() -> None:
    settings = settings_of()
    gain = accelerations(settings)[0]
    driven = DrivenMotion(
        np.zeros(3), [Push(0.0, np.array(settings.velocity_limit))], settings
    )  # speeds gain * t for 0.1 s
    timing, n = Timing(0.001, 1, 0.0), 80
    rng = np.random.default_rng(5)

    def last(lie: str) -> Array:
        deceit = Deceit.drawn(lie, "rounded", n, 3, rng)
        return np.array(told(driven, Attack(0.05, np.ones(3)), deceit, timing, settings, 0, 0, n)[-1].velocity)

    true = gain * 0.079
    for lie, share in (("right", 1.0), ("zero", 0.0), ("halved", 0.5), ("doubled", 2.0), ("reversed", -1.0)):
        assert last(lie) == pytest.approx(np.full(3, share * true)), lie
    assert last("late") == pytest.approx(np.full(3, true - gain * LAG_S))
    assert last("filtered") == pytest.approx(np.full(3, true - gain * LAG_S), rel=0.02), "a filter lags by its time"
    assert last("held") == pytest.approx(np.full(3, gain * 0.05))
    assert last("missing").shape == (0,)
    assert np.isnan(last("one not a number")).tolist() == [True, False, False]
    assert np.abs(last("noisy") - true).max() > 0.01 * true
    assert set(LIES) == {
        *("right", "zero", "halved", "doubled", "reversed", "late", "filtered", "held", "missing", "noisy"),
        "one not a number",
    }


# --- the oracle -----------------------------------------------------------------------------------------------------


@given(SEEDS, st.booleans(), st.sampled_from(ERRORS))
def test_no_joint_exceeds_the_speed_or_the_box_of_the_oracle(seed: int, coarse: bool, errors: str) -> None:
    settings, rng, number = settings_of(coarse), np.random.default_rng(seed), 120
    driven = hostile(settings, 0.3, rng)
    period_s, *samples = deceived(driven, settings, errors, number, rng)
    stamps = np.array([(sample.stamp_ns - BEGIN_NS) / NS_PER_S for sample in samples])
    positions = np.array([sample.position for sample in samples])
    ahead, back = reachable.fastest(stamps, positions, settings)
    true = driven.at(stamps)[1]
    assert (true <= ahead + 1e-9).all()
    assert (-true <= back + 1e-9).all()
    unseen_s = rng.uniform(0.001, 0.02)
    low, high = reachable.boxes(stamps, positions, settings, unseen_s)
    for k in range(1, number, 7):
        brake_s = stamps[k] + (unseen_s + settings.latency_s) * rng.choice((1.0, rng.random()))
        brakes = np.array(settings.deceleration_limit) * rng.choice((1.0, 3.0), 3)
        braked, rest_s = driven.braked(brake_s, brakes)
        way = braked.at(np.linspace(k * period_s, rest_s + 1e-6, 100))[0]
        assert (low[k] <= way).all()
        assert (way <= high[k]).all()


def test_a_late_stamp_makes_a_position_older_than_its_stamp() -> None:
    """A joint at full speed, exact encoders: the box has to hold what it moves in the jitter of the stamp, too."""
    settings, unseen_s = settings_of(), 0.003
    driven = DrivenMotion(np.zeros(3), [Push(0.0, np.array(settings.velocity_limit))], settings)
    times = np.arange(0.0, 0.3, 0.001)
    stamps = times + stamp_jitter_s(settings)
    _, high = reachable.boxes(stamps, driven.at(times)[0], settings, unseen_s)
    braked, rest_s = driven.braked(stamps[-1] + unseen_s + settings.latency_s, np.array(settings.deceleration_limit))
    reached = braked.at(np.array([rest_s]))[0][0]
    assert (reached <= high[-1] + 1e-9).all()
    encoder = 0.5 * settings.encoder_resolution + settings.encoder_offset
    narrower = high[-1] - reachable.errors(settings) + encoder
    assert (reached > narrower).all(), "the error of the encoder alone is not enough"


def test_the_box_is_no_wider_than_it_has_to_be() -> None:
    """All that the drives can do is done: nothing of the box is left but errors and what the observer cannot know."""
    settings = settings_of()
    gain, unseen_s = accelerations(settings)[0], 0.003
    full = np.array(settings.velocity_limit)
    driven = DrivenMotion(np.zeros(3), [Push(0.05, full)], settings)
    stamps = np.arange(0.0, 0.0501, 0.001)
    _, high = reachable.boxes(stamps, driven.at(stamps)[0], settings, unseen_s)
    brake_s = stamps[-1] + unseen_s + settings.latency_s
    braked, rest_s = driven.braked(brake_s, np.array(settings.deceleration_limit))
    reached = braked.at(np.array([rest_s]))[0][0]
    # At rest the observer knows a speed up to what 2 errors look like: sqrt(4 error gain), and half as much again
    # because samples are looked back at 1, 2, 4 ... periods.
    doubt = 1.5 * np.sqrt(4.0 * reachable.errors(settings) * gain)
    horizon_s = unseen_s + settings.latency_s
    wider = doubt * horizon_s + (2.0 * gain * horizon_s * doubt + doubt**2) / (2.0 * gain) + reachable.errors(settings)
    assert (reached <= high[-1]).all()
    assert (high[-1] <= reached + wider).all()


@pytest.mark.parametrize("name", ["irsbot2", "rrr3_base"])
def test_the_least_margins_of_a_box_are_no_more_than_at_its_corners_and_in_its_middle(name: str) -> None:
    settings, robot = read_settings(name)
    rng = np.random.default_rng(6)
    middles = edges.good_postures(robot, settings, 4, rng)
    half = rng.uniform(0.0, 0.03, middles.shape)
    begins = [robot.mechanism.posture(tuple(q), settings.assembly_mode) for q in middles.tolist()]
    least = reachable.least_margins(robot, settings, middles - half, middles + half, begins)
    for middle, width, begin, found in zip(middles, half, begins, least, strict=True):
        corners = np.array(np.meshgrid(*([(-1.0, 1.0)] * len(middle)))).reshape(len(middle), -1).T
        for corner in (0.0 * corners[0], *corners):
            at = robot.mechanism.track(tuple((middle + corner * width).tolist()), begin)
            assert found[0] <= min(at.type1) + 1e-9
            assert found[1] <= at.type2 + 1e-9


# --- the row tells a supervisor that holds from one that does not ---------------------------------------------------


def row_against(fake: type, monkeypatch: pytest.MonkeyPatch, amount: int, *robots: str) -> Row:
    monkeypatch.setattr(assault, "Supervisor", fake)
    monkeypatch.setattr(edges, "Supervisor", fake)
    return adversary.run(Job(amount, 3, lambda _cases: None, robots))


def test_a_supervisor_that_never_stops_is_found_out(monkeypatch: pytest.MonkeyPatch) -> None:
    row = row_against(FakeLenientSupervisor, monkeypatch, 4, "irsbot2")
    assert row.unsafe > row.amount // 4
    assert row.figures["beyond"] == row.unsafe
    assert row.figures["worst spare, relative to its limit"] < 0.0
    assert "below a stop limit" in row.note


def test_a_supervisor_that_holds_is_not_blamed(monkeypatch: pytest.MonkeyPatch) -> None:
    row = row_against(FakeBoxSupervisor, monkeypatch, 4, "irsbot2")
    assert row.ok, row
    assert row.figures["stopped"] > row.amount // 3, "the attack bites"
    assert row.figures["worst spare, relative to its limit"] >= 0.0


def test_a_run_is_judged_on_the_branch_of_its_first_sample() -> None:
    """Within the errors of the encoders this machine has two assembly modes more, and label 1 is one of them."""
    settings, robot = read_settings("rails3", {"encoder_resolution": 5e-4, "encoder_offset": 2e-4})
    place = np.array([0.25889133878583254, 0.6621460099081425, 0.5769714001357735])
    assert robot.mechanism.posture(tuple(place.tolist()), settings.assembly_mode).type2 < settings.type2_stop
    edge = edges.Edge(settings, Timing(0.001, 1, 0.0), place, place, False, np.ones(3))
    allowed = 0
    for seed in range(8):
        run = assault.Run(robot, edge, schemes.Scheme(place, (), 0.01), "right", "rounded", np.random.default_rng(seed))
        outcome = run.attack(run.lead(), (), np.zeros(3), None)
        allowed += outcome.allowed
        assert not outcome.allowed or outcome.spare > 1.0
    assert allowed > 0, "the fixture proves nothing"


def test_a_robot_that_comes_from_afar_is_let_go_when_it_arrives() -> None:
    """Its line to the limit may pass postures that are not allowed: where the walk is stopped the attack begins."""
    settings, robot = read_settings("rrr3_base")
    places = list(edges.edges(robot, settings, 12, np.random.default_rng([2, 0])))
    afar = [place for place in places if place.afar]
    assert len(afar) > 1, "the fixture proves nothing"
    for place in afar:
        rng = np.random.default_rng(3)
        lead = assault.Run(robot, place, schemes.rest(place, rng), "missing", "rounded", rng).lead()
        assert lead.allowed is not None


def test_a_robot_that_cannot_be_switched_on_near_a_limit_comes_from_afar(monkeypatch: pytest.MonkeyPatch) -> None:
    row = row_against(FakeHastySupervisor, monkeypatch, 4, "irsbot2")
    assert row.unsafe == 0, row
    assert row.figures["stopped"] > row.amount // 4, "the attack bites"
