"""The URDF of every shipped robot, moved by forward kinematics of the test: its loops close where they were cut."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from math import isfinite

import numpy as np
import pytest

import irsbot_kinematics as irs
from irsbot_kinematics.conformance.samples import Machine
from irsbot_kinematics.description.urdf import joint_ranges, skeleton_of, urdf
from irsbot_kinematics.mechanism import Posture, Status
from irsbot_kinematics.mechanisms.rrr3 import Rrr3

CLOSED_M = 1e-9


def numbers(text: str | None) -> np.ndarray:
    return np.array([float(part) for part in (text or "0 0 0").split()])


def rotation(axis: np.ndarray, angle: float) -> np.ndarray:
    """Rodrigues' formula."""
    x, y, z = axis
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * skew + (1.0 - np.cos(angle)) * skew @ skew


def frames(root: ElementTree.Element, positions: dict[str, float]) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Rotation and place of every link, from the text alone."""
    found = {"base": (np.eye(3), np.zeros(3))}
    for joint in root.findall("joint"):
        parent, child = joint.find("parent").get("link"), joint.find("child").get("link")
        assert list(numbers(joint.find("origin").get("rpy"))) == [0.0, 0.0, 0.0]
        turn, place = found[parent]
        place = place + turn @ numbers(joint.find("origin").get("xyz"))
        kind, value = joint.get("type"), positions.get(joint.get("name"), 0.0)
        if kind == "prismatic":
            place = place + turn @ numbers(joint.find("axis").get("xyz")) * value
        elif kind != "fixed":
            axis = numbers(joint.find("axis").get("xyz"))
            assert np.linalg.norm(axis) == pytest.approx(1.0, abs=1e-15)
            turn = turn @ rotation(axis, value)
        found[child] = turn, place
    return found


def postures(name: str) -> list[Posture]:
    """Random postures in every assembly mode."""
    robot = irs.make_robot(name)
    found = [at for at in Machine(robot, 100, 11).postures if at.status == Status.SOLVED]
    assert len(found) > 20
    return found


def space(robot: irs.Robot, pose) -> tuple[np.ndarray, float]:
    named = dict(zip((one.name for one in robot.mechanism.task), pose, strict=True))
    return np.array([named.get(axis, 0.0) for axis in "xyz"]), named.get("phi", 0.0)


@pytest.mark.parametrize("name", irs.robots())
def test_loops_close_and_the_platform_has_the_pose_of_the_direct_kinematics(name: str):
    robot = irs.make_robot(name)
    skeleton, root = skeleton_of(robot), ElementTree.fromstring(urdf(robot))
    assert len(skeleton.cuts) >= len(robot.mechanism.joints) - 1
    for at in postures(name):
        passive = skeleton.closing(at.joints, at.pose)
        assert set(passive) == set(skeleton.passive)
        found = frames(root, {**passive, **dict(zip(skeleton.drives, at.joints, strict=True))})
        place, turn = space(robot, at.pose)
        np.testing.assert_allclose(found["platform"][1], place, atol=CLOSED_M)
        np.testing.assert_allclose(found["platform"][0], rotation(np.array([0.0, 0.0, 1.0]), turn), atol=CLOSED_M)
        for link, point, corner in skeleton.cuts:
            (R, p), (S, o) = found[link], found["platform"]
            np.testing.assert_allclose(p + R @ point, o + S @ corner, atol=CLOSED_M)


@pytest.mark.parametrize("name", irs.robots())
def test_the_tree_is_one_as_readers_of_urdf_want_it(name: str):
    robot = irs.make_robot(name)
    root = ElementTree.fromstring(urdf(robot))
    links = [link.get("name") for link in root.findall("link")]
    joints = root.findall("joint")
    children = [joint.find("child").get("link") for joint in joints]
    assert len(set(links)) == len(links) == len(joints) + 1
    assert len({joint.get("name") for joint in joints}) == len(joints)
    assert set(links) - set(children) == {"base"}
    assert len(set(children)) == len(children)
    assert {joint.find("parent").get("link") for joint in joints} <= set(links)
    seen = {"base"}
    for joint in joints:  # parents first
        assert joint.find("parent").get("link") in seen
        seen.add(joint.find("child").get("link"))
    kinds = {joint.get("name"): joint for joint in joints}
    for drive in robot.mechanism.joints:
        joint = kinds[drive.name]
        limited = isfinite(drive.lower)
        expected = "prismatic" if drive.unit == "m" else "revolute" if limited else "continuous"
        assert joint.get("type") == expected
        if limited:
            limit = joint.find("limit")
            assert (float(limit.get("lower")), float(limit.get("upper"))) == (drive.lower, drive.upper)
            assert {"effort", "velocity"} <= set(limit.keys())


@pytest.mark.parametrize("name", irs.robots())
def test_the_cylinders_reach_from_joint_to_joint(name: str):
    """Each but those of platform and base ends where another link begins, or at a cut; a piston ends in its sleeve."""
    robot = irs.make_robot(name)
    skeleton, root = skeleton_of(robot), ElementTree.fromstring(urdf(robot))
    ends: dict[str, list[np.ndarray]] = {link.name: [] for link in skeleton.links}
    for link in skeleton.links:
        ends.setdefault(link.parent, []).append(np.array(link.origin))
    for cut in skeleton.cuts:
        ends[cut.link].append(np.array(cut.point))
    drawn, pistons = 0, {link.name for link in skeleton.links if link.slides}
    for link in root.findall("link"):
        for visual in link.findall("visual"):
            middle, (roll, pitch, yaw) = (
                numbers(visual.find("origin").get("xyz")),
                numbers(visual.find("origin").get("rpy")),
            )
            assert roll == 0.0
            length = float(visual.find("geometry/cylinder").get("length"))
            way = (
                rotation(np.array([0, 0, 1.0]), yaw) @ rotation(np.array([0, 1.0, 0]), pitch) @ np.array([0, 0, length])
            )
            if link.get("name") not in ("base", "platform"):
                np.testing.assert_allclose(middle - 0.5 * way, 0.0, atol=1e-12)
                far = min(np.linalg.norm(middle + 0.5 * way - end) for end in ends[link.get("name")])
                assert far < 1e-12 or link.get("name") in pistons
            drawn += 1
    assert drawn >= len(robot.mechanism.joints)


def test_names_limits_and_speeds_can_be_given_and_names_are_escaped():
    mechanism = irs.make_robot("five_bar").mechanism
    text = urdf(irs.Robot(mechanism, 'a<b&"c'), ("left", "right"), (-1.0, -2.0), (1.0, 2.0), (6.0, 7.0))
    root = ElementTree.fromstring(text)
    assert root.get("name") == 'a<b&"c'
    joints = {joint.get("name"): joint for joint in root.findall("joint")}
    limit = joints["right"].find("limit")
    assert [float(limit.get(key)) for key in ("lower", "upper", "velocity")] == [-2.0, 2.0, 7.0]
    assert joints["left"].get("type") == "revolute"
    assert "joint_1" not in joints


def test_joints_that_are_only_referred_to_have_no_limits_of_their_own():
    """As in the description of a machine under ros2_control and in Gazebo."""
    joint = '<joint name="a" type="revolute"><limit lower="-1" upper="2"/></joint>'
    reference = '<joint name="a"><command_interface name="position"/></joint>'
    others = f"<ros2_control name='s' type='system'>{reference}</ros2_control><transmission name='t'>{reference}"
    others += f"</transmission><gazebo><plugin>{reference}</plugin></gazebo>"
    for text in (joint + others, others + joint):
        assert joint_ranges(f"<robot>{text}</robot>", ["a"]) == ((-1.0,), (2.0,))
    with pytest.raises(irs.BadInput, match="no joint 'a'"):
        joint_ranges(f"<robot>{others}</robot>", ["a"])


def test_a_mechanism_without_a_description_is_refused_in_a_sentence(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(Rrr3, "skeleton", lambda self: None)
    with pytest.raises(irs.BadInput, match="mechanism 'rrr3' does not describe its links"):
        urdf(irs.make_robot("rrr3"))
