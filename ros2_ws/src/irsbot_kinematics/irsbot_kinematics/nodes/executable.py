"""Entry point of the executable, without the time that ROS takes to load."""

from __future__ import annotations

from typing import NoReturn

from irsbot_msgs_py.start import start


def kinematics() -> NoReturn:
    """`ros2 run irsbot_kinematics kinematics_node`."""
    start("irsbot_kinematics.nodes.kinematics")
