"""The command gate: what passes, what is slowed down, what is held, and the way out of a stop."""

from __future__ import annotations

from itertools import dropwhile, groupby
from math import inf, nan
from types import SimpleNamespace

import numpy as np
import pytest
from supervised import joints_of, ready, settings_of, tick

import irsbot_kinematics as irs
from irsbot_msgs_py.gate_status import GateOutcome, GateReason
from irsbot_msgs_py.records import Cause, Level
from irsbot_supervisor.core.estimation.estimate import Speeds
from irsbot_supervisor.core.estimation.observer import excess
from irsbot_supervisor.core.margins import margins_of, slopes
from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.core.stopping import StoppingPredictor, limits_of, release_of
from irsbot_supervisor.gate.answer import PASSED, Answer
from irsbot_supervisor.gate.velocity_gate import Gate
from irsbot_supervisor.sim.closed_loop import GuidedRobot

pytestmark = pytest.mark.slow

ROBOTS = ("irsbot2", "irsbot2_beta45", "irsbot2_csc", "five_bar", "rrr3", "orthoglide", "triaglide")
LOST = 0.003
"""What a margin may lose on the way out, of 0.15 that it has: the bounds of a short way are that near to the truth."""

RESERVE = 0.02
"""Share above the stop limits that is kept, as docs/explanation/verdicts.md says."""

BEATS_TO_SEEK = 12
"""Heartbeats after which the gate has found what passes of a command, where nothing changes."""

AT_REST_BEATS = 16
"""Heartbeats after which a standing robot is OK."""


def margins(robot: irs.Robot, settings: Settings, joints) -> np.ndarray:
    """The four margins from the vectorised library, not from the core; infinite where the robot has none."""
    found = robot.evaluate_many(np.array([joints]), settings.assembly_mode)
    limb = found.limb_margin[0].min() if found.limb_margin.shape[1] else inf
    constraint = found.constraint_margin[0]
    row = [found.type1_margin[0].min(), found.type2_margin[0], inf if np.isnan(constraint) else constraint, limb]
    return np.array(row) if found.status[0] == irs.Status.SOLVED else np.zeros(4)


def standing(name: str, joints=None) -> GuidedRobot:
    guided = at_rest(name, good_posture(name) if joints is None else joints)
    assert guided.now.level == Level.OK
    return guided


def good_posture(name: str, seed: int = 0) -> tuple[float, ...]:
    """Joint positions in the usual mode with room around them."""
    settings, robot = settings_of(name)
    rng = np.random.default_rng(seed)
    joints = robot.mechanism.joints
    low = [max(joint.lower, -np.pi) for joint in joints]
    high = [min(joint.upper, np.pi) for joint in joints]
    for _ in range(20_000):
        q = rng.uniform(low, high)
        at = robot.mechanism.posture(tuple(q), settings.assembly_mode)
        if at.working_mode == settings.working_mode and roomy(robot, settings, q):
            return tuple(q.tolist())
    raise AssertionError("no posture with room was found")


def roomy(robot: irs.Robot, settings: Settings, joints) -> bool:
    """Whether no warning is due while it stands there, and a little more is left."""
    at = robot.mechanism.posture(tuple(joints), settings.assembly_mode)
    rest = excess(settings, 1e-3)
    certified = StoppingPredictor(settings, robot.mechanism).predict(at, Speeds(rest, rest), 0.004)
    return bool((np.array(certified) >= np.array(limits_of(settings, "warn"))).all())


def stopped(name: str, seed: int, share: float = 0.9) -> GuidedRobot:
    """A robot that ran at a share of full speed, past the gate, at a limit, and was stopped."""
    rng = np.random.default_rng(seed)
    while True:
        guided = standing(name, good_posture(name, int(rng.integers(2**31))))
        limits = np.array(guided.settings.velocity_limit)
        direction = rng.normal(size=len(limits))
        rates = share * limits * direction / np.abs(direction).max()
        for _ in range(round(180 / share)):
            guided.rush(tuple(rates))
            if guided.now.level >= Level.STOP:
                break
        while not guided.supervisor.standing:
            guided.drift()
        for _ in range(AT_REST_BEATS):
            guided.drift()
        if guided.now.level == Level.STOP:
            return guided


def at_rest(name: str, joints, **changes) -> GuidedRobot:
    """A robot that has been at these joint positions ever since."""
    settings, robot = settings_of(name, **changes)
    guided = GuidedRobot(robot, settings, tuple(joints))
    for _ in range(AT_REST_BEATS):
        guided.drift()
    return guided


def beyond(name: str, seed: int = 0) -> tuple[GuidedRobot, int]:
    """A robot that stands a little beyond the stop limit of one margin, well within the others, and that margin."""
    settings, robot = settings_of(name)
    stop, rng = np.array(limits_of(settings, "stop")), np.random.default_rng(seed)
    low = [max(joint.lower, -np.pi) for joint in robot.mechanism.joints]
    high = [min(joint.upper, np.pi) for joint in robot.mechanism.joints]
    while True:
        q = rng.uniform(low, high)
        at = robot.mechanism.posture(tuple(q.tolist()), settings.assembly_mode)
        if at.status != irs.Status.SOLVED or at.working_mode != settings.working_mode:
            continue
        ratios = np.array(margins_of(at)) / stop
        kind = int(ratios.argmin())
        if 0.8 < ratios[kind] < 0.95 and np.sort(ratios)[1] > 2.0:
            guided = at_rest(name, q.tolist())
            if guided.now.level == Level.STOP and guided.way_out:
                return guided, kind


def causes(guided: GuidedRobot) -> list[int]:
    kinds = (Cause.TYPE1, Cause.TYPE2, Cause.CONSTRAINT, Cause.LIMB)
    return [index for index, kind in enumerate(kinds) if guided.now.causes & int(kind)]


# --- velocities -------------------------------------------------------------------------------------------------


def test_a_velocity_far_from_every_limit_passes_as_it_is():
    supervisor, _ = ready("irsbot2")
    gate = Gate(supervisor.settings, supervisor.robot.mechanism)
    assert gate.velocity((0.5, -0.25), supervisor.view) == ((0.5, -0.25), PASSED)


def test_a_velocity_above_the_limit_keeps_its_direction():
    supervisor, _ = ready("irsbot2")
    gate = Gate(supervisor.settings, supervisor.robot.mechanism)
    fastest = supervisor.settings.velocity_limit[0]
    allowed = gate.velocity((0.0, 1e300), supervisor.view)
    assert allowed.rates[0] == 0.0
    assert 0.0 < allowed.rates[1] <= fastest * (1.0 + 1e-12)
    assert allowed.answer == Answer(GateOutcome.SLOWED, GateReason.SPEED, share=pytest.approx(fastest / 1e300))


@pytest.mark.parametrize("wanted", [(), (0.1,), (0.1, 0.1, 0.1), (nan, 0.0), (0.0, inf), (-inf, nan)])
def test_an_invalid_velocity_is_held(wanted):
    supervisor, _ = ready("irsbot2")
    gate = Gate(supervisor.settings, supervisor.robot.mechanism)
    allowed = gate.velocity(wanted, supervisor.view)
    assert allowed.rates == (0.0, 0.0)
    assert "2 finite velocities" in allowed.answer.text


def test_nothing_moves_while_the_state_is_not_known():
    supervisor, _ = ready("irsbot2")
    view = supervisor.view
    gate = Gate(supervisor.settings, supervisor.robot.mechanism)
    assert view is not None
    assert gate.velocity((0.1, 0.1), None).rates == (0.0, 0.0)
    unknown = view._replace(judgement=view.judgement._replace(level=Level.UNKNOWN, speed_scale=0.0))
    assert gate.velocity((0.1, 0.1), unknown).rates == (0.0, 0.0)


def test_the_view_ends_when_samples_stop():
    supervisor, _ = ready("irsbot2")
    assert supervisor.view is not None
    supervisor.step(tick(1000.0))
    assert supervisor.view is None


def test_a_command_near_a_limit_is_cut_the_more_the_older_the_newest_sample_is():
    guided = standing("irsbot2", good_posture("irsbot2", 0))
    limits = np.array(guided.settings.velocity_limit)
    direction = np.random.default_rng(0).normal(size=len(limits))
    wanted = tuple(0.3 * limits * direction / np.abs(direction).max())  # a heartbeat of braking makes it rest
    assert any(guided.beat(wanted).answer.text for _ in range(150)), "the run met no limit: it proves nothing"
    view = guided.supervisor.view
    assert view is not None
    shares = []
    for age_ms in (0.0, 1.0, 2.0):
        aged = view.aged(view.seen_ns + round(age_ms * 1e6))
        assert aged.prediction_delay_s == pytest.approx(view.prediction_delay_s + 1e-3 * age_ms)
        gate = Gate(guided.settings, guided.supervisor.robot.mechanism)
        shares.append(max(max(map(abs, gate.velocity(wanted, aged).rates)) for _ in range(BEATS_TO_SEEK)))
    assert shares[0] > shares[1] > shares[2]


@pytest.mark.parametrize("name", ROBOTS)
def test_a_robot_driven_at_a_limit_comes_to_rest_before_it_without_a_stop(name):
    guided = standing(name, good_posture(name, 0))
    robot, settings = guided.supervisor.robot, guided.settings
    limits = np.array(settings.velocity_limit)
    direction = np.random.default_rng(0).normal(size=len(limits))
    wanted = tuple(limits * direction / np.abs(direction).max())
    stop = np.array(limits_of(settings, "stop"))
    limited = 0
    for _ in range(150):
        limited += bool(guided.beat(wanted).answer.text)
        assert (margins(robot, settings, guided.drives.now.position) >= stop).all()
        if limited == 30:
            break
    assert limited, "the run met no limit: it proves nothing"
    assert guided.now.event == 0, guided.now.findings


@pytest.mark.parametrize("safe", [0.9, 0.5, 0.1, 0.03])
@pytest.mark.parametrize("wanted", [(12.0, -12.0), (-12.0, 12.0)], ids=str)
@pytest.mark.parametrize("changing", [False, True], ids=["the same", "changing"])
def test_a_command_takes_a_few_predictions_and_is_sought_further_with_the_next(safe, wanted, changing, monkeypatch):
    """Samples are not judged meanwhile. Here a robot at rest could be stopped from speeds up to a share `safe`."""
    supervisor, _ = ready("irsbot2")
    view, gate, made = supervisor.view, Gate(supervisor.settings, supervisor.robot.mechanism), []
    assert view is not None

    def share_of(rates) -> float:
        return max(map(abs, rates)) / supervisor.settings.velocity_limit[0]

    def predict(_at, speeds, *_more):
        made.append(speeds)
        fastest = max(*speeds.forward, *speeds.backward) - max(excess(supervisor.settings, 0.5 * view.expected_s))
        return (1.0 if share_of((fastest,)) <= safe else 0.0,) * 4

    monkeypatch.setattr(gate, "_predictor", SimpleNamespace(predict=predict))
    heard = []
    for beat in range(BEATS_TO_SEEK):
        made.clear()
        slower = 1.0 - 1e-3 * beat * changing
        heard.append(share_of(gate.velocity([slower * rate for rate in wanted], view).rates))
        assert len(made) <= 4  # of them one for the margins here
    assert all(passed <= safe for passed in heard)
    assert all(0.7 * safe <= passed for passed in heard[-3:])
    assert safe >= 0.4 or heard[0] == 0.0, "the first answer was the last: the test proves nothing"


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_motion_along_a_limit_passes_and_motion_towards_it_is_blocked(sign):
    """A five-bar near a limit is commanded along it at 1 rad/s and towards it at 6 rad/s."""
    guided = standing("five_bar", good_posture("five_bar", 2))
    robot, settings = guided.supervisor.robot, guided.settings
    for _ in range(150):
        guided.beat((6.0, 0.0))
    passed = 0.0
    for _ in range(80):
        before = np.array(guided.drives.now.position)
        slope = [
            margins(robot, settings, before + step)[0] - margins(robot, settings, before - step)[0]
            for step in 1e-5 * np.eye(2)
        ]
        inward = -np.array(slope) / np.hypot(*slope)
        along = np.array((-inward[1], inward[0]))
        guided.beat(tuple(6.0 * inward + sign * along))
        passed += sign * float((np.array(guided.drives.now.position) - before) @ along)
    assert passed > 0.3  # of 0.8 rad that were commanded
    assert guided.now.event == 0
    assert margins(robot, settings, guided.drives.now.position)[0] >= settings.type1_stop


# --- the way out ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["irsbot2", "orthoglide"])
def test_who_goes_on_commanding_while_the_robot_brakes_is_let_out_as_well(name):
    """What is lost of a margin while a stopped robot brakes must not have to be gained first."""
    rng, braking = np.random.default_rng(11), 0
    for _ in range(2):
        guided = standing(name, good_posture(name, int(rng.integers(2**31))))
        limits = np.array(guided.settings.velocity_limit)
        rates = tuple(rng.uniform(-1.0, 1.0, len(limits)) * limits)
        while guided.now.level < Level.STOP:
            guided.rush(rates)
        while max(map(abs, guided.drives.now.velocity)) > guided.settings.standstill_speed:
            braking += 1
            guided.beat(rates)
        start = np.array(guided.drives.now.position)
        at = guided.supervisor.robot.mechanism.posture(tuple(start.tolist()), guided.settings.assembly_mode)
        away = limits * slopes(guided.supervisor.robot.mechanism, at, causes(guided)[0])
        away = tuple((away / np.linalg.norm(away)).tolist())
        for _ in range(20):
            guided.beat(away)
        moved = (np.array(guided.drives.now.position) - start) @ np.array(away)
        assert moved > 0.0
    assert braking


@pytest.mark.parametrize("seed", range(2))
def test_the_way_out_begins_when_the_robot_stands_and_its_stop_has_been_measured(seed):
    """A client goes on commanding all the while. Joints that turn round are slow for a moment."""
    guided = standing("irsbot2", good_posture("irsbot2", seed))
    limits = np.array(guided.settings.velocity_limit)
    direction = np.random.default_rng(seed).normal(size=len(limits))
    there = limits * direction / np.abs(direction).max()
    while guided.now.level < Level.STOP:
        guided.rush(tuple(there.tolist()))
    for _ in range(100):
        stands = guided.supervisor.standing
        if any(guided.beat(tuple((-there).tolist())).rates):
            break
    else:
        pytest.fail("nothing passed: the test proves nothing")
    assert stands
    assert guided.supervisor.measured_stop is not None
    for _ in range(20):
        guided.beat(tuple((-there).tolist()))
    assert not any("after the stop" in finding.text for finding in guided.now.findings)


NEAR = [(name, 7, 0.1) for name in ("irsbot2", "irsbot2_beta45", "five_bar", "orthoglide")] + [("triaglide", 8, 0.1)]
"""Robots that were slow: they stand beyond a warning limit. Fast ones stand where their margins are above it."""


@pytest.mark.parametrize(("name", "seed", "share"), [*((name, 7, 0.9) for name in ROBOTS), ("rrr3", 4, 0.9), *NEAR])
def test_after_a_stop_only_motion_away_from_the_limits_or_within_them_passes_and_slowly(name, seed, share):
    """A margin below its warning limit may not fall; one that is above may not fall below."""
    guided = stopped(name, seed, share)
    robot, settings = guided.supervisor.robot, guided.settings
    start = np.array(guided.drives.now.position)
    kinds, base = causes(guided), margins(robot, settings, start)
    view = guided.supervisor.view
    assert view is not None
    assert kinds
    inside = np.array(release_of(settings))
    assert ((base < inside)[kinds].all()) or (name, seed, share) not in NEAR
    limits = np.array(settings.velocity_limit)
    rng = np.random.default_rng(1)
    away = toward = 0
    for _ in range(16):
        direction = rng.normal(size=len(limits))
        direction /= np.abs(direction).max()
        ahead, behind = (margins(robot, settings, start + sign * 1e-5 * direction)[kinds] for sign in (1.0, -1.0))
        slopes = (ahead - behind) / 2e-5
        allowed = Gate(settings, robot.mechanism).velocity(tuple(limits * direction), view).rates
        assert (np.abs(allowed) <= settings.recovery_share * limits * (1.0 + 1e-9)).all()
        then = margins(robot, settings, start + 0.01 * np.array(allowed))
        assert (then - np.minimum(base, inside))[kinds].min() >= -LOST
        if slopes.min() > 0.02:
            away += 1
            assert np.abs(allowed).max() > 0.0
        elif slopes.min() < -0.02:
            toward += 1
    assert away
    assert toward


@pytest.mark.parametrize("name", ROBOTS)
def test_a_stopped_robot_is_led_out_and_reset_to_ok(name):
    guided = stopped(name, seed=11)
    refusal = guided.reset()
    assert refusal == "" or "still there" in refusal
    if guided.now.latched:
        speed = np.array(guided.settings.velocity_limit)
        for _ in range(800):
            if way := guided.way_out:
                guided.beat(tuple((speed * way).tolist()))
        for _ in range(AT_REST_BEATS):
            guided.beat((0.0,) * len(speed))
        assert guided.reset() == ""
    for _ in range(AT_REST_BEATS):
        guided.drift()
    assert guided.now.level <= Level.WARN
    assert not guided.now.latched
    since = dropwhile(lambda turn: turn.level != Level.STOP, guided.transitions)
    levels = [level for level, _turns in groupby(turn.level for turn in since)]
    assert len(levels) <= 4, levels  # STOP, and after the reset at most WARN, OK, WARN: no chatter


def test_on_the_way_out_the_margin_does_not_decrease_again():
    guided = stopped("irsbot2", seed=7, share=0.1)
    robot, settings = guided.supervisor.robot, guided.settings
    inside = np.array(release_of(settings))
    kinds = causes(guided)
    at = robot.mechanism.posture(guided.drives.now.position, settings.assembly_mode)
    away = np.array(slopes(robot.mechanism, at, kinds[0]))
    away /= np.linalg.norm(away)
    speed = np.array(settings.velocity_limit)
    base = margins(robot, settings, guided.drives.now.position)[kinds]
    for _ in range(5):
        guided.beat(tuple(speed * away))
    for _ in range(AT_REST_BEATS):
        guided.beat((0.0, 0.0))
    gained = margins(robot, settings, guided.drives.now.position)[kinds]
    assert (base < gained).all()
    assert (gained < inside[kinds]).all()
    for _ in range(50):
        guided.beat(tuple(-speed * away))
        now = margins(robot, settings, guided.drives.now.position)[kinds]
        assert (now >= gained - LOST).all()
    assert guided.now.latched


@pytest.mark.parametrize("name", ["irsbot2", "five_bar", "orthoglide"])
def test_a_robot_that_lost_a_margin_after_a_stop_moves_out_and_loses_no_more(name):
    """Brakes give way, or somebody pushes: the margin is lower than the gate would ever have let it fall."""
    guided, kind = beyond(name)
    robot, settings = guided.supervisor.robot, guided.settings
    speed, rng = np.array(settings.velocity_limit), np.random.default_rng(3)

    def here() -> float:
        return margins(robot, settings, guided.drives.now.position)[kind]

    def led_out() -> float:
        before = here()
        guided.beat(tuple((0.3 * settings.recovery_share * speed * guided.way_out).tolist()))
        return here() - before

    assert led_out() > 0.0
    for _ in range(3):  # a loss may follow every rest
        best = here()
        while here() > best - 2.0 * LOST:
            guided.rush(tuple((-0.3 * settings.recovery_share * speed * guided.way_out).tolist()))
        for _ in range(AT_REST_BEATS):
            guided.drift()
        assert guided.supervisor.standing
        assert led_out() > 0.0
        lost = here()
        for _ in range(10):
            guided.beat(tuple((rng.uniform(-1.0, 1.0, len(speed)) * speed).tolist()))
            assert here() >= lost - 0.1 * LOST


@pytest.mark.parametrize("seed", range(3))
def test_a_way_out_of_which_a_joint_range_holds_a_part_loses_no_margin(seed):
    """The motion as a whole raises the margin; joint 1, which does it, is at the end of its range."""
    free, kind = beyond("irsbot2", seed)
    q, at = free.drives.now.position, free.supervisor.view.at
    slope = np.array(slopes(free.supervisor.robot.mechanism, at, kind))
    lower, upper = [-1e6, -1e6], [1e6, 1e6]
    (upper if slope[0] > 0.0 else lower)[0] = q[0] + 0.002 * np.sign(slope[0])
    guided = at_rest("irsbot2", q, position_lower=lower, position_upper=upper)
    assert guided.now.causes & Cause.POSITION
    wanted = 0.4 * np.array((np.sign(slope[0]), -np.sign(slope[1]) * min(0.5 * abs(slope[0] / slope[1]), 1.0)))
    assert wanted @ slope > 0.0 > wanted[1] * slope[1], "joint 2 alone loses nothing: the test proves nothing"
    base = margins(guided.supervisor.robot, guided.settings, q)[kind]
    for _ in range(20):
        guided.beat(tuple(wanted.tolist()))
        assert margins(guided.supervisor.robot, guided.settings, guided.drives.now.position)[kind] >= base - 1e-4


def test_the_gate_keeps_a_little_above_the_stop_limits():
    guided = standing("irsbot2", joints_of(ready("irsbot2")[0], 0.0, -0.85))
    for _ in range(300):
        guided.beat((12.0, -12.0))
    view = guided.supervisor.view
    assert view is not None
    rest = excess(guided.settings, 1e-3)
    predictor = StoppingPredictor(guided.settings, guided.supervisor.robot.mechanism, patient=True)
    stop = limits_of(guided.settings, "stop")
    left = np.array(predictor.predict(view.at, Speeds(rest, rest), view.prediction_delay_s, stop))
    assert (left >= np.array(stop)).all()
    # And not much more is left if its drives do their worst: the workspace stays usable.
    more = tuple(np.array(stop) + 0.05)
    assert (np.array(predictor.predict(view.at, Speeds(rest, rest), view.prediction_delay_s, more)) < more).any()
