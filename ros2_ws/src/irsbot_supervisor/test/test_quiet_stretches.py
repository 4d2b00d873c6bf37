"""Samples judged as columns: the result is that of the supervisor, for all bags, scenarios and disturbances."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from fake_failing_mechanism import fake_robot_of
from judged_twice import disturbed, judged, quiet_and_same, recording_of

from irsbot_kinematics import make_robot
from irsbot_msgs_py.records import JointSample, Level
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.configuration.loading import read_settings
from irsbot_supervisor.core.supervisor import Supervisor
from irsbot_supervisor.replay.judgement import story_of
from irsbot_supervisor.replay.quiet import motion, strides
from irsbot_supervisor.replay.recording import read_recording
from irsbot_supervisor.replay.rejudge import Assumption
from irsbot_supervisor.validation.bench.motion import recorded

BAGS = Path(__file__).parents[4] / "bags"


@pytest.fixture(scope="module")
def work() -> dict[str, list[JointSample]]:
    """Pick and place of robots of each form, 1 kHz."""
    return {name: recorded(name, 2500)[2] for name in ("irsbot2", "irsbot2_beta45", "five_bar")}


@pytest.mark.parametrize("bag", sorted(path.name for path in BAGS.iterdir() if path.is_dir()))
def test_every_shipped_bag_is_judged_as_by_the_supervisor(bag: str) -> None:
    story = story_of(BAGS / bag)
    quiet_and_same(read_recording(BAGS / bag), story.assumption if story else None)


@pytest.mark.parametrize("robot", ["irsbot2", "irsbot2_beta45", "five_bar"])
def test_work_is_judged_as_columns_for_the_most_part(work: dict[str, list[JointSample]], robot: str) -> None:
    samples = work[robot]
    learned = 2.0 * read_settings(robot)[0].stale_s  # s, until the interval of the samples is known
    assert quiet_and_same(recording_of(samples), Assumption(robot)) > len(samples) - 1000.0 * learned - 100


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("robot", ["irsbot2", "five_bar"])
def test_disturbed_recordings_are_judged_as_by_the_supervisor(
    work: dict[str, list[JointSample]], robot: str, seed: int
) -> None:
    samples = sorted(disturbed(work[robot], seed), key=lambda sample: sample.seen_ns)
    changes = {"stale_s": 0.02 if seed % 2 else 0.05, "judging_s": 0.003 if seed % 3 else 0.0}
    changes["bounding_s"] = 0.0006 if seed % 3 == 2 else 0.0  # time for one cut
    quiet_and_same(recording_of(samples), Assumption(robot, changes))


@pytest.mark.parametrize("seed", range(4))
def test_motion_around_the_limits_is_judged_as_by_the_supervisor(seed: int) -> None:
    # Slow joints from a safe posture towards a limit and back, several times: OK, WARN and OK, or a stop.
    random = np.random.default_rng(seed)
    robot, position = make_robot("irsbot2"), recorded("irsbot2", 1)[2][0].position
    names = tuple(joint.name for joint in robot.mechanism.joints)
    way = random.normal(size=2)
    way *= random.uniform(0.05, 0.5) / np.hypot(*way)
    samples = []
    for k in range(2500):
        phase, rate = 0.5 * (1.0 - np.cos(2.0 * np.pi * k / 800.0)), np.sin(2.0 * np.pi * k / 800.0) * np.pi / 0.8
        q = np.round((np.array(position) + way * phase) / 1e-5) * 1e-5
        stamp_ns = 10**18 + k * NS_PER_S // 1000
        times = stamp_ns, stamp_ns + 300_000, stamp_ns + 300_000
        samples.append(JointSample(*times, names, tuple(q.tolist()), tuple((way * rate).tolist())))
    quiet_and_same(recording_of(samples), Assumption("irsbot2"))


@pytest.mark.parametrize("rest_ms", [30, 300])
def test_after_a_stretch_the_supervisor_knows_since_when_the_joints_stand(rest_ms: int) -> None:
    # How long the joints stand decides about late samples, and about when a stop is over.
    position = np.array(recorded("irsbot2", 1)[2][0].position)
    names = tuple(joint.name for joint in make_robot("irsbot2").mechanism.joints)
    moved = 600
    times = [*range(moved + rest_ms)]
    times += [times[-1] + 27 * (k // 20) + k for k in range(20, 100)]  # pauses of 27 ms after every 20 samples
    samples = []
    for ms in times:
        phase = 2.0 * np.pi * min(ms, moved) / 200.0
        q = np.round((position + 0.02 * (1.0 - np.cos(phase))) / 1e-5) * 1e-5
        rate = 0.02 * np.sin(phase) * 2.0 * np.pi / 0.2 if ms < moved else 0.0
        stamp_ns = 10**18 + ms * NS_PER_S // 1000
        samples.append(JointSample(stamp_ns, stamp_ns, stamp_ns, names, tuple(q.tolist()), (rate, rate)))
    assert quiet_and_same(recording_of(samples), Assumption("irsbot2")) > 0.5 * len(samples)


def test_limits_that_the_motion_just_meets_are_judged_as_by_the_supervisor(work: dict[str, list[JointSample]]) -> None:
    # Warning limits at the bounds that the supervisor finds for the motion itself.
    recording = recording_of(work["irsbot2"])
    _, series, _ = judged(recording, Assumption("irsbot2"), columns=False)
    bounds = series["until rest"][300:, 0]
    for bound in np.quantile(bounds, [0.02, 0.3, 0.7]).tolist():
        kinds = ("type1", "type2", "constraint")
        limits = {f"{kind}_warn": bound for kind in kinds} | {f"{kind}_stop": 0.01 for kind in kinds}
        quiet_and_same(recording, Assumption("irsbot2", {**limits, "hysteresis": 0.0}))


def test_the_motion_columns_matter(work: dict[str, list[JointSample]], monkeypatch: pytest.MonkeyPatch) -> None:
    # The comparison bites: a guard that is wrong, and a memory that is not handed over, are seen.
    samples = sorted(disturbed(work["irsbot2"], 0), key=lambda sample: sample.seen_ns)
    with monkeypatch.context() as broken:
        broken.setattr(motion, "SURELY_MOVED", -1.0)  # frozen encoders are not seen
        broken.setattr(strides, "agrees", lambda *_: True)  # nor that the supervisor remembers something else
        with pytest.raises(AssertionError):
            quiet_and_same(recording_of(samples), Assumption("irsbot2"))


def test_a_robot_without_column_form_is_judged_by_the_supervisor_alone() -> None:
    samples = recorded("orthoglide", 300)[2]
    assert quiet_and_same(recording_of(samples), Assumption("orthoglide")) == 0


def test_a_mechanism_of_yours_is_judged_by_the_supervisor_alone() -> None:
    # It inherits the columns of the shipped one, but they need not be its own postures.
    supervisor = Supervisor(read_settings("irsbot2")[0], fake_robot_of("irsbot2"))
    assert not strides.suits(supervisor)
    assert strides.suits(Supervisor(*read_settings("irsbot2")))


def test_a_run_of_warnings_is_not_taken_for_quiet(work: dict[str, list[JointSample]]) -> None:
    samples = [sample._replace(velocity=()) for sample in work["irsbot2"][:600]]
    found, _, quiet = judged(recording_of(samples), Assumption("irsbot2"), columns=True)
    assert quiet == 0
    assert found.intervals[-1].level == Level.WARN
