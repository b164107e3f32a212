"""A detector alone on recorded steps, the reactions to its alarms, and the ghost that moves in such steps."""

from collections.abc import Callable

import numpy as np

from pretouch.contact.admittance import Admittance
from pretouch.contact.detector import Body, Detection, Sample
from pretouch.contact.reaction import ReactionInputs
from pretouch.contact.virtual_mass import mass_init
from pretouch.contact.window import add_force, window_init
from pretouch.modes import Event, ModeState
from pretouch.profiles import Profile
from pretouch.robot.kinematics import Kinematics
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.sim.plant import Plant
from pretouch.types import FloatArray, Mode, Obstacles, RobotState

_TRACK, _REACT = ModeState(Mode.TRACK, Event.CLEAR), ModeState(Mode.REACT, Event.REACTING)


class DetectorAlone:
    """A profile's contact detector without a controller; it takes the steps of a stream in order.

    It keeps its own state and never reacts: the stream has the steps that follow an alarm.
    """

    def __init__(self, profile: Profile, model: RobotModel) -> None:
        """Take the arm; the detector reads no touch sensors."""
        self.body = Body(model, Skin((), model), profile.task.control_period_s)
        self._detector, self._params = profile.detect, profile.window
        self.window, self.state = window_init(profile.window.samples), self._detector.init(self.body)

    def step(
        self, kin: Kinematics, robot: RobotState, near: Obstacles, reacting: bool = False, watched: bool = True
    ) -> Detection:
        """Detect in one step; `reacting` and `watched` are flags of the arm and its skin in that step."""
        before, force = self.window, None if robot.wrench is None else robot.wrench[:3]
        window = add_force(before, force, self._params)
        sample = Sample(robot.stamp, kin, robot, window, before.full, near, reacting, watched)
        detection, self.state = self._detector.step(self.state, self.body, sample)
        self.window = before if reacting and self._params.freeze_while_reacting else window
        return detection


class FirstMotion:
    """First motion with which an arm would react to an alarm, in a stream whose arm did not react.

    It serves reactions in joint space, which learn in free motion and may begin late.
    """

    def __init__(self, model: RobotModel, profile: Profile, q: FloatArray, rest: int) -> None:
        """Take the arm, its profile, the first joint positions (n,) [rad], and the number of steps of a reaction."""
        self._body = Body(model, Skin((), model), profile.task.control_period_s)
        self._react, self._rest = profile.react, rest
        self._state, self._mass = self._react.init(self._body, q), mass_init(model.n, Admittance.of_kind(self._react))
        self._left, self._moves = 0, False

    def step(self, kin: Kinematics, robot: RobotState, detection: Detection, near: Obstacles) -> FloatArray | None:
        """Take one step; return the joint velocities (n,) [rad/s] with which a reaction begins, else None.

        The motion may begin after the alarm: static friction holds the arm until the push is strong enough.
        """
        mode = _REACT if self._left else _TRACK
        inputs = ReactionInputs(mode, kin, robot, detection, near, False, robot.qd_commanded, 0.0, False, self._mass)
        self._moves = self._moves and self._left > 0
        if not self._moves:
            _, self._state = self._react.sense(self._state, self._body, inputs)
        if self._left == 0 and detection.contact is None:
            return None
        self._left = (self._left or self._rest) - 1
        if self._moves:
            return None
        answer, self._state = self._react.move(self._state, self._body, inputs, _REACT)
        if answer is None or answer.qd is None:
            return None
        self._moves = bool(answer.qd.any())
        return answer.qd if self._moves else None


Place = FloatArray | Callable[[float], FloatArray]
"""Position (3,) [m], base frame; a function of time [s] for a moving object."""


class Ghost:
    """Places the ghost of a plant's scene, before each physics step if it moves."""

    def __init__(self, plant: Plant, place: Place) -> None:
        """Attach to a plant whose scene has a ghost; `place` is the ghost's centre."""
        body = plant.mj_model.body("ghost")
        # a view into the simulation's memory, taken once
        self._at = plant.mj_data.mocap_pos[int(plant.mj_model.body_mocapid[body.id])]
        if isinstance(place, np.ndarray):
            self._at[:] = place
        else:
            self._place = place
            plant.before_each_step(self._move)

    def _move(self, time: float) -> None:
        self._at[:] = self._place(time)
