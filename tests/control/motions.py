"""One step of the motion, with obstacles that a test chooses."""

import numpy as np
from tests.following_arm import controller_of

from pretouch.decision import move_restricted
from pretouch.faults import put_robot
from pretouch.line import MOVE
from pretouch.modes import CLEAR
from pretouch.profiles import Profile
from pretouch.robot.kinematics import Kinematics
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import paper_skin
from pretouch.types import ControlStep, FloatArray, Obstacles, Report, RobotState


class Mover:
    """An arm's motion with a profile, and what it remembers."""

    def __init__(self, model: RobotModel, profile: Profile) -> None:
        self.controller = controller_of(model, paper_skin(model), profile)
        q, still = model.description.q_ready, np.zeros(model.n)
        state = self.controller.init(RobotState(0.0, q, still, q, still, still, None))
        self.memory, self.approach = state.memory, state.approach

    def step(
        self,
        kin: Kinematics,
        robot: RobotState,
        obstacles: Obstacles,
        velocity: FloatArray,
        goal: FloatArray,
        hold: bool = False,
    ) -> ControlStep:
        """Return the motion of one step in which velocity and orientation are asked for, or to hold."""
        controller, now = self.controller, self.controller.blank.copy()
        put_robot(now.part("robot", Report), robot)
        now.fill("kin", kin)
        now.put("ee", kin.position[controller.model.ee])
        for room, part in zip(now.part("scene.near", Obstacles), obstacles, strict=True):
            room[: len(part)] = part
        now.put("scene.total", len(obstacles.unit))
        now.put("request.velocity", velocity)
        now.put("request.goal", goal)
        now.put("request.hold", hold)
        if controller.approach is None:
            controller.take(self.memory, now, controller.beside, MOVE, MOVE)
        else:
            part = controller.approach
            self.approach = move_restricted(controller, part, self.approach, self.memory, now)
        return ControlStep.of(now, CLEAR)
