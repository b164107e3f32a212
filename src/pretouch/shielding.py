"""The controller as a filter between a program's own commander and its arm."""

from dataclasses import replace

from pretouch.contact.residual_model import ResidualModel
from pretouch.control.path import segment
from pretouch.controller import Controller
from pretouch.desired import twist
from pretouch.loop import Cycle, explained, instant
from pretouch.perception.scene_filter import Fixtures, no_fixtures
from pretouch.profiles import Profile
from pretouch.profiles import profile as named
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.types import ControlStep, Inputs, RobotState

_STILL = (0.0, 0.0, 0.0)


class Shield:
    """Takes the motion that a program requests (`Inputs.desired`) and returns the motion that its arm may make.

    Call it once a period, `controller.limits.period`, and send `command` of each step to the arm. At the end of the
    loop, `loop.come_to_rest` brings the arm to rest.
    """

    def __init__(self, controller: Controller, robot: RobotState, learnt: ResidualModel | None = None) -> None:
        """Start from an arm's state; an unusable state is a RobotStateError."""
        self.controller = controller
        self.state = controller.init(robot, learnt)
        self.cycle: Cycle | None = None
        """The last turn, for a recorder (`pretouch.Recording`)."""

    def __call__(self, inputs: Inputs) -> ControlStep:
        """Return the step of one period; without a desired motion the hand stays where it is."""
        before, period = self.state, self.controller.limits.period
        now = instant(inputs.stamp, period, inputs.robot, inputs.readings, inputs.touch)
        robot = explained(self.controller, before, inputs.robot, now)
        inputs = replace(inputs, stamp=now, robot=robot, desired=inputs.desired or twist(now, _STILL))
        step, self.state = self.controller.step(before, inputs)
        self.cycle = Cycle(inputs, before, step, self.state)
        return step


def shield(
    model: RobotModel, skin: Skin, robot: RobotState, profile: Profile | str = "pretouch",
    fixtures: Fixtures | None = None, learnt: ResidualModel | None = None,
) -> Shield:  # fmt: skip
    """Put the controller between a program's commander and its arm.

    Args:
        model: of the arm.
        skin: on it.
        robot: state of the arm before the first step.
        profile: or the text of one; its `task.control_period_s` is the period of the program's loop (`at_rate`).
        fixtures: bodies around the arm that are no obstacles; None without any.
        learnt: free motion as an earlier session left it.
    """
    x, y, z = model.kinematics(robot.q).position[model.ee].tolist()
    nowhere = segment((x, y, z), (x, y, z + 0.001))  # a controller has a path; this one is never followed
    chosen = named(profile) if isinstance(profile, str) else profile
    around = no_fixtures() if fixtures is None else fixtures
    return Shield(Controller(model, skin, around, nowhere, chosen), robot, learnt)
