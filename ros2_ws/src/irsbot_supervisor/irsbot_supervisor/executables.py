"""Entry points of the executables; each loads its libraries only when it runs."""

from __future__ import annotations

from typing import NoReturn

from irsbot_msgs_py.process.start import start


def supervisor() -> NoReturn:
    """`ros2 run irsbot_supervisor supervisor_node`."""
    start("irsbot_supervisor.nodes.supervisor")


def simulated_joints() -> NoReturn:
    """`ros2 run irsbot_supervisor simulated_joints_node`."""
    start("irsbot_supervisor.nodes.simulated_joints")


def recorder() -> NoReturn:
    """`ros2 run irsbot_supervisor recorder_node`."""
    start("irsbot_supervisor.nodes.recorder")


def suite() -> NoReturn:
    """`ros2 run irsbot_supervisor suite_node`."""
    start("irsbot_supervisor.nodes.suite")


def irsbot() -> NoReturn:
    """`irsbot`, the command line."""
    start("irsbot_supervisor.cli.app")
