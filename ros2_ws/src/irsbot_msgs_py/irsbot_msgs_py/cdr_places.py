"""Places of the numbers in serialised messages, for readers that take many messages of one layout as arrays."""

from __future__ import annotations

from typing import NamedTuple

from irsbot_msgs_py.cdr import JOINT_STATE, STATE
from irsbot_msgs_py.cdr_layout import SIZES, Bytes, Walk
from irsbot_msgs_py.records import SingularityState


class JointStateLayout(NamedTuple):
    """Places of the numbers in all JointState messages that have the lengths and texts of one message, in bytes."""

    names: tuple[str, ...]
    fixed: tuple[slice, ...]  # bytes that all these messages have in common
    seconds: int
    nanoseconds: int
    position: slice
    velocity: slice
    effort: slice


def joint_state_layout(data: Bytes) -> JointStateLayout:
    """The layout of a sensor_msgs/JointState. Raises CdrError."""
    walk = Walk(data, JOINT_STATE)
    names = walk.texts[0]
    assert isinstance(names, tuple)
    (_, sec, _), (_, nanosec, _), *arrays = walk.numbers
    position, velocity, effort = (slice(start, start + count * SIZES[code]) for code, start, count in arrays)
    return JointStateLayout(names, tuple(walk.fixed), sec, nanosec, position, velocity, effort)


class StateLayout(NamedTuple):
    """Places of the numbers in all SingularityState messages that have the lengths and texts of one message, in
    bytes."""

    fixed: tuple[slice, ...]  # bytes that all these messages have in common
    numbers: dict[str, slice]  # of each field of the record that is a number or several


def state_layout(data: Bytes) -> StateLayout:
    """The layout of an irsbot_msgs/SingularityState. Raises CdrError."""
    walk = Walk(data, STATE)
    names = [name for name in SingularityState._fields if name not in ("stamp_ns", "robot")]
    places = [slice(start, start + count * SIZES[code]) for code, start, count in walk.numbers[2:]]  # behind the stamp
    return StateLayout(tuple(walk.fixed), dict(zip(names, places, strict=True)))
