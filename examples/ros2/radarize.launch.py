"""`ros2 launch radarize.launch.py replay:=walk.h5`, or `config:=radarize port:=/dev/ttyACM0`."""

from pathlib import Path

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, ExecuteProcess
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

PARAMETERS = ("replay", "config", "port", "odometry", "scans")
MOUNT = ("x", "y", "z", "yaw", "pitch", "roll")


def generate_launch_description() -> LaunchDescription:
    """The node, and where the radar is on the robot: x, y, z in m, yaw, pitch and roll in rad."""
    declared = [DeclareLaunchArgument(name, default_value="") for name in PARAMETERS]
    declared += [DeclareLaunchArgument(name, default_value="0") for name in MOUNT]
    # In quotes, so that ROS reads each as a string, an empty one too.
    given = [part for name in PARAMETERS for part in ("-p", [f"{name}:='", LaunchConfiguration(name), "'"])]
    node = Path(__file__).with_name("radarize_node.py")
    place = [part for name in MOUNT for part in (f"--{name}", LaunchConfiguration(name))]
    frames = ["--frame-id", "base_link", "--child-frame-id", "radar"]
    return LaunchDescription(
        [
            *declared,
            ExecuteProcess(cmd=["python3", str(node), "--ros-args", *given], output="screen"),
            Node(package="tf2_ros", executable="static_transform_publisher", arguments=[*place, *frames]),
        ]
    )
