"""The suite: supervisor, kinematics, recorder, and simulated joints in place of hardware unless `simulate:=false`.

ros2 launch irsbot_supervisor supervision.launch.py robot:=irsbot2 namespace:=left params_file:=/path/mine.yaml
"""

from collections.abc import Mapping
from typing import Any

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, LogInfo, OpaqueFunction, TimerAction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from irsbot_supervisor.nodes.launch_arguments import ARGUMENTS, Given, ended, given, parameters_of
from irsbot_supervisor.processes.suite import GATED

RESPAWN_DELAY_S = 1.0


def _node(name: str, stated: Given, parameters: Mapping[str, Any]) -> Node:
    return Node(
        package="irsbot_kinematics" if name == "kinematics" else "irsbot_supervisor",
        executable=f"{name}_node",
        namespace=stated.namespace,
        parameters=[*filter(None, [stated.params_file, dict(parameters)])],
        ros_arguments=["--log-level", stated.log_level],
        output="screen",
        on_exit=lambda event, context: _ended(name, stated, parameters, event.returncode, context.is_shutdown),
        remappings=list(_remaps(name, stated).items()),
    )


def _remaps(name: str, stated: Given) -> dict[str, str]:
    gated = GATED if name == "simulated_joints" and stated.gate else {}
    return {**stated.topics, **{topic: stated.topics.get(other, other) for topic, other in gated.items()}}


def _ended(
    name: str, stated: Given, parameters: Mapping[str, Any], code: int, asked: bool
) -> list[LogInfo | TimerAction]:
    """Return the actions after the end of a node. An exception ends the launch with exit code 1.

    asked: True if the launch is shutting down.
    """
    end = ended(name, stated, code, asked)
    again = [_node(name, stated, {**parameters, **end.changes})] if end.again else []
    told = [LogInfo(msg=end.text)] if end.text else []
    return [*told, *(TimerAction(period=RESPAWN_DELAY_S, actions=[node]) for node in again)]


def _nodes(context: LaunchContext) -> list[Node]:
    texts: Mapping[str, str] = {name: LaunchConfiguration(name).perform(context) for name, *_ in ARGUMENTS}
    stated = given(texts)
    namespace = context.launch_configurations.get("ros_namespace", "")  # of a PushRosNamespace around this file
    return [_node(name, stated, parameters) for name, parameters in parameters_of(stated, namespace).items()]


def generate_launch_description() -> LaunchDescription:
    declared = [DeclareLaunchArgument(name, default_value=value, description=text) for name, value, text in ARGUMENTS]
    return LaunchDescription([*declared, OpaqueFunction(function=_nodes)])
