"""After the branch was lost, an operator's look tells the assembly mode that encoders cannot."""

from __future__ import annotations

import pytest

from irsbot_msgs_py.records import Cause, JointSample, Level, Reset
from irsbot_supervisor.configuration.loading import read_settings
from irsbot_supervisor.core.supervisor import Supervisor

MS = 1_000_000
"""ns."""

POSE = (0.3, -0.75)
OTHER = (-0.241760801, 0.609838412)
"""Sheet W1: the pose of the same joints in the other assembly mode."""


def _lost() -> tuple[Supervisor, int]:
    """A supervisor that stands at POSE after its joints jumped farther than they can move."""
    settings, robot = read_settings("irsbot2")
    supervisor = Supervisor(settings, robot)
    now = 1_000_000_000
    there, here = robot.inverse((0.0, -0.8)), robot.inverse(POSE)
    for cycle in range(350):
        now += MS
        q = tuple((there if cycle < 100 else here).tolist())
        supervisor.step(JointSample(now, now, now, settings.joint_names, q, (0.0, 0.0), ()))
    return supervisor, now


def _reset(supervisor: Supervisor, now: int, *seed: float) -> tuple[str, Level]:
    step = supervisor.step(Reset(now, now, 1, "looked at it", seed))
    assert step.verdict is not None or step.refusal
    settings = supervisor.settings
    q = tuple(supervisor.robot.inverse(POSE).tolist())
    for cycle in range(1, 120):
        later = now + cycle * MS
        verdict = supervisor.step(JointSample(later, later, later, settings.joint_names, q, (0.0, 0.0), ())).verdict
        if verdict is not None:
            level = verdict.level
    return step.refusal, level


@pytest.mark.parametrize("seed", [(), (0.28, -0.7), (0.0, -0.9)])
def test_a_seed_near_the_configured_branch_is_accepted(seed: tuple[float, ...]) -> None:
    refusal, level = _reset(*_lost(), *seed)
    assert not refusal
    assert level == Level.OK


def test_a_seed_nearer_to_the_other_assembly_mode_is_refused() -> None:
    refusal, level = _reset(*_lost(), *OTHER)
    assert "assembly mode +1" in refusal
    assert level == Level.UNKNOWN


@pytest.mark.parametrize("seed", [(0.3,), (0.3, float("nan")), (0.3, -0.7, 0.0), (1e308, 0.0)])
def test_a_seed_that_is_no_pose_is_refused(seed: tuple[float, ...]) -> None:
    refusal, level = _reset(*_lost(), *seed)
    assert "seed pose must be 2 finite numbers" in refusal
    assert level == Level.UNKNOWN


def test_the_loss_is_latched_as_branch() -> None:
    supervisor, now = _lost()
    settings = supervisor.settings
    q = tuple(supervisor.robot.inverse(POSE).tolist())
    for cycle in range(1, 20):
        later = now + cycle * MS
        verdict = supervisor.step(JointSample(later, later, later, settings.joint_names, q, (0.0, 0.0), ())).verdict
        if verdict is not None:
            assert verdict.level == Level.UNKNOWN
            assert verdict.latched
            assert verdict.causes & Cause.BRANCH
            return
    raise AssertionError("no verdict within two heartbeats")
