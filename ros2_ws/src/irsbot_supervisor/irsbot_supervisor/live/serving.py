"""What the live page and the server for Foxglove have in common as nodes of a suite."""

from __future__ import annotations

import sys
from collections.abc import Callable

from rclpy.node import Node

from irsbot_msgs_py.process.usage import USAGE

Run = Callable[[str, int, Callable[[str], None]], None]
"""Serves at a host and a port until Ctrl-C, and tells its address once it answers. Raises OSError."""


def serve_node(node: Node, run: Run, nothing: str) -> None:
    """Serve at the parameters `host` and `port` of a node. nothing: begin of the sentence if that is not possible."""
    host = str(node.declare_parameter("host", "localhost").value)
    port = int(node.declare_parameter("port", 0).value)
    try:
        run(host, port, lambda address: print(address, flush=True))
    except OSError as error:
        print(f"{nothing} at {host}:{port}: {error.strerror or error}", file=sys.stderr)
        sys.exit(USAGE)
