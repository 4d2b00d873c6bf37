"""The kinematics node alone: `ros2 launch irsbot_kinematics kinematics.launch.py robot:=irsbot2`."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node


def generate_launch_description() -> LaunchDescription:
    return LaunchDescription(
        [
            DeclareLaunchArgument("robot", default_value="irsbot2", description="preset name or YAML file"),
            DeclareLaunchArgument("namespace", default_value="", description="namespace of the node"),
            Node(
                package="irsbot_kinematics",
                executable="kinematics_node",
                namespace=LaunchConfiguration("namespace"),
                parameters=[{"robot": LaunchConfiguration("robot")}],
                output="screen",
            ),
        ]
    )
