"""Ports of this machine for servers under test."""

from __future__ import annotations

import socket


def free_port() -> int:
    """A TCP port that nobody uses."""
    with socket.socket() as probe:
        probe.bind(("localhost", 0))
        return int(probe.getsockname()[1])
