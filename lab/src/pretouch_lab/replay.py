"""What recorded steps are given to: a detector alone. And what is seen while they are recorded: a ghost."""

from collections.abc import Callable

import numpy as np

from pretouch.contact.detector import Body, Detection, Sample
from pretouch.contact.window import add_force, window_init
from pretouch.profiles import Profile
from pretouch.robot.kinematics import Kinematics
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.sim.plant import Plant
from pretouch.types import FloatArray, Obstacles, RobotState, TouchReadings


class DetectorAlone:
    """A profile's contact detector on its own, given the steps of a stream one after the other.

    It remembers by itself, and never reacts: what follows an alarm is for the stream to say.
    """

    def __init__(self, profile: Profile, model: RobotModel, skin: Skin | None = None) -> None:
        """Take the arm, and its units where the detector reads more of them than what is near."""
        self.body = Body(model, skin or Skin((), model), profile.task.control_period_s)
        self._detector, self._params = profile.detect, profile.window
        self.window, self.state = window_init(profile.window.samples), self._detector.init(self.body)

    def step(
        self, kin: Kinematics, robot: RobotState, near: Obstacles, reacting: bool = False, watched: bool = True,
        touches: TouchReadings | None = None,
    ) -> Detection:  # fmt: skip
        """Take in a step: posture, robot state, obstacles, whether it reacts and is watched, touch readings."""
        before, force = self.window, None if robot.wrench is None else robot.wrench[:3]
        window = add_force(before, force, self._params)
        sample = Sample(robot.stamp, kin, robot, window, before.full, near, reacting, watched, touches)
        found, self.state = self._detector.step(self.state, self.body, sample)
        self.window = before if reacting and self._params.freeze_while_reacting else window
        return found


class Ghost:
    """Puts the ghost of a plant's scene where a function of time says, before each physics step."""

    def __init__(self, plant: Plant, place: Callable[[float], FloatArray]) -> None:
        """Attach to a plant whose scene has a ghost; `place(time)` returns its centre (3,) [m], base frame."""
        body = plant.mj_model.body("ghost")
        # a view into the simulation's memory, taken once
        self._at, self._place = plant.mj_data.mocap_pos[int(plant.mj_model.body_mocapid[body.id])], place
        plant.before_each_step(self._move)

    @property
    def position(self) -> FloatArray:
        """Centre of the ghost (3,) [m], base frame."""
        return np.array(self._at)

    def _move(self, time: float) -> None:
        self._at[:] = self._place(time)
