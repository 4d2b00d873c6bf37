"""A robot as URDF: the tree of its skeleton, with passive joints; its loops are cut, because URDF has no loops."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable, Sequence
from math import acos, atan2, isfinite, sqrt

from irsbot_kinematics.errors import BadInput
from irsbot_kinematics.mechanism import Coordinate
from irsbot_kinematics.robot import Robot
from irsbot_kinematics.skeleton import BASE, HERE, Link, Skeleton, Vector

THICKNESS = 0.01
"""Radius of the cylinders, in lengths of the mechanism."""


def skeleton_of(robot: Robot) -> Skeleton:
    """Links and joints of a robot. Raises BadInput if its mechanism does not describe them."""
    skeleton = robot.mechanism.skeleton()
    if skeleton is None:
        raise BadInput(f"mechanism '{robot.mechanism.kind}' does not describe its links: it has no skeleton()")
    return skeleton


def urdf(
    robot: Robot,
    names: Sequence[str] = (),
    lower: Sequence[float] = (),
    upper: Sequence[float] = (),
    speed: Sequence[float] = (),
) -> str:
    """The description as XML text, SI units.

    names, lower, upper, speed: of the drives, (n,) each; empty: the robot's own, and a speed of 0. Limits of effort
    are not known here: they are 0, because URDF demands a number. Raises BadInput where there is no description.
    """
    skeleton = skeleton_of(robot)
    own = robot.mechanism.joints
    drives = {}
    for number, drive in enumerate(own):
        range_ = (lower or [one.lower for one in own])[number], (upper or [one.upper for one in own])[number]
        name = names[number] if names else drive.name
        drives[drive.name] = Coordinate(name, drive.unit, *range_), speed[number] if speed else 0.0
    root = ElementTree.Element("robot", name=robot.name)
    radius = THICKNESS * robot.mechanism.length_m
    _link(root, BASE, skeleton.rails, radius)
    for link in skeleton.links:
        _link(root, link.name, [(HERE, end) for end in link.shape], radius)
        _joint(root, link, drives.get(link.joint))
    ElementTree.indent(root)
    return f'<?xml version="1.0"?>\n{ElementTree.tostring(root, encoding="unicode")}\n'


def _link(root: ElementTree.Element, name: str, bars: Iterable[tuple[Vector, Vector]], radius: float) -> None:
    element = ElementTree.SubElement(root, "link", name=name)
    for start, end in bars:
        way = tuple(b - a for a, b in zip(start, end, strict=True))
        length = sqrt(sum(part * part for part in way))
        if not length > 0.0:
            continue
        visual = ElementTree.SubElement(element, "visual")
        middle = tuple(0.5 * (a + b) for a, b in zip(start, end, strict=True))
        turn = (0.0, acos(max(-1.0, min(1.0, way[2] / length))), atan2(way[1], way[0]))
        ElementTree.SubElement(visual, "origin", xyz=_row(middle), rpy=_row(turn))
        geometry = ElementTree.SubElement(visual, "geometry")
        ElementTree.SubElement(geometry, "cylinder", radius=repr(radius), length=repr(length))


def _joint(root: ElementTree.Element, link: Link, driven: tuple[Coordinate, float] | None) -> None:
    coordinate, speed = driven or (Coordinate(link.joint, "rad", -float("inf"), float("inf")), 0.0)
    limited = isfinite(coordinate.lower) and isfinite(coordinate.upper)
    kind = "fixed" if link.axis is None else "prismatic" if link.slides else "revolute" if limited else "continuous"
    element = ElementTree.SubElement(root, "joint", name=coordinate.name, type=kind)
    ElementTree.SubElement(element, "parent", link=link.parent)
    ElementTree.SubElement(element, "child", link=link.name)
    ElementTree.SubElement(element, "origin", xyz=_row(link.origin), rpy="0 0 0")
    if link.axis is None:
        return
    ElementTree.SubElement(element, "axis", xyz=_row(link.axis))
    if kind != "continuous":
        low, high = coordinate.lower, coordinate.upper
        ElementTree.SubElement(element, "limit", lower=repr(low), upper=repr(high), effort="0", velocity=repr(speed))


def _row(numbers: Iterable[float]) -> str:
    return " ".join(map(repr, numbers))


def joint_ranges(text: str | bytes, names: Sequence[str]) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Lowest and highest positions, rad or m, of joints in a URDF. text: bytes are read in the encoding that they
    state. Raises BadInput for text that is not URDF, for a missing joint, and for one without limits."""
    try:
        root = ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError) as error:  # ValueError: an encoding that the parser does not have
        raise BadInput(f"not XML: {error}") from None
    found = {joint.get("name"): joint.find("limit") for joint in root.findall("joint")}  # others only refer to them
    ranges = []
    for name in names:
        if name not in found:
            raise BadInput(f"the URDF has no joint '{name}'; it has {', '.join(filter(None, found))}")
        limit = found[name]
        try:
            low, high = (float((limit.attrib if limit is not None else {})[key]) for key in ("lower", "upper"))
        except (KeyError, ValueError):
            raise BadInput(f"joint '{name}' of the URDF has no lower and upper limit") from None
        if not (isfinite(low) and isfinite(high) and low < high):
            raise BadInput(f"joint '{name}' of the URDF has limits {low:g} and {high:g}: lower must be below upper")
        ranges.append((low, high))
    lower, upper = zip(*ranges, strict=True)
    return lower, upper
