"""Flacco, Kroeger, De Luca, Khatib, "A depth space approach to human-robot collision avoidance", ICRA 2012.

A repulsive velocity moves the end-effector. Near other points of the body it slows the joints that move these points
towards an obstacle.

docs/explanation/baselines.md states which parts are reproduced. The values are those in the code of the authors of
arXiv 2510.24683, who compare it with their own controller.
"""

from dataclasses import dataclass, replace

import numpy as np

from pretouch.checks import NonNegative, Positive
from pretouch.contact.moving_thresholds import MovingThresholds
from pretouch.control.approach import MotionBody, MotionRequest, Restricted, Restriction
from pretouch.profiles import profile
from pretouch.robot.kinematics import Kinematics
from pretouch.types import WHOLE, FloatArray, Obstacles, RobotState

_STILL = 1e-9
"""Joint velocity per speed of a point below which the joint does not count [rad/m]."""


@dataclass(frozen=True)
class Flacco(Restriction, name="flacco"):
    """A repulsive velocity of the end-effector, and lower limits of joint velocities."""

    v_max_m_s: Positive = 0.4
    """Largest repulsive velocity of the end-effector V_max [m/s]. An older draft of that code has 0.21."""
    alpha: Positive = 6.0
    """Steepness alpha of the repulsion [1]."""
    rho_m: Positive = 0.4
    """Distance rho beyond which there is practically no repulsion [m]."""
    size_m: NonNegative = 0.0
    """Subtracted from the distances to the end-effector origin [m]. The published repulsion ignores the hand's size;
    0.1 is about half the width of the Panda's hand."""

    def step(
        self, state: None, body: MotionBody, kin: Kinematics, robot: RobotState, near: Obstacles, request: MotionRequest
    ) -> tuple[Restricted, None]:
        """Return a velocity to add and limits of the joint velocities; there are no rows."""
        model, points = body.model, zip(near.link, near.body_point, near.direction, strict=True)
        motion = [np.linalg.pinv(model.jacobian(kin, int(link), at)[:3]) @ d for link, at, d in points]
        speeds = self.slowed(np.reshape(motion, (-1, model.n)), near.body_distance, body.limits.qd_max)
        velocity = self.velocity(kin.position[model.ee], near)
        rows = np.zeros((0, model.n)), np.zeros(0), np.zeros(0, WHOLE)
        return Restricted(*rows, weight=1.0, velocity=velocity, speeds=speeds), None

    def risk(self, distance: FloatArray) -> FloatArray:
        """1 / (1 + exp(alpha (2 d / rho - 1))) at distances (K,) [m]: V_max times that is the repulsion."""
        exponent = np.clip(self.alpha * (2.0 * distance / self.rho_m - 1.0), -500.0, 500.0)
        return np.asarray(1.0 / (1.0 + np.exp(exponent)))

    def velocity(self, position: FloatArray, obstacles: Obstacles) -> FloatArray:
        """Velocity (3,) [m/s] that moves the end-effector's origin, at `position` (3,) [m], away from obstacles.

        It is the paper's hybrid vector: the length of the nearest point's repulsion, in the direction of the sum of all
        repulsions.
        """
        if len(obstacles.unit) == 0:
            return np.zeros(3)
        away = position - obstacles.point
        size = self.v_max_m_s * self.risk(np.maximum(obstacles.ee_distance - self.size_m, 0.0))
        total = (size / np.maximum(np.linalg.norm(away, axis=1), _STILL)) @ away
        length = float(np.linalg.norm(total))
        return np.asarray(total * (size.max() / length)) if length > _STILL else np.zeros(3)

    def slowed(self, motion: FloatArray, distance: FloatArray, qd_max: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Joint velocity limits (n,) [rad/s] by the risk f of each of K body points.

        A joint that moves a point towards its obstacle may turn that way at (1 - f) of its speed. The strictest limit
        of several points holds.

        Args:
            motion: (K, n) least joint velocities that move each point straight towards its obstacle [rad/m].
            distance: (K,) of each point [m].
            qd_max: (n,) [rad/s].
        """
        lower, upper = -qd_max, qd_max.copy()
        for s, risk in zip(motion, self.risk(distance), strict=True):
            upper = np.where(s > _STILL, np.minimum(upper, (1.0 - risk) * qd_max), upper)
            lower = np.where(s < -_STILL, np.maximum(lower, -(1.0 - risk) * qd_max), lower)
        return lower, upper


FLACCO = replace(profile("paper"), name="flacco", slow=None, approach=Flacco(), detect=MovingThresholds(f_d_n=0.0))
"""The profile `flacco`: contact detection ignores proximity, and nothing else slows the arm."""
