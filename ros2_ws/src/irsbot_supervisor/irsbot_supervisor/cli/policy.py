"""`policy`: SROS2 policies generated from the nodes."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Annotated, Any

import typer

from irsbot_supervisor.cli.common import out, refuse
from irsbot_supervisor.processes.suite import free_domain

ON_REQUEST = ("topics.markers:=supervisor/markers",)
"""Parameters of topics that a node uses only if it is told to: a policy allows them."""


def policy(
    node: Annotated[
        str, typer.Argument(help="recorder, kinematics, supervisor, simulated_joints, consumer or operator")
    ],
    output: Annotated[Path | None, typer.Option("--output", "-o", help="write it here; printed if left out")] = None,
) -> None:
    """Write the SROS2 policy of a node: it allows the names that the node uses and denies all others.

    The node is started briefly on its own DDS domain. Shipped policies: share/irsbot_supervisor/policies.

    Example: irsbot policy supervisor -o supervisor.policy.xml.
    """
    text = policy_of(node)
    if output is None:
        out.print(text, end="")
        return
    output.write_text(text, encoding="utf-8")
    out.print(f"written to {output}")


def policy_of(name: str) -> str:
    """The policy of a node of the suite, of a consumer, or of an operator."""
    import rclpy  # ROS, which the other commands do not need

    from irsbot_supervisor.nodes import access
    from irsbot_supervisor.nodes.suite import NODES

    makers = {**NODES, "consumer": access.ConsumerNode, "operator": access.OperatorNode}
    if name not in makers:
        refuse(f"no node '{name}'; there are {', '.join(makers)}")
    with tempfile.TemporaryDirectory() as folder:
        given = [word for one in (f"output:={folder}/bag", *ON_REQUEST) for word in ("-p", one)]
        rclpy.init(args=["--ros-args", *given, "--log-level", "error"], domain_id=free_domain())
        made: Any = makers[name]()
        try:
            return access.policy(name, access.access_of(made))
        finally:
            if hasattr(made, "close"):
                made.close()
            made.destroy_node()
            rclpy.try_shutdown()
