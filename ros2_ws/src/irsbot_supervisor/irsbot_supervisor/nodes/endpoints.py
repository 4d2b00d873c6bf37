"""Publishers and subscriptions whose quality of service can be set by parameters:
`qos_overrides.TOPIC.publisher.depth`.

~/verdict and ~/safe are excluded: consumers rely on their deadline and liveliness.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from copy import copy
from typing import Any

from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import InvalidQoSProfileException, QoSProfile
from rclpy.qos_overriding_options import InvalidQosOverridesError, QoSOverridingOptions
from rclpy.subscription import Subscription

from irsbot_msgs_py.process.usage import UsageError

DEFAULT = QoSOverridingOptions.with_default_policies()
"""History, depth and reliability."""


def publisher(node: Node, kind: type, topic: str, qos: QoSProfile | int) -> Publisher:
    """A publisher. Raises UsageError for an invalid override."""
    with _told(topic):
        return node.create_publisher(kind, topic, _own(qos), qos_overriding_options=DEFAULT)


def quality(node: Node, kind: type, topic: str, qos: QoSProfile) -> QoSProfile:
    """A QoS profile with the overrides of the parameters, for publishers that come and go. Raises UsageError."""
    own = copy(qos)
    with _told(topic):
        node.destroy_publisher(node.create_publisher(kind, topic, own, qos_overriding_options=DEFAULT))
    return own  # into which rclpy has written


def subscription(
    node: Node,
    kind: type,
    topic: str,
    callback: Callable[[Any], object],
    qos: QoSProfile | int,
    *,
    raw: bool = False,
    offered: QoSOverridingOptions = DEFAULT,
) -> Subscription:
    """A subscription. offered: policies that parameters may set. Raises UsageError for an invalid override."""
    with _told(topic):
        return node.create_subscription(kind, topic, callback, _own(qos), raw=raw, qos_overriding_options=offered)


def _own(qos: QoSProfile | int) -> QoSProfile:
    """A copy of a profile: overrides must not change profiles that are shared."""
    return QoSProfile(depth=qos) if isinstance(qos, int) else copy(qos)


@contextmanager
def _told(topic: str) -> Iterator[None]:
    try:
        yield
    except (InvalidQosOverridesError, RuntimeError, InvalidQoSProfileException) as error:
        raise UsageError(f"qos_overrides of {topic}: {error}") from None
