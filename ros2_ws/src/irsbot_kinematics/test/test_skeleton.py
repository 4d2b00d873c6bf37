"""Bars of the links: they are rigid, they hang together, and the platform is where its pose says."""

from __future__ import annotations

import math

import pytest

import irsbot_kinematics as irs
from irsbot_kinematics.conformance.samples import Machine
from irsbot_kinematics.mechanism import Posture, Status
from irsbot_kinematics.skeleton import BASE, Bar, bars


def drawn(robot: irs.Robot, at: Posture) -> list[Bar]:
    skeleton = robot.mechanism.skeleton()
    drives = dict(zip(skeleton.drives, at.joints, strict=True))
    return bars(skeleton, {**drives, **skeleton.closing(at.joints, at.pose)})


@pytest.mark.parametrize("name", irs.robots())
def test_bars_are_rigid_and_one_of_them_ends_at_the_platform(name: str) -> None:
    robot = irs.make_robot(name)
    names = [one.name for one in robot.mechanism.task]
    lengths = []
    for at in [at for at in Machine(robot, 20, 3).postures if at.status == Status.SOLVED][:5]:
        found = drawn(robot, at)
        assert [bar.link for bar in found if bar.link != BASE], "links"
        lengths.append([math.dist(bar.start, bar.end) for bar in found if bar.link != BASE])
        pose = dict(zip(names, at.pose, strict=True))
        platform = tuple(pose.get(axis, 0.0) for axis in "xyz")
        assert min(math.dist(end, platform) for bar in found for end in (bar.start, bar.end)) < 1e-6
    for one in lengths[1:]:
        assert one == pytest.approx(lengths[0], abs=1e-9)
