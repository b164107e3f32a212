"""A second arm as moving fixtures."""

from collections.abc import Callable

import numpy as np

from pretouch.robot.body import Capsules, no_capsules, placed
from pretouch.robot.kinematics import Kinematics
from pretouch.robot.model import RobotModel
from pretouch.types import SOMEWHERE, FloatArray, IntArray, MovingFixtures, RobotState


class OtherArm:
    """Source of another arm's capsules by its newest reported state, for `loop.Options.moving`."""

    def __init__(
        self,
        model: RobotModel,
        T_O_other: FloatArray,
        reported: Callable[[], RobotState | None],
        standing: Capsules | None = None,
    ) -> None:
        """Take an arm and the source of its states.

        Args:
            model: of the other arm.
            T_O_other: (4, 4) pose of its base in the base frame of the arm that is told.
            reported: gives its newest state, stamped by the clock of the arm that is told; None before the first, for
                which the arm that is told waits.
            standing: what it stands on, on its link 0.
        """
        self._model, self._T, self._reported = model, T_O_other, reported
        self._standing = no_capsules() if standing is None else standing

    def __call__(self) -> MovingFixtures:
        """Return its capsules; `SOMEWHERE` before its first state."""
        state = self._reported()
        return SOMEWHERE if state is None else self.at(state)

    def at(self, state: RobotState) -> MovingFixtures:
        """Return its capsules in a state."""
        model, still = self._model, self._standing
        kin, R, t = model.kinematics(state.q), self._T[:3, :3], self._T[:3, 3]
        link, a, b, _ = placed(model.capsules, kin)
        speeds = (velocities(model, kin, state.qd, link, end) @ R.T for end in (a, b))
        rest = np.zeros((len(still.radius), 3))
        va, vb = (np.concatenate([speed, rest]) for speed in speeds)
        a, b = np.concatenate([a, still.a]) @ R.T + t, np.concatenate([b, still.b]) @ R.T + t
        return MovingFixtures(state.stamp, a, b, np.concatenate([model.capsules.radius, still.radius]), va, vb)


def velocities(model: RobotModel, kin: Kinematics, qd: FloatArray, link: IntArray, point: FloatArray) -> FloatArray:
    """Velocities (C, 3) [m/s] of points (C, 3) [m] on links (C,) at joint velocities qd (n,) [rad/s], base frame."""
    turning = np.where(model.moved_by[link], qd, 0.0)
    # sum of qd_j a_j x (p - p_j) over the joints that move the link
    return np.einsum("cj,cji->ci", turning, np.cross(kin.axis, point[:, None] - kin.anchor))
