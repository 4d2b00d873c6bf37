"""Topics of a bag: types that the supervisor reads, definitions, and the choice of the joint states."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

import yaml

from irsbot_kinematics import BadInput
from irsbot_kinematics.description import yaml_text
from irsbot_supervisor.bag.errors import BagError
from irsbot_supervisor.bag.message_definitions import definition, type_hash

JOINT_STATE = "sensor_msgs/msg/JointState"
STATE = "irsbot_msgs/msg/SingularityState"
VERDICT = "irsbot_msgs/msg/Verdict"
STRING = "std_msgs/msg/String"

_OFFERED, _HASH = "offered_qos_profiles", "topic_type_hash"  # keys of a channel's metadata


class Topic(NamedTuple):
    """One topic of a bag, as its channel and its schema describe it.

    type: such as std_msgs/msg/String; empty without a schema. text: definition of the type in the format
    `text_encoding`; bytes that are not UTF-8 are kept as surrogates. encoding: of the messages.
    """

    name: str
    type: str
    text: str
    metadata: dict[str, str]
    text_encoding: str = "ros2msg"
    encoding: str = "cdr"

    @property
    def type_hash(self) -> str:
        """Hash that ROS 2 gives the type; empty if it is not known."""
        return self.metadata.get(_HASH, "")

    @property
    def offered(self) -> list[Any]:
        """Quality of service of the publishers; empty if the bag does not say it, or not as rosbag2 does."""
        try:
            found = yaml_text.parsed(self.metadata.get(_OFFERED, ""))
        except BadInput:
            return []
        return found if isinstance(found, list) else []


def installed_topic(name: str, type_name: str, latched: bool = False) -> Topic:
    """A topic of an installed message type. latched: True if it is offered transient local. Raises BagError if the
    definition of the type is not installed."""
    offered = yaml.safe_dump([_offered(latched)], sort_keys=False)
    return Topic(name, type_name, definition(type_name), {_OFFERED: offered, _HASH: type_hash(type_name)})


def choose_joint_topic(bag: Path, topics: Iterable[str], wanted: str | None = None) -> str:
    """Choose the topic of joint states: the only one, the only one with the usual name, or `wanted`.

    bag: named in errors. topics: full names of the topics of joint states. wanted: a name with or without its
    namespace. Returns a full name. Raises BagError that lists the candidates if there is none or more than one.
    """
    known = sorted(set(topics))
    if not known:
        raise BagError(f"{bag}: no joint states (type {JOINT_STATE}) in it")
    wishes = known if wanted is None else [name for name in known if is_named(name, wanted)]
    found = [name for name in wishes if name == wanted] or wishes
    if wanted is None and len(found) > 1:
        found = [name for name in found if is_named(name, "joint_states")] or found
    if len(found) != 1:
        fault = f"no topic {wanted} of joint states" if not found else "several topics of joint states"
        raise BagError(f"{bag}: {fault}; choose one (`--topic`, `topic=`): {', '.join(known)}")
    return found[0]


def is_named(topic: str, wanted: str) -> bool:
    """True if this is the name of a topic, with or without its namespace."""
    return f"/{topic}".endswith(f"/{wanted.lstrip('/')}")


def _offered(latched: bool) -> dict[str, Any]:
    """Quality of service as rosbag2 writes it; subscribers do not know the history."""
    for_ever = {"sec": 9223372036, "nsec": 854775807}
    return {
        "history": "unknown",
        "depth": 0,
        "reliability": "reliable",
        "durability": "transient_local" if latched else "volatile",
        "deadline": dict(for_ever),
        "lifespan": dict(for_ever),
        "liveliness": "automatic",
        "liveliness_lease_duration": dict(for_ever),
        "avoid_ros_namespace_conventions": False,
    }
