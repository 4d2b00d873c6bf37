"""The suite: supervisor, kinematics, recorder, and simulated joints in place of hardware unless `simulate:=false`.

ros2 launch irsbot_supervisor supervision.launch.py robot:=irsbot2 namespace:=left params_file:=/path/mine.yaml
"""

from collections.abc import Mapping
from typing import Any

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction, TimerAction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from irsbot_supervisor.launch_arguments import ARGUMENTS, Given, ended, given
from irsbot_supervisor.suite import GATED

RESPAWN_DELAY_S = 1.0


def _node(package: str, name: str, said: Given, **parameters: object) -> Node:
    """What the command line says wins over the file."""
    more: dict[str, object] = {"use_sim_time": True} if said.use_sim_time else {}
    return Node(
        package=package,
        executable=f"{name}_node",
        namespace=said.namespace,
        parameters=[*([said.params_file] if said.params_file else []), {**parameters, **more}],
        ros_arguments=["--log-level", said.log_level],
        output="screen",
        respawn=said.respawn and name != "supervisor",
        respawn_delay=RESPAWN_DELAY_S,
        on_exit=lambda event, context: _ended(name, said, parameters, event.returncode, context.is_shutdown),
        remappings=list(_remaps(name, said).items()),
    )


def _remaps(name: str, said: Given) -> dict[str, str]:
    gated = GATED if name == "simulated_joints" and said.gate else {}
    return {**said.topics, **{topic: said.topics.get(other, other) for topic, other in gated.items()}}


def _ended(name: str, said: Given, parameters: Mapping[str, Any], code: int, asked: bool) -> list[TimerAction]:
    """What follows the end of a node; an error here ends the launch with exit code 1. asked: the launch is ending.
    A supervisor comes back otherwise than it began: with a latched UNKNOWN."""
    ended(name, code, asked)
    if asked or not said.respawn or name != "supervisor":
        return []
    again = _node("irsbot_supervisor", name, said, **{**parameters, "start_latched": True})
    return [TimerAction(period=RESPAWN_DELAY_S, actions=[again])]


def _nodes(context: LaunchContext) -> list[Node]:
    texts: Mapping[str, str] = {name: LaunchConfiguration(name).perform(context) for name, *_ in ARGUMENTS}
    said = given(texts)
    nodes = [
        _node("irsbot_kinematics", "kinematics", said, robot=said.robot),
        _node("irsbot_supervisor", "supervisor", said, robot=said.robot),
    ]
    if said.record:
        nodes.insert(0, _node("irsbot_supervisor", "recorder", said, output=said.output))
    if said.simulate:
        drives = {"robot": said.robot, "scenario": said.scenario, "gated": said.gate}
        nodes.append(_node("irsbot_supervisor", "simulated_joints", said, **drives))
    return nodes


def generate_launch_description() -> LaunchDescription:
    declared = [DeclareLaunchArgument(name, default_value=value, description=text) for name, value, text in ARGUMENTS]
    return LaunchDescription([*declared, OpaqueFunction(function=_nodes)])
