"""The opening of a live page: a person's hand comes into the arm's way, pushes it back, and withdraws.

Only the hand is scripted. It reaches for an arm that has waited for it, and pushes one that has touched it. The arm,
its sensors and its controller do what they do for any hand: a controller that does not see it runs into it at full
speed.
"""

import numpy as np

from pretouch.control.path import Path
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.types import ControlStep, FloatArray, Mode

_BEGIN_S = 2.2
"""Time in the simulation at which the hand sets out [s]: the arm is on its path, and the page is drawn."""
_PHASE_M = 1.25
"""Where on the paper's path the arm meets the hand [m]: on the circle low, on the person's side, after five seconds."""
_BACK_M = 0.2
"""The hand pushes the arm towards the path's point so far before that [m]."""
_COME_M_S, _PUSH_M_S, _GO_M_S = 0.35, 0.2, 0.5
"""Speeds of the hand, coming, pushing and going [m/s]."""
_STAY_S = 0.7
"""Time the hand stays after the arm has reacted to it [s]."""
_SLOW_M_S, _WAITS_S = 0.1, 1.0
"""An arm slower than that [m/s] for so long [s] waits for the hand."""
_PATIENCE_S = 12.0
"""Time after which the hand goes on as if an arm that does not react had reacted [s]."""
_HOME_M = 0.01
"""Distance from where it set out at which the hand is back [m]."""


class Opening:
    """Target of the hand in each control cycle, until `over`."""

    def __init__(self, model: RobotModel, skin: Skin, path: Path, scale: float, home: FloatArray) -> None:
        """Begin at time 0, with the hand at `home` (3,) [m], where it also returns to.

        The path is `scale` times the paper's. The hand is as high above it as the outermost units of the arm.
        """
        at = _PHASE_M * scale
        meets, self._above = path.point(at), np.array([0.0, 0.0, _units_above(model, skin)])
        self._back = path.point(at - _BACK_M) - meets
        self._place = meets + self._above
        self._home, self._target, self._last, self._moved = home, home.copy(), 0.0, _BEGIN_S
        self._reacted: float | None = None
        self.over = False
        """True if the hand is back where it set out."""

    def target(self, step: ControlStep) -> FloatArray:
        """Return where the hand is to be next (3,) [m], after a step of the controller."""
        now, elapsed = step.stamp, step.stamp - self._last
        self._last = now
        waited = now > self._moved + _WAITS_S  # for good: an arm that retreats from the hand is not slow
        if now < _BEGIN_S or (np.linalg.norm(step.ee_velocity) > _SLOW_M_S and not waited):
            self._moved = now
        if self._reacted is None and (step.mode is Mode.REACT or now > _PATIENCE_S):
            self._reacted = now
        if now < _BEGIN_S:
            return self._target
        going = self._reacted is not None and now > self._reacted + _STAY_S
        goal, speed = self._place, _COME_M_S
        if going:
            goal, speed = self._home, _GO_M_S
        elif self._reacted is not None:
            goal, speed = self._target + self._back, _PUSH_M_S
        elif waited:
            goal, speed = step.ee_position + self._above, _PUSH_M_S
        left = goal - self._target
        distance = float(np.linalg.norm(left))
        self._target = self._target + left * min(1.0, speed * elapsed / max(distance, 1e-9))
        self.over = going and distance < _HOME_M
        return self._target

    def withdraw(self) -> None:
        """Have the hand go back now, so that the arm is free for what somebody does."""
        self._reacted = -np.inf


def _units_above(model: RobotModel, skin: Skin) -> float:
    """Mean height above the end-effector, ready posture, of the units that most joints move [m]."""
    joints = model.moved_by[skin.link].sum(axis=1)
    outermost = np.flatnonzero(joints == joints.max())
    kin, link = model.kinematics(model.description.q_ready), skin.link[outermost]
    raised = np.einsum("ki,ki->k", kin.rotation[link, 2], skin.T_link_sensor[outermost, :3, 3])
    return float((kin.position[link, 2] + raised).mean() - kin.position[model.ee, 2])
