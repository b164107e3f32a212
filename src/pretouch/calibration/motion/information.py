"""What a motion tells of the pose of a unit on each link, before anything is measured: Fisher information.

The unknowns are those of `pretouch.calibration.fit`: the pose, the biases, the clock, the accelerometer's delay, the
scale of each axis, and gravity in the base frame.
"""

import numpy as np

from pretouch.calibration import fit
from pretouch.calibration.link_motion import ArmMotion, LinkMotion, skew
from pretouch.calibration.motion.plan import Plan
from pretouch.calibration.params import CalibrationParams
from pretouch.robot.model import RobotModel
from pretouch.robot.self_distance import kinematics_of
from pretouch.traces import JointTrace
from pretouch.types import FloatArray, IntArray

_ACCELERATION_NOISE, _ANGULAR_VELOCITY_NOISE = 0.01, 0.001
"""Standard deviation of what the model of a moving arm does not explain [m/s^2, rad/s]: twice that of the simulated
arm, for what is between a real arm's joint sensors and its links."""


class Observability:
    """Information about a unit on each of the links that a motion can tell all of.

    A link that one joint alone moves turns about one line: where along it a unit sits no motion tells. A unit is taken
    to sit in the middle of its link.
    """

    def __init__(self, model: RobotModel) -> None:
        """Take an arm."""
        body, self._model, self._params = model.capsules, model, CalibrationParams()
        joints = model.moved_by.sum(axis=1)
        self.links: IntArray = np.array([link for link in np.unique(body.link) if joints[link] > 1], np.int64)
        """Indices of the links."""
        middle = (body.a + body.b) / 2
        self._place = {link: middle[body.link == link].mean(axis=0) for link in self.links.tolist()}
        alone = np.diag(fit.prior(self._params, self._params.clock_error_s) ** -2.0)
        self.prior: FloatArray = np.broadcast_to(alone, (len(self.links), fit.UNKNOWNS, fit.UNKNOWNS))
        """(L', 23, 23) information before the arm moves."""

    def of_plan(self, plan: Plan) -> FloatArray:
        """Information (L', 23, 23) from a motion, without the prior."""
        samples = plan.sampled(2.0 * self._params.rate_hz)
        arm = ArmMotion(self._model, JointTrace(samples.time, samples.q), self._params)
        motions = [arm.link(link).at(arm.usable) for link in self.links.tolist()]
        return np.array([self._of_motion(i, motion) for i, motion in enumerate(motions)])

    def of_standing(self, q: FloatArray, duration: float) -> FloatArray:
        """Information (S, L', 23, 23) from standing in each of S postures (S, n) [rad] for some time [s]."""
        R_link_base = kinematics_of(self._model, q).rotation.swapaxes(2, 3)
        none, count = np.zeros((1, 3)), duration * self._params.rate_hz
        return count * np.array([
            [self._of_motion(i, LinkMotion(w=none, a=none, R_link_base=row[None, link], alpha=none))
             for i, link in enumerate(self.links.tolist())] for row in R_link_base
        ])  # fmt: skip

    def _of_motion(self, which: int, motion: LinkMotion) -> FloatArray:
        """Information (23, 23) about a unit on one link whose axes are the link's."""
        up = self._params.gravity * motion.R_link_base[:, :, 2]
        specific_force = motion.a + motion.lever @ self._place[int(self.links[which])] + up
        N, eye = len(specific_force), np.eye(3)
        J = np.zeros((N, 6, fit.UNKNOWNS))
        for rows, v, bias, scale in ((slice(0, 3), motion.w, fit.GYRO_BIAS, fit.GYRO_SCALE),
                                     (slice(3, 6), specific_force, fit.ACC_BIAS, fit.ACC_SCALE)):  # fmt: skip
            J[:, rows, fit.TURN], J[:, rows, bias], J[:, rows, scale] = skew(v), eye, v[:, :, None] * eye
            if N > 1:
                J[:, rows, fit.CLOCK] = np.gradient(v, 1 / self._params.rate_hz, axis=0)
        J[:, 3:, fit.LAG], J[:, 3:, fit.GRAVITY] = J[:, 3:, fit.CLOCK], motion.R_link_base
        J[:, 3:, fit.PLACE] = motion.lever
        J[:, :3] /= _ANGULAR_VELOCITY_NOISE
        J[:, 3:] /= _ACCELERATION_NOISE
        return np.einsum("nij,nik->jk", J, J, optimize=True)

    @staticmethod
    def sigmas(information: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Standard deviations (...) of the position [m] and orientation [rad] in their worst directions.

        Args:
            information: (..., 23, 23), the prior included.
        """
        covariance = np.linalg.inv(information)
        place, turn = (np.linalg.eigvalsh(covariance[..., part, part])[..., -1] for part in (fit.PLACE, fit.TURN))
        return np.sqrt(place), np.sqrt(turn)
