"""Whether the extra is installed. Modules of this package but `params` and this one need it to be imported."""

from importlib.util import find_spec

from pretouch.errors import RobotError


def check_extra() -> None:
    """Refuse to go on without the extra, saying how to install it: a RobotError."""
    if find_spec("cyclonedds") is None or find_spec("rosbags") is None:
        raise RobotError("ROS 2 needs the extra 'ros2': pip install 'pretouch[ros2]'")
