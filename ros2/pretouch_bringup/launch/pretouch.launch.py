"""Start `pretouch run ros2` with the options of a file.

    ros2 launch pretouch_bringup pretouch.launch.py config:=/path/to/mine.yaml yes:=true

The program is found on the PATH, or given by `program:=`, as of a virtual environment. A launch has no terminal to ask
in, so nothing moves without `yes:=true`; confirm the force sign once by `pretouch run` itself.
"""

import os

import yaml
from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, ExecuteProcess, OpaqueFunction
from launch.substitutions import LaunchConfiguration


def words(options):
    """Return the options of a file as `pretouch run` takes them: a true one alone, a list as several words."""
    found = []
    for name, value in options.items():
        if value is False:
            continue
        given = [] if value is True else value if isinstance(value, list) else [value]
        found += [f"--{name.replace('_', '-')}", *map(str, given)]
    return found


def start(context):
    """Return what runs."""
    program, config, yes = (LaunchConfiguration(name).perform(context) for name in ("program", "config", "yes"))
    with open(config, encoding="utf-8") as file:
        options = yaml.safe_load(file)
    sure = ["--yes"] if yes == "true" else []
    command = [program, "run", "ros2", *words(options), *sure]
    # braking and closing a recording take a while after Ctrl-C
    return [ExecuteProcess(cmd=command, output="screen", sigterm_timeout="20", sigkill_timeout="40")]


def generate_launch_description():
    """Return the description that `ros2 launch` asks for."""
    folder = get_package_share_directory("pretouch_bringup")
    return LaunchDescription(
        [
            DeclareLaunchArgument("config", default_value=os.path.join(folder, "config", "fr3_joystick.yaml")),
            DeclareLaunchArgument("program", default_value="pretouch"),
            DeclareLaunchArgument("yes", default_value="false", description="Do not ask before the arm moves."),
            OpaqueFunction(function=start),
        ]
    )
