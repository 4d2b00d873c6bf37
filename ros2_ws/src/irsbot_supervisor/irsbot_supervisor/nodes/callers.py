"""Counts calls of services for /diagnostics, and logs as much of a caller's identity as rclpy gives.

rclpy does not say which client has sent a request. The graph says which nodes have a client of a service: the caller is
one of them, unless it has already gone.
"""

from __future__ import annotations

import time
from collections import Counter
from math import inf

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.node import Node

from irsbot_supervisor.nodes.graph_monitor import GraphFault

SAID_S = 1.0
"""s between two log lines of refused calls of a kind: a client that asks without end gets answers, but no log lines."""


class Callers:
    """Counts calls of one node by kind, and the refused ones."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self.counts: Counter[str] = Counter()
        self._told = 0  # refused calls at the last report
        self._said_s: dict[str, float] = {}  # when a refused call of a kind was logged last, steady clock

    def count(self, what: str, accepted: bool) -> None:
        """Count one more call. what: its kind, for instance `resets`."""
        self.counts[what] += 1
        self.counts[f"{what} refused"] += not accepted

    def is_due(self, what: str) -> bool:
        """True if a refused call of this kind is to be logged now. Ask before `who`, which takes time where there are
        many nodes."""
        now_s = time.monotonic()
        due = now_s - self._said_s.get(what, -inf) > SAID_S
        if due:
            self._said_s[what] = now_s
        return due

    def who(self, *services: str) -> str:
        """The nodes that have a client of one of these services, as text."""
        topics = set(map(self._node.resolve_service_name, services))
        found = []
        for name, space in self._node.get_node_names_and_namespaces():
            try:
                clients = self._node.get_client_names_and_types_by_node(name, space)
            except RuntimeError:  # it has left in the meantime
                continue
            if any(topic in topics for topic, _types in clients):
                found.append(f"{space.rstrip('/')}/{name}")
        nodes = " or ".join(sorted(found)) or "a node that has left or is not discovered yet"
        return f"called by {nodes}"

    def report(self) -> GraphFault:
        """Finding on calls that were refused since the last report."""
        refused = sum(number for what, number in self.counts.items() if what.endswith("refused"))
        fresh, self._told = refused - self._told, refused
        if not fresh:
            return GraphFault("calls", DiagnosticStatus.OK, "none was refused lately")
        return GraphFault(
            "calls", DiagnosticStatus.WARN, f"{fresh} calls were refused: the log lists them with their callers"
        )
