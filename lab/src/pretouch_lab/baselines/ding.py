"""Ding and Thomas, "Collision avoidance with proximity servoing for redundant serial robot manipulators", ICRA 2020.

It limits the approach of each closest point, and keeps a weighted sum of the distances from falling.

docs/explanation/baselines.md states which parts are reproduced. The values are those in the code of the authors of
arXiv 2510.24683, who compare it with their own controller.
"""

from dataclasses import dataclass, replace

import numpy as np

from pretouch.checks import NonNegative, Positive
from pretouch.contact.moving_thresholds import MovingThresholds
from pretouch.control.approach import MotionBody, MotionRequest, Restricted, Restriction
from pretouch.errors import ParameterError
from pretouch.profiles import profile
from pretouch.robot.kinematics import Kinematics
from pretouch.types import FloatArray, Obstacles, RobotState

_WEIGHT = 1000.0
"""Weight of a row's squared violation, equal to that of the paper's rows. The rows are soft: hard rows would demand of
an arm at rest a retreat that it cannot reach within one period."""


@dataclass(frozen=True)
class Ding(Restriction, name="ding"):
    """Limits on the approach, and a weighted sum of distances that must not fall."""

    repulse_m: Positive = 0.17
    """Body distance below which the retreat is fastest [m]."""
    zero_low_m: Positive = 0.22
    """Body distance above which no retreat is demanded [m]."""
    zero_high_m: Positive = 0.25
    """Body distance below which no approach is allowed [m]."""
    notice_m: Positive = 0.3
    """Body distance above which the approach has no limit [m]."""
    approach_m_s: Positive = 0.2
    """Largest approach, just within `notice_m` [m/s]."""
    retreat_m_s: Positive = 0.2
    """Fastest retreat, below `repulse_m` [m/s]."""
    weighted_m: NonNegative = 4.0
    """Body distance below which an obstacle enters the weighted sum of distances [m]. The published method uses every
    obstacle in view; 0.3 uses those whose approach is limited, and 0 uses none."""

    def __post_init__(self) -> None:
        super().__post_init__()
        distances = self.repulse_m, self.zero_low_m, self.zero_high_m, self.notice_m
        if not distances[0] < distances[1] <= distances[2] < distances[3]:
            raise ParameterError(f"Ding.repulse_m, zero_low_m, zero_high_m, notice_m are {distances}: they must grow.")

    def step(
        self, state: None, body: MotionBody, kin: Kinematics, robot: RobotState, near: Obstacles, request: MotionRequest
    ) -> tuple[Restricted, None]:
        """Return a row for each near point, and the row of the weighted sum."""
        points = zip(near.link, near.body_point, near.direction, strict=True)
        rows = [d @ body.model.jacobian(kin, int(link), at)[:3] for link, at, d in points]
        return self.within(np.reshape(rows, (-1, body.model.n)), near.body_distance), None

    def limit(self, distance: FloatArray) -> FloatArray:
        """Largest approach (K,) [m/s] at body distances (K,) [m], infinite from `notice_m` on; negative: a retreat.

        Piecewise linear: full retreat, zero, zero, and the full approach at the outer end.
        """
        places = [self.repulse_m, self.zero_low_m, self.zero_high_m, self.notice_m]
        limit = np.interp(distance, places, [-self.retreat_m_s, 0.0, 0.0, self.approach_m_s])
        return np.where(distance < self.notice_m, limit, np.inf)

    def within(self, rows: FloatArray, distance: FloatArray) -> Restricted:
        """Return G qd <= h, the last row of which belongs to no point.

        With C = -rows, the change of each distance with the joints, and w = 1 / d, the last row is -w^T C qd <= 0: the
        weighted sum of the distances must not fall. It is divided by the sum of w, so that its violation is a speed.

        Args:
            rows: (K, n) speed of each of K points towards its obstacle per joint velocity [m].
            distance: (K,) of each point [m].
        """
        limit = self.limit(distance)
        which, weights = np.flatnonzero(np.isfinite(limit)), (distance < self.weighted_m) / np.maximum(distance, 0.01)
        weighted = weights @ rows / max(float(weights.sum()), 1e-9)
        return Restricted(np.vstack([rows[which], weighted]), np.append(limit[which], 0.0), which, _WEIGHT)


DING = replace(profile("paper"), name="ding", slow=None, approach=Ding(), detect=MovingThresholds(f_d_n=0.0))
"""The profile `ding`: contact detection ignores proximity, and nothing else slows the arm."""
