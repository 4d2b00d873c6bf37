"""ROS time <-> integer nanoseconds: the only arithmetic between a message and its record."""

from __future__ import annotations

NS_PER_S = 1_000_000_000


def nanoseconds(sec: int, nanosec: int) -> int:
    """The two fields of builtin_interfaces/Time as one integer."""
    return sec * NS_PER_S + nanosec


def sec_nanosec(time_ns: int) -> tuple[int, int]:
    """The two fields of builtin_interfaces/Time; nanosec is never negative, as ROS wants it."""
    return divmod(time_ns, NS_PER_S)
