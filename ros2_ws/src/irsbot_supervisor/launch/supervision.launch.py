"""The suite: supervisor, kinematics, recorder, and simulated joints in place of hardware unless `simulate:=false`.

ros2 launch irsbot_supervisor supervision.launch.py robot:=irsbot2 namespace:=left simulate:=true
"""

from collections.abc import Sequence

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration, PythonExpression
from launch_ros.actions import Node

ARGUMENTS = (
    ("robot", "irsbot2", "preset name or YAML file of the robot"),
    ("namespace", "", "namespace of all nodes and topics"),
    ("simulate", "true", "simulated joints in place of hardware"),
    ("scenario", "pick_and_place", "what the simulated joints do"),
    ("gate", "false", "the simulated joints take commands through the command gate alone; scenario:=stand then"),
    ("record", "true", "record the run"),
    ("output", "", "new folder for the bag; empty: one named after the time"),
)


def _gated(gated: str, free: str) -> PythonExpression:
    return PythonExpression(["'", gated, "' if '", LaunchConfiguration("gate"), "' == 'true' else '", free, "'"])


def _node(
    package: str,
    name: str,
    condition: IfCondition | None = None,
    remappings: Sequence[tuple[str, PythonExpression]] = (),
    **parameters: object,
) -> Node:
    return Node(
        package=package,
        executable=f"{name}_node",
        namespace=LaunchConfiguration("namespace"),
        parameters=[parameters],
        output="screen",
        condition=condition,
        remappings=list(remappings),
    )


def generate_launch_description() -> LaunchDescription:
    robot = LaunchConfiguration("robot")
    simulate = IfCondition(LaunchConfiguration("simulate"))
    record = IfCondition(LaunchConfiguration("record"))
    return LaunchDescription(
        [
            *(DeclareLaunchArgument(name, default_value=value, description=text) for name, value, text in ARGUMENTS),
            _node("irsbot_supervisor", "recorder", record, output=LaunchConfiguration("output")),
            _node("irsbot_kinematics", "kinematics", robot=robot),
            _node("irsbot_supervisor", "supervisor", robot=robot),
            _node(
                "irsbot_supervisor",
                "simulated_joints",
                simulate,
                robot=robot,
                scenario=LaunchConfiguration("scenario"),
                gated=LaunchConfiguration("gate"),
                remappings=[
                    ("joint_trajectory", _gated("command_out", "joint_trajectory")),
                    ("joint_velocity", _gated("velocity_out", "joint_velocity")),
                ],
            ),
        ]
    )
