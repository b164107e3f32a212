"""A joystick as the commander: joy and teleop_twist_joy, whose twists Pretouch takes on /pretouch/twist.

    ros2 launch pretouch_bringup joystick.launch.py

Hold the enable button (by default 4) to move; let go, and the arm rests.
"""

import os

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node


def generate_launch_description():
    """Return the description that `ros2 launch` asks for."""
    folder = get_package_share_directory("pretouch_bringup")
    config = LaunchConfiguration("config")
    return LaunchDescription(
        [
            DeclareLaunchArgument("config", default_value=os.path.join(folder, "config", "joystick.yaml")),
            Node(package="joy", executable="joy_node", name="joy_node", parameters=[config]),
            Node(
                package="teleop_twist_joy",
                executable="teleop_node",
                name="teleop_twist_joy_node",
                parameters=[config],
                remappings=[("cmd_vel", "/pretouch/twist")],
            ),
        ]
    )
