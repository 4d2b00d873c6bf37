"""Entry point of the executable; it loads ROS only when it runs."""

from __future__ import annotations

from typing import NoReturn

from irsbot_msgs_py.process.start import start


def kinematics() -> NoReturn:
    """`ros2 run irsbot_kinematics kinematics_node`."""
    start("irsbot_kinematics.nodes.kinematics")
