"""A profile's contact detector on its own, given the steps of a stream one after the other."""

from pretouch.contact.detector import Body, Detection, Sample
from pretouch.contact.window import add_force, window_init
from pretouch.profiles import Profile
from pretouch.robot.kinematics import Kinematics
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.types import Obstacles, RobotState, TouchReadings


class DetectorAlone:
    """It remembers by itself, and never reacts: what follows an alarm is for the stream to say."""

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
