"""What a motion tells of the pose of a unit on each link, before anything is measured: Fisher information.

The unknowns are those of `pretouch.calibration.fit`: the pose, the biases, the clock, the accelerometer's delay, the
scale of each axis, and gravity in the base frame.
"""

import numpy as np

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
_TURN, _PLACE, _ACC_BIAS, _GYRO_BIAS, _CLOCK, _LAG = slice(0, 3), slice(3, 6), slice(6, 9), slice(9, 12), 12, 13
_ACC_SCALE, _GYRO_SCALE, _GRAVITY = slice(14, 17), slice(17, 20), slice(20, 23)
_UNKNOWNS = 23
_POSE_PRIOR = np.array([np.pi] * 3 + [0.5] * 3)
"""Standard deviation of a pose of which nothing is known [rad, m]."""


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
        p = self._params
        prior = np.concatenate([
            _POSE_PRIOR, np.full(3, p.acceleration_bias), np.full(3, p.angular_velocity_bias),
            [p.clock_error_s, p.delay_difference_s], np.full(6, p.scale_error),
            np.full(2, p.gravity * np.deg2rad(p.lean_deg)), [p.gravity_error],
        ])  # fmt: skip
        self.prior: FloatArray = np.broadcast_to(np.diag(prior**-2.0), (len(self.links), _UNKNOWNS, _UNKNOWNS))
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
        felt = motion.a + motion.lever @ self._place[int(self.links[which])] + up
        N, eye = len(felt), np.eye(3)
        J = np.zeros((N, 6, _UNKNOWNS))
        for rows, v, bias, scale in ((slice(0, 3), motion.w, _GYRO_BIAS, _GYRO_SCALE),
                                     (slice(3, 6), felt, _ACC_BIAS, _ACC_SCALE)):  # fmt: skip
            J[:, rows, _TURN], J[:, rows, bias], J[:, rows, scale] = skew(v), eye, v[:, :, None] * eye
            if N > 1:
                J[:, rows, _CLOCK] = np.gradient(v, 1 / self._params.rate_hz, axis=0)
        J[:, 3:, _LAG], J[:, 3:, _GRAVITY], J[:, 3:, _PLACE] = J[:, 3:, _CLOCK], motion.R_link_base, motion.lever
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
        place, turn = (np.linalg.eigvalsh(covariance[..., part, part])[..., -1] for part in (_PLACE, _TURN))
        return np.sqrt(place), np.sqrt(turn)
