"""One step of the motion, made of its parts as the controller makes it."""

from typing import Any

from pretouch.control.interface import MotionBody, MotionRequest
from pretouch.control.joint_box import JointLimits
from pretouch.control.motion import Motion, MotionState, joint_motion, motion_setup, restriction_on
from pretouch.groups import Kinematics
from pretouch.profiles import Profile
from pretouch.robot.model import RobotModel
from pretouch.types import Obstacles, RobotState


class Mover:
    """An arm's motion with a profile, and what it remembers."""

    def __init__(self, model: RobotModel, limits: JointLimits, profile: Profile, units: int = 7) -> None:
        self.body = MotionBody(model, units, limits, profile.task)
        self.setup = motion_setup(self.body, profile.null_space, profile.failure.solver_iterations)
        self.part = restriction_on(profile.approach, self.body)
        self.remembered: Any = None if profile.approach is None else profile.approach.init(self.body)
        self.state = MotionState(0.0 * limits.qd_max)

    def step(self, kin: Kinematics, robot: RobotState, obstacles: Obstacles, request: MotionRequest) -> Motion:
        """Return the motion of one step."""
        allowed, self.remembered = self.part.step(self.remembered, self.body, kin, robot, obstacles, request)
        motion, self.state = joint_motion(self.state, self.setup, kin, robot, obstacles, request, allowed)
        return motion
