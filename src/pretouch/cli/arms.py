"""The arms that can be named on the command line."""

from typing import Literal

from pretouch.robot.description import fr3, panda
from pretouch.robot.model import RobotModel

_ARMS = {"panda": panda, "fr3": fr3}


def arm_model(name: Literal["panda", "fr3"]) -> RobotModel:
    """Return the model of an arm."""
    return RobotModel(_ARMS[name]())
