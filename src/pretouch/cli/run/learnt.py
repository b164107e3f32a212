"""Which file of free motion a run begins with and keeps, by what was said on the command line."""

from pathlib import Path
from typing import TYPE_CHECKING

from pretouch.cli.run.asking import say
from pretouch.cli.writing import check_writable
from pretouch.contact.sequential_test import SequentialTest
from pretouch.controller import Controller
from pretouch.errors import ParameterError
from pretouch.session.free_motion import FreeMotion, Home, home_of
from pretouch.session.remembered import state_folder

if TYPE_CHECKING:
    from pretouch.cli.run.options import RobotOptions


def free_motion(
    options: "RobotOptions", controller: Controller, robot: str, remembered: bool = True
) -> FreeMotion | None:
    """Find what is known of a robot's free motion, and say it; None where none is kept.

    Args:
        options: `learnt`, `learn_anew` and `no_learnt` of them.
        controller: that moves the arm.
        robot: what it is known by.
        remembered: whether it has a file of its own where none is named.
    """
    if not isinstance(controller.profile.detect, SequentialTest):
        if options.learnt or options.learn_anew:
            raise ParameterError(
                f"The profile {controller.profile.name} learns no free motion: choose --profile pretouch, or leave out"
                " --learnt and --learn-anew."
            )
        return None
    if options.no_learnt or not (options.learnt or remembered):
        return None
    home = home_of(robot, state_folder())
    if options.learnt:
        home = Home(robot, Path(options.learnt), True)
        check_writable("file of free motion", home.place)
    found = FreeMotion(home, controller, options.learn_anew)
    for sentence in found.found:
        say(sentence)
    return found
