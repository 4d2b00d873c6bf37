"""Links and joints of a robot as an open tree, its loops cut, with the positions of the passive joints.

All frames are parallel to the base frame while every joint is at 0, so that a joint is a point and an axis. One leg
carries the platform; the other legs end at a cut, a point of the leg that coincides with a point of the platform.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import atan2, cos, hypot, sin
from typing import NamedTuple

Floats = tuple[float, ...]
Vector = tuple[float, float, float]
X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
HERE = (0.0, 0.0, 0.0)

BASE, PLATFORM = "base", "platform"
"""Links of every skeleton: the root, whose frame is the base frame, and the link whose origin is P."""


@dataclass(frozen=True)
class Link:
    """One link and the joint that holds it."""

    name: str
    joint: str
    parent: str
    origin: Vector
    """m: position of the joint in the frame of the parent."""
    axis: Vector | None
    """Unit vector of the axis about which the link turns or along which it slides; None: fixed."""
    slides: bool = False
    shape: tuple[Vector, ...] = ()
    """m: ends of bars that start at the link's origin."""


class Cut(NamedTuple):
    """A cut of a loop: a point of a link that coincides with a point of the platform, m."""

    link: str
    point: Vector
    platform_point: Vector


@dataclass(frozen=True)
class Skeleton:
    """The tree of one robot. Links come after their parents; the base is not listed."""

    links: tuple[Link, ...]
    drives: tuple[str, ...]
    """Driven joints, in robot order."""
    cuts: tuple[Cut, ...]
    closing: Callable[[Floats, Floats], Mapping[str, float]]
    """Positions of the passive joints, rad, for consistent joint positions and pose."""
    rails: tuple[tuple[Vector, Vector], ...] = ()
    """Bars of the base, m."""

    @property
    def passive(self) -> tuple[str, ...]:
        """Joints that are not driven, in the order of the links."""
        return tuple(link.joint for link in self.links if link.axis and link.joint not in self.drives)


class Bar(NamedTuple):
    """A bar of a drawing, ends in the base frame, m."""

    start: Vector
    end: Vector
    link: str
    """Name of the link that it belongs to; BASE for rails, and for the way that a link has slid on one."""


def bars(skeleton: Skeleton, positions: Mapping[str, float]) -> list[Bar]:
    """Bars of all links. positions: of every joint by name, rad or m, as the drives and `closing` give them."""
    found = [Bar(start, end, BASE) for start, end in skeleton.rails]
    frames: dict[str, tuple[tuple[Vector, Vector, Vector], Vector]] = {BASE: ((X, Y, Z), HERE)}
    for link in skeleton.links:
        columns, place = frames[link.parent]  # images of x, y, z, and position of the parent's origin
        start = place = added(place, _image(columns, link.origin))
        if link.axis and link.slides:
            place = added(place, scaled(positions[link.joint], _image(columns, link.axis)))
            found.append(Bar(start, place, BASE))
        elif link.axis:
            q, axis = positions[link.joint], _image(columns, link.axis)
            columns = _about(axis, q, columns[0]), _about(axis, q, columns[1]), _about(axis, q, columns[2])
        frames[link.name] = columns, place
        found += [Bar(place, added(place, _image(columns, end)), link.name) for end in link.shape]
    return found


def _image(columns: tuple[Vector, Vector, Vector], way: Vector) -> Vector:
    """A vector of a turned frame in the base frame."""
    return added(*map(scaled, way, columns))


def _about(axis: Vector, angle: float, way: Vector) -> Vector:
    """A vector turned about a unit vector: formula of Rodrigues."""
    c, s = cos(angle), sin(angle)
    return added(scaled(c, way), scaled(s, cross(axis, way)), scaled((1.0 - c) * dot(axis, way), axis))


class Rod(NamedTuple):
    """A rod on a universal joint of its parent: it turns about `turn`, then tilts about `down x turn`."""

    name: str
    parent: str
    origin: Vector
    turn: Vector
    """Unit vector: first axis, of the parent."""
    down: Vector
    """Unit vector normal to `turn`: direction of the rod at 0."""
    length: float

    @property
    def tilt(self) -> Vector:
        """Second axis, of the cross link."""
        return cross(self.down, self.turn)

    def links(self) -> Iterator[Link]:
        """The cross link and the rod."""
        yield Link(f"{self.name}_cross", f"{self.name}_turn", self.parent, self.origin, self.turn)
        yield Link(self.name, f"{self.name}_tilt", f"{self.name}_cross", HERE, self.tilt, shape=(self.end,))

    def carry(self, corners: Sequence[Vector]) -> Iterator[Link]:
        """The universal joint at its far end, which holds the first corner of the platform."""
        cross_, held = f"{self.name}_far_cross", f"{self.name}_end"
        yield Link(cross_, f"{self.name}_far_tilt", self.name, self.end, self.tilt)
        yield Link(held, f"{self.name}_far_turn", cross_, HERE, self.turn)
        yield fixed_platform(held, corners[0], corners)

    @property
    def end(self) -> Vector:
        """Its far end, m."""
        return scaled(self.length, self.down)

    def angles(self, direction: Vector) -> tuple[float, float]:
        """Turn and tilt, rad, of a direction in the frame of the parent: R(turn, a) R(tilt, b) down."""
        along, aside, off = dot(direction, self.down), dot(direction, self.tilt), dot(direction, self.turn)
        return atan2(-aside, along), atan2(off, hypot(along, aside))

    def near(self, direction: Vector) -> dict[str, float]:
        """Positions of the joints that hold the rod."""
        return dict(zip((f"{self.name}_turn", f"{self.name}_tilt"), self.angles(direction), strict=True))

    def far(self, direction: Vector, turned: float = 0.0) -> dict[str, float]:
        """Positions of the joints that hold the platform. turned: of the platform about `turn`, less the parent's."""
        turn, tilt = self.angles(direction)
        return {f"{self.name}_far_tilt": -tilt, f"{self.name}_far_turn": turned - turn}


def fixed_platform(held: str, platform_point: Vector, corners: Sequence[Vector] = ()) -> Link:
    """The platform as a part of the link that holds it at one point. corners: attachments of the legs, m."""
    return Link(PLATFORM, "platform_mount", held, scaled(-1.0, platform_point), None, shape=tuple(corners))


def planar_end(rod: str, length: float, axis: Vector, corners: Sequence[Vector]) -> Iterator[Link]:
    """The revolute joint at the end of a rod along x, which holds the first corner of the platform."""
    yield Link(f"{rod}_end", "wrist_1", rod, scaled(length, X), axis)
    yield fixed_platform(f"{rod}_end", corners[0], corners)


def turned(angle: float, way: Sequence[float]) -> Vector:
    """A vector turned about z."""
    x, y = way[0], way[1]
    z = way[2] if len(way) > 2 else 0.0
    return cos(angle) * x - sin(angle) * y, sin(angle) * x + cos(angle) * y, z


def scaled(size: float, way: Vector) -> Vector:
    return size * way[0], size * way[1], size * way[2]


def dot(a: Vector, b: Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def added(*ways: Vector) -> Vector:
    return tuple(map(sum, zip(*ways, strict=True)))  # type: ignore[return-value]
