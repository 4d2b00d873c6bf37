"""The suite: supervisor, kinematics, recorder, and simulated joints in place of hardware unless `simulate:=false`.

ros2 launch irsbot_supervisor supervision.launch.py robot:=irsbot2 namespace:=left params_file:=/path/mine.yaml
"""

from collections.abc import Mapping
from typing import Any

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction, TimerAction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from irsbot_supervisor.nodes.launch_arguments import ARGUMENTS, Given, ended, given
from irsbot_supervisor.processes.suite import GATED

RESPAWN_DELAY_S = 1.0


def _node(package: str, name: str, stated: Given, **parameters: object) -> Node:
    """What the command line says wins over the file."""
    more: dict[str, object] = {"use_sim_time": True} if stated.use_sim_time else {}
    return Node(
        package=package,
        executable=f"{name}_node",
        namespace=stated.namespace,
        parameters=[*([stated.params_file] if stated.params_file else []), {**parameters, **more}],
        ros_arguments=["--log-level", stated.log_level],
        output="screen",
        respawn=stated.respawn and name != "supervisor",
        respawn_delay=RESPAWN_DELAY_S,
        on_exit=lambda event, context: _ended(name, stated, parameters, event.returncode, context.is_shutdown),
        remappings=list(_remaps(name, stated).items()),
    )


def _remaps(name: str, stated: Given) -> dict[str, str]:
    gated = GATED if name == "simulated_joints" and stated.gate else {}
    return {**stated.topics, **{topic: stated.topics.get(other, other) for topic, other in gated.items()}}


def _ended(name: str, stated: Given, parameters: Mapping[str, Any], code: int, asked: bool) -> list[TimerAction]:
    """What follows the end of a node; an error here ends the launch with exit code 1. asked: the launch is ending.
    A supervisor comes back otherwise than it began: with a latched UNKNOWN."""
    ended(name, code, asked)
    if asked or not stated.respawn or name != "supervisor":
        return []
    again = _node("irsbot_supervisor", name, stated, **{**parameters, "start_latched": True})
    return [TimerAction(period=RESPAWN_DELAY_S, actions=[again])]


def _nodes(context: LaunchContext) -> list[Node]:
    texts: Mapping[str, str] = {name: LaunchConfiguration(name).perform(context) for name, *_ in ARGUMENTS}
    stated = given(texts)
    nodes = [
        _node("irsbot_kinematics", "kinematics", stated, robot=stated.robot),
        _node("irsbot_supervisor", "supervisor", stated, robot=stated.robot),
    ]
    if stated.record:
        nodes.insert(0, _node("irsbot_supervisor", "recorder", stated, output=stated.output))
    if stated.simulate:
        drives = {"robot": stated.robot, "scenario": stated.scenario, "gated": stated.gate}
        nodes.append(_node("irsbot_supervisor", "simulated_joints", stated, **drives))
    return nodes


def generate_launch_description() -> LaunchDescription:
    declared = [DeclareLaunchArgument(name, default_value=value, description=text) for name, value, text in ARGUMENTS]
    return LaunchDescription([*declared, OpaqueFunction(function=_nodes)])
