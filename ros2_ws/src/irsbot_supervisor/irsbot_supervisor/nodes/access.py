"""Permissions of a node as an SROS2 policy: generated from its interfaces; all others are denied."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable
from typing import NamedTuple

from irsbot_msgs.msg import GateStatus, Verdict
from irsbot_msgs.srv import BypassStop, ResetStop
from rclpy.node import Node
from std_msgs.msg import Bool

EVERY_NODE = {"publish": ("/rosout",), "subscribe": ("/clock", "/parameter_events")}
"""Interfaces that every rclpy node may use, in addition to its present ones."""

WHERE_INSTALLED = {
    "supervisor": {
        "publish": (
            "/bond",
            "/tf",
            *(f"/supervisor/follow_joint_trajectory/_action/{t}" for t in ("feedback", "status")),
        ),
        "reply": tuple(
            f"/supervisor/follow_joint_trajectory/_action/{name}" for name in ("cancel_goal", "get_result", "send_goal")
        ),
    }
}
"""Interfaces of packages that not every machine has: bond, tf2_msgs, control_msgs."""

INTERFACES = (("topics", "publish"), ("topics", "subscribe"), ("services", "reply"), ("services", "request"))
"""Elements of a profile and what they allow, with the names of SROS2."""


class ConsumerNode(Node):
    """A node with what every consumer needs of the supervisor; the outputs to its drives are its own."""

    def __init__(self) -> None:
        super().__init__("consumer")
        for kind, topic in ((Verdict, "supervisor/verdict"), (Bool, "supervisor/safe")):
            self.create_subscription(kind, topic, lambda _message: None, 1)


class OperatorNode(Node):
    """A node with the interfaces of the operator, who may end a stop and let motion pass one cause."""

    def __init__(self) -> None:
        super().__init__("operator")
        self.create_client(ResetStop, "supervisor/reset")
        self.create_client(BypassStop, "supervisor/bypass")
        for kind, topic in ((Verdict, "supervisor/verdict"), (GateStatus, "supervisor/gate")):
            self.create_subscription(kind, topic, lambda _message: None, 1)


class Access(NamedTuple):
    """Full names of topics and services, without the namespace of the suite."""

    publish: tuple[str, ...]
    subscribe: tuple[str, ...]
    reply: tuple[str, ...]
    request: tuple[str, ...]


def access_of(node: Node) -> Access:
    """Interfaces of a node that is alone on its domain, with the hidden nodes of its process, and those it uses if more
    packages are installed."""
    look = {
        "publish": node.get_publisher_names_and_types_by_node,
        "subscribe": node.get_subscriber_names_and_types_by_node,
        "reply": node.get_service_names_and_types_by_node,
        "request": node.get_client_names_and_types_by_node,
    }
    more, found = WHERE_INSTALLED.get(node.get_name(), {}), {}
    for kind, ask in look.items():
        used = {topic for of in node.get_node_names_and_namespaces() for topic, _types in ask(*of)}
        found[kind] = tuple(sorted({*used, *EVERY_NODE.get(kind, ()), *more.get(kind, ())}))
    return Access(**found)


def policy(name: str, access: Access) -> str:
    """The policy of one enclave as XML text for `ros2 security create_permission`. Names that are not listed are
    denied."""
    root = ElementTree.Element("policy", version="0.2.0")
    enclave = ElementTree.SubElement(ElementTree.SubElement(root, "enclaves"), "enclave", path=f"/{name}")
    profile = ElementTree.SubElement(ElementTree.SubElement(enclave, "profiles"), "profile", ns="/", node=name)
    for element, allowed in INTERFACES:
        _list(profile, element, allowed, getattr(access, allowed))
    ElementTree.indent(root)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{ElementTree.tostring(root, encoding="unicode")}\n'


def _list(profile: ElementTree.Element, element: str, allowed: str, names: Iterable[str]) -> None:
    if not names:
        return
    entries = ElementTree.SubElement(profile, element, {allowed: "ALLOW"})
    for name in names:
        ElementTree.SubElement(entries, element.rstrip("s")).text = name
