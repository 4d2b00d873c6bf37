"""Which robots a bag holds: the topics of joint states and the supervisors that belong together."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

from irsbot_supervisor.bag.errors import BagError
from irsbot_supervisor.bag.topics import JOINT_STATE, STATE, STRING, VERDICT, Topic, choose_joint_topic


class Sources(NamedTuple):
    """Names that belong to one robot in a bag: its topics of joint states, and the full names of its supervisors."""

    joints: list[str]
    supervisors: list[str]


def robots_in(topics: Iterable[Topic]) -> dict[str, Sources]:
    """The robots in a bag by namespace: that of the supervisor, or that of the joint states without a supervisor.

    topics: all of the bag; those of other types are skipped. If there are exactly one supervisor and one topic of joint
    states, they belong together, whatever their names are after remaps. Empty for a bag without either.
    """
    joints = sorted({topic.name for topic in topics if topic.type == JOINT_STATE})
    nodes = sorted({namespace_of(topic.name) for topic in topics if _is_said(topic)})
    if len(joints) == len(nodes) == 1:
        return {namespace_of(nodes[0]): Sources(joints, nodes)}
    return {
        namespace: Sources(
            [name for name in joints if namespace_of(name) == namespace],
            [name for name in nodes if namespace_of(name) == namespace],
        )
        for namespace in sorted({namespace_of(name) for name in (*joints, *nodes)})
    }


def namespace_of(name: str) -> str:
    """The name before the last slash: namespace of a topic or node, or the node whose private topic this is."""
    return f"/{name.strip('/').rpartition('/')[0]}"


def sources_of(bag: Path, robots: dict[str, Sources], namespace: str | None, topic: str | None) -> tuple[str, str]:
    """Choose one robot of a bag; returns its topic of joint states and the full name of its supervisor.

    robots: as `robots_in` returns them. namespace: of the robot; may be left out if there is one robot. topic: of the
    joint states, with or without its namespace; it also selects the robot. The supervisor's name is empty if the robot
    has none. Raises BagError if the robot, its joint states or its supervisor is missing or ambiguous.
    """
    everywhere = [name for found in robots.values() for name in found.joints]
    chosen = None if topic is None else choose_joint_topic(bag, everywhere, topic)
    if namespace is None and chosen is not None:
        namespace = next(name for name, found in robots.items() if chosen in found.joints)
    if namespace is None and len(robots) > 1:
        choice = f"choose one with --namespace, or its joint states with --topic: {', '.join(everywhere) or 'none'}"
        raise BagError(f"{bag}: it holds robots in the namespaces {', '.join(robots)}; {choice}")
    name = next(iter(robots), "/") if namespace is None else f"/{namespace.strip('/')}"
    if name not in robots and robots:
        raise BagError(f"{bag}: no robot in the namespace {name}; there are robots in {', '.join(robots)}")
    joints, supervisors = robots.get(name, Sources([], []))
    if not (joints or chosen) and len(robots) > 1:
        raise BagError(f"{bag}: no joint states (type {JOINT_STATE}) in the namespace {name}")
    if len(supervisors) > 1:
        raise BagError(f"{bag}: several supervisors for one robot: {', '.join(supervisors)}")
    return chosen or choose_joint_topic(bag, joints), next(iter(supervisors), "")


def _is_said(topic: Topic) -> bool:
    """True if the topic belongs to a supervisor."""
    return topic.type in (STATE, VERDICT) or (topic.type == STRING and topic.name.endswith("/journal"))
