"""How an arm would begin to move with what a detector takes for a contact, in a stream that went on without that."""

import numpy as np

from pretouch.contact.admittance import Admittance
from pretouch.contact.detector import Body, Detection
from pretouch.contact.reaction import ReactionInputs
from pretouch.contact.virtual_mass import mass_init
from pretouch.modes import Event, ModeState
from pretouch.profiles import Profile
from pretouch.robot.kinematics import Kinematics
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.types import FloatArray, Mode, Obstacles, RobotState

_TRACK, _REACT = ModeState(Mode.TRACK, Event.CLEAR), ModeState(Mode.REACT, Event.REACTING)


class FirstMotion:
    """The answers of a profile to alarms."""

    def __init__(self, model: RobotModel, profile: Profile, q: FloatArray, rest: int) -> None:
        """Take the arm, its profile, first joint positions (n,) [rad], and the steps of an answer."""
        self._body = Body(model, Skin((), model), profile.task.control_period_s)
        self._react, self._rest = profile.react, rest
        self._state, self._mass = self._react.init(self._body, q), mass_init(model.n, Admittance.of_kind(self._react))
        self._left, self._moves = 0, False

    def step(self, kin: Kinematics, robot: RobotState, found: Detection, near: Obstacles) -> FloatArray | None:
        """Take a step in; return the joint velocities (n,) [rad/s] with which an answer begins to move, else None.

        That may be later than the alarm, for static friction holds an arm until the push is strong enough. An answer
        that is a velocity of the end-effector (eq. 12) is taken to be made by the least joint velocities that have it,
        as eq. 2 does far from limits and singularities.
        """
        mode = _REACT if self._left else _TRACK
        given = ReactionInputs(mode, kin, robot, found, near, False, robot.qd_commanded, 0.0, False, self._mass)
        self._moves = self._moves and self._left > 0
        if not self._moves:
            _, self._state = self._react.sense(self._state, self._body, given)
        if self._left == 0 and found.contact is None:
            return None
        self._left = (self._left or self._rest) - 1
        if self._moves:
            return None
        answer, self._state = self._react.move(self._state, self._body, given, _REACT)
        if answer is None:
            return None
        least = np.linalg.pinv(self._body.model.ee_jacobian(kin)[:3])
        qd = np.asarray(least @ answer.velocity) if answer.qd is None else answer.qd
        self._moves = bool(qd.any())
        return qd if self._moves else None
