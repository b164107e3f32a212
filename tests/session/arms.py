"""Arms without physics for the tests of a session."""

import time

import numpy as np

from pretouch.errors import RobotError
from pretouch.session.run import Ending
from pretouch.types import RobotState

DT = 0.01
AT_REST = Ending(rest_unknown="")


class PushedArm:
    """Stands still in a time of its own and feels what a script says: ports Robot and Clock."""

    def __init__(self, model, force=lambda time: np.zeros(3), noise=0.0, tau_sign=1.0, wrench_sign=1.0, R=None):
        self.model, self.force, self.noise = model, force, noise
        self.tau_sign, self.wrench_sign, self.R = tau_sign, wrench_sign, np.eye(3) if R is None else R
        self.q, self.now, self.rng = model.description.q_ready, 100.0, np.random.default_rng(0)

    def tick(self):
        self.now += DT
        return self.now

    def read(self):
        felt = self.force(self.now) + self.noise * self.rng.standard_normal(3)
        wrench = np.array([*felt, 0.0, 0.0, 0.0])
        tau = self.model.ee_jacobian(self.model.kinematics(self.q)).T @ wrench
        told = self.wrench_sign * np.array([*(self.R @ felt), 0.0, 0.0, 0.0])
        zero = np.zeros(self.model.n)
        return RobotState(self.now, self.q, zero, self.q, zero, self.tau_sign * tau, told)


class FollowingArm:
    """Follows its commands exactly, in the machine's time: the port `Arm`."""

    name = "arm of a test"

    def __init__(self, q, against=()):
        self.q, self.qd, self.against = np.array(q), np.zeros(len(q)), against
        self.begun, self.ended, self.commands, self._last = 0, 0, [], time.monotonic()
        self.dies_after, self.end_fails, self.gone = np.inf, False, False
        self.wrench = np.zeros(6)

    def read(self):
        if self.ended and self.gone:
            raise RobotError("No state has come.")
        self._move()
        return RobotState(self._last, self.q, self.qd, self.q, self.qd, np.zeros(len(self.q)), self.wrench)

    def command(self, qd):
        if not self.begun or self.ended:
            raise RobotError("The arm takes no commands.")
        if len(self.commands) >= self.dies_after:
            raise RobotError("The process that speaks with the arm has ended.")
        self._move()
        self.qd = np.array(qd)
        self.commands.append(self.qd)

    def _move(self):
        now = time.monotonic()
        self.q, self._last = self.q + self.qd * (now - self._last), now

    def unfit(self):
        return self.against

    def begin(self):
        self.begun += 1

    def end(self):
        self.ended += 1
        if self.end_fails:
            raise RobotError("The arm does not answer.")

    def report(self):
        return "All went well."
