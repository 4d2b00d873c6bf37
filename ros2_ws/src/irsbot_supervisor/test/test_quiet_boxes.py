"""Boxes of many samples, and joints whose encoders are suspected: what the columns say is what the core says."""

from __future__ import annotations

import numpy as np
import pytest
from judged_twice import ROUNDING, disturbed, judged, quiet_and_same, recording_of

from irsbot_kinematics import make_robot
from irsbot_msgs_py.records import JointSample
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.bag.joint_columns import columns_of
from irsbot_supervisor.configuration.loading import read_settings
from irsbot_supervisor.core.box_search import BoxBounds
from irsbot_supervisor.core.stopping import Known, StoppingPredictor, limits_of
from irsbot_supervisor.core.supervisor import Supervisor
from irsbot_supervisor.replay.quiet import suspicion
from irsbot_supervisor.replay.quiet.boxes import Boxes, wide_bounds
from irsbot_supervisor.replay.quiet.strides import QuietRows, Strides
from irsbot_supervisor.replay.rejudge import Assumption
from irsbot_supervisor.validation.bench.motion import recorded

ROBOTS = ("irsbot2", "irsbot2_beta45", "five_bar")


@pytest.fixture(scope="module")
def work() -> dict[str, list[JointSample]]:
    """Pick and place, 1 kHz."""
    return {name: recorded(name, 2000)[2] for name in ROBOTS}


@pytest.mark.parametrize("name", ROBOTS)
def test_boxes_are_proved_and_bounded_as_by_a_search(name: str) -> None:
    random, mechanism = np.random.default_rng(3), make_robot(name).mechanism
    at = mechanism.posture(recorded(name, 1)[2][0].position, mechanism.usual_assembly_mode)
    middle = np.array(at.joints)[:, None] + random.uniform(-0.8, 0.8, (2, 800))
    half = 10.0 ** random.uniform(-2.0, 0.0, 800) * random.uniform(size=(2, 800))
    low, high = middle - half, middle + half
    goal = (0.3, 0.3, 0.08, float("-inf"))
    proved, bounds = wide_bounds(mechanism, mechanism.usual_assembly_mode, goal, low, high)
    agreed = 0
    for row in range(800):
        ends = tuple(low[:, row].tolist()), tuple(high[:, row].tolist())
        search = BoxBounds(mechanism, 0.0).search(at, *ends)
        really = search.proves(goal, 0)
        agreed += proved[row] == really
        assert really or not proved[row]
        if proved[row]:
            assert bounds[row] == pytest.approx(search.certified, abs=ROUNDING)
    assert agreed == 800, "none of these boxes is that near to the goal"
    assert 100 < proved.sum() < 700


@pytest.mark.parametrize("vain", [False, True])
@pytest.mark.parametrize("seed", range(5))
def test_the_choice_of_boxes_is_the_predictors(seed: int, vain: bool) -> None:
    # Boxes that wander and breathe, in a predictor that has proved one before, or failed to prove a large one.
    random, (settings, robot) = np.random.default_rng(seed), read_settings("irsbot2")
    at = robot.mechanism.posture(recorded("irsbot2", 1)[2][0].position, settings.assembly_mode)
    middle = np.array(at.joints)[:, None] + np.cumsum(random.normal(size=(2, 400)) * 0.003, axis=1)
    half = 0.12 * np.exp(np.cumsum(random.normal(size=(2, 400)) * 0.01, axis=1))
    low, high = middle - half, middle + half
    ends = [(tuple(a), tuple(b)) for a, b in zip(low.T.tolist(), high.T.tolist(), strict=True)]
    alone, helped = StoppingPredictor(settings, robot.mechanism), StoppingPredictor(settings, robot.mechanism)
    for predictor in (alone, helped):
        if vain:
            side = 0.3 * (1 + seed), 0.3 * (1 + seed)
            around = [(q - s, q + s) for q, s in zip(at.joints, side, strict=True)]
            least = (0.22, 0.22)
            predictor.in_vain = Known(*zip(*around, strict=True), (0.0,) * 4, least)
        else:
            predictor.renew(at, *ends[0])
    expected, warn = [], limits_of(settings, "warn")
    for box in ends:
        expected.append(alone._sampled(at, *box))
        if not all(have >= limit for have, limit in zip(expected[-1], warn, strict=True)):
            expected.pop()
            break
    certified = np.full((1000, 4), np.nan)
    boxes = Boxes(settings, robot.mechanism, np.arange(10, 410), low, high)
    end = boxes.proved_until(helped, at, 5, 410, certified)
    assert end == 10 + len(expected)
    np.testing.assert_allclose(certified[10:end], expected, rtol=0.0, atol=ROUNDING)
    assert np.isnan(certified[end:]).all()
    assert (helped.known, helped.in_vain) == (alone.known, alone.in_vain)
    assert len(expected) > 100


@pytest.mark.parametrize("seed", range(6))
def test_boxes_that_are_not_proved_are_the_predictors(work: dict[str, list[JointSample]], seed: int) -> None:
    # Warning limits at bounds that the motion meets: the wider boxes fail, the narrow ones are cut, and boxes differ.
    name = ROBOTS[seed % 3]
    _, series, _ = judged(recording_of(work[name]), Assumption(name), columns=False)
    random, bounds = np.random.default_rng(seed), series["until rest"][300:, 0]
    limits = {}
    for kind in ("type1", "type2") if name == "five_bar" else ("type1", "type2", "constraint"):
        bound = float(np.quantile(bounds, random.uniform(0.0, 0.6))) * random.uniform(0.9, 1.3)
        limits |= {f"{kind}_warn": min(bound, 0.9), f"{kind}_stop": 0.01}
    samples = sorted(disturbed(work[name], seed), key=lambda sample: sample.seen_ns) if seed > 2 else work[name]
    quiet = quiet_and_same(recording_of(samples), Assumption(name, {**limits, "hysteresis": random.choice([0.0, 0.1])}))
    assert quiet > 20


def creeping(seed: int) -> list[JointSample]:
    """Steps of about the encoder's resolution. The velocities are exact or noisy; late ones, for a moment or for good,
    report motion of a joint that stands."""
    random, first = np.random.default_rng(seed), recorded("irsbot2", 1)[2][0]
    way, period = random.normal(size=2) * (0.002, 0.01, 0.05)[seed % 3], random.uniform(300.0, 1500.0)
    samples: list[JointSample] = []
    for k in range(2200):
        phase = 2.0 * np.pi * k / period
        q = np.round((np.array(first.position) + way * np.sin(phase)) / 1e-5) * 1e-5
        rate = way * np.cos(phase) * 2000.0 * np.pi / period + (0.0, 1e-3)[seed % 2] * random.normal(size=2)
        if 1500 <= k < (1506, 1600)[seed // 3]:
            q, rate = np.array(samples[1499].position), np.array([0.5, rate[1]])
        stamp_ns = 10**18 + k * NS_PER_S // 1000
        samples.append(JointSample(stamp_ns, stamp_ns, stamp_ns, first.names, tuple(q.tolist()), tuple(rate.tolist())))
    return samples


@pytest.mark.parametrize("seed", range(6))
def test_joints_that_creep_are_suspected_as_by_the_supervisor(seed: int) -> None:
    assert quiet_and_same(recording_of(creeping(seed)), Assumption("irsbot2")) > 1000


def memory(supervisor: Supervisor) -> tuple[object, ...]:
    """What decides about the samples that follow."""
    estimator, predictor, good = supervisor._estimator, supervisor._predictor, supervisor._good
    assert good is not None
    return (
        good._replace(in_time_s=None),
        estimator._observer._kept,
        estimator._observer._speeds,
        estimator._frozen.still,
        (estimator._rest, estimator._rest_ns, estimator._stood_ns),
        (predictor.known, predictor.in_vain),
        supervisor._found,
    )


@pytest.mark.parametrize("seed", range(5))
def test_after_any_piece_the_supervisor_remembers_what_it_would_alone(seed: int) -> None:
    # Pieces end within suspicions, too. Some velocities are a little more than the positions allow.
    random, (settings, robot) = np.random.default_rng(seed), read_settings("irsbot2")
    alone, helped = Supervisor(settings, robot), Supervisor(settings, robot)
    rows = 0

    def quiet(found: QuietRows) -> None:
        nonlocal rows
        rows += len(found.joints)

    strides = Strides(helped, lambda sample: void(helped.step(sample)), quiet, lambda: True)
    samples, suspected, raised, at = creeping(seed), 0, 0, 0
    while at < 1400:
        piece = samples[at : at + int(random.integers(1, 8))]
        done = []
        for sample in piece:
            speeds = alone._estimator._observer._speeds
            if at > 150 and random.random() < 0.1:
                hurry = [random.choice([up, -down]) for up, down in zip(speeds.forward, speeds.backward, strict=True)]
                sample = sample._replace(velocity=tuple(float(rate + 0.006 * np.sign(rate)) for rate in hurry))
            alone.step(sample)
            done.append(sample)
        at += len(piece)
        strides.judge(columns_of(done))
        assert memory(helped) == memory(alone), at
        estimator = alone._estimator
        suspected += bool(estimator._frozen.still)
        assert alone._good is not None
        raised += alone._good.speeds != estimator._observer._speeds
    assert rows > 400
    assert suspected > 10
    assert raised > 0


def void(_: object) -> None:
    """Take a result that nobody needs."""


def test_the_columns_of_suspicions_matter(monkeypatch: pytest.MonkeyPatch) -> None:
    # The comparison bites: an encoder that is frozen and that is not suspected is seen.
    nothing = suspicion.Suspicions([], {}, {})
    monkeypatch.setattr("irsbot_supervisor.replay.quiet.motion.suspicions", lambda *_: nothing)
    monkeypatch.setattr("irsbot_supervisor.replay.quiet.strides.agrees", lambda *_: True)
    with pytest.raises(AssertionError):
        quiet_and_same(recording_of(creeping(3)), Assumption("irsbot2"))
