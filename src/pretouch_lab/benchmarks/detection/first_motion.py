"""How an arm would begin to move with what a detector takes for a contact, in a stream that went on without that."""

import numpy as np

from pretouch.contact.detector import Detection
from pretouch.contact.response import Felt, answered, began, noticed, response_init, seen_near
from pretouch.params import Profile
from pretouch.robot.body import Capsules
from pretouch.robot.model import Kinematics, RobotModel
from pretouch.types import FloatArray, Obstacles, RobotState

_NO_PLANES = np.zeros((0, 4))
_NO_CAPSULES = Capsules(np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0))


class FirstMotion:
    """The answers of a profile to alarms."""

    def __init__(self, model: RobotModel, profile: Profile, q: FloatArray, rest: int) -> None:
        """Take the arm, its profile, first joint positions (n,) [rad], and the steps of an answer."""
        self._model, self._profile, self._rest = model, profile, rest
        self._state = response_init(q, profile.reaction)
        self._left, self._moves = 0, False

    def step(self, kin: Kinematics, robot: RobotState, found: Detection, near: Obstacles) -> FloatArray | None:
        """Take a step in; return the joint velocities (n,) [rad/s] with which an answer begins to move, else None.

        That may be later than the alarm, for static friction holds an arm until the push is strong enough. An answer
        that is a velocity of the end-effector (eq. 12) is taken to be made by the least joint velocities that have it,
        as eq. 2 does far from limits and singularities.
        """
        p, close = self._profile, seen_near(near, self._profile.reaction)
        felt = Felt(self._model, kin, robot, found, close, robot.qd_commanded, p, _NO_PLANES, _NO_CAPSULES)
        if self._left == 0:
            self._state = noticed(self._state, "task", felt, 0.0, False)
            if found.contact is None:
                return None
            self._state = began(self._state, "task", felt, 0.0, kin.position[self._model.ee])
            self._left, self._moves = self._rest, False
        elif not self._moves:
            self._state = noticed(self._state, "react", felt, 0.0, False)
        self._left -= 1
        if self._moves:
            return None
        answer, self._state = answered(self._state, "react", felt)
        if answer is None:
            return None
        qd = answer.qd
        if qd is None:
            qd = np.asarray(np.linalg.pinv(self._model.ee_jacobian(kin)[:3]) @ answer.velocity)
        self._moves = bool(qd.any())
        return qd if self._moves else None
