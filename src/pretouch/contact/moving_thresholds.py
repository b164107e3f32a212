"""Contact detection of the paper (eqs. 9-11): thresholds on the force, which move with its statistics and obstacles."""

from dataclasses import dataclass

import numpy as np

from pretouch.compiled import compiled, kernel
from pretouch.contact.detector import Body, Detection, Detector, Sample
from pretouch.contact.window import Window, window_mean, window_std
from pretouch.params import ThresholdParams
from pretouch.types import Contact, FloatArray, Number, Obstacles, Thresholds


@kernel
def noise_force(sigma: Number, f_std: float, sigma_max: float) -> Number:
    """F_sigma = min(sigma / sigma_max F_std, F_std) per axis [N], eq. 10 of the paper."""
    return np.minimum(sigma / sigma_max * f_std, f_std)


@compiled
def obstacle_force(distance: Number, f_d: float, d_max: float, d_min: float) -> Number:
    """F_obs = (d_max - d) / (d_max - d_min) F_d [N], eq. 11 of the paper, clipped to [0, F_d].

    `distance` [m] is from the end-effector origin; infinite where there is no object, which gives zero.
    """
    return np.minimum(np.maximum((d_max - distance) / (d_max - d_min), 0.0), 1.0) * f_d


@kernel
def side_distances(
    ee_position: FloatArray, points: FloatArray, ee_distance: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the distance [m] to the nearest object on the positive and negative side of each base axis, (3,) each.

    An object belongs to the positive side of an axis if its coordinate (`points` (K, 3) [m]) is greater than the
    end-effector's, as the paper has it; sides without an object are infinitely far.
    """
    positive, negative = np.full(3, np.inf), np.full(3, np.inf)
    for k in range(len(points)):
        for i in range(3):
            # By the object's distance, not by its component along the axis: an object at -y lowers the thresholds of x
            # and z too, on the side of its small offset (docs/explanation/paper.md, axis leakage).
            if points[k, i] > ee_position[i]:
                positive[i] = min(positive[i], ee_distance[k])
            elif points[k, i] < ee_position[i]:  # at the end-effector's coordinate it is on neither side
                negative[i] = min(negative[i], ee_distance[k])
    return positive, negative


@kernel
def threshold_parts(
    mean: FloatArray, sigma: FloatArray, positive: FloatArray, negative: FloatArray, p: ThresholdParams,
    parts: FloatArray,
) -> None:  # fmt: skip
    """Write thresholds of each axis [N] and their components, eq. 9 of the paper: the rows of `Thresholds` (6, 3).

    T_u = mu + F_b + F_sigma - F_obs-, T_l = mu - F_b - F_sigma + F_obs+: an object at greater y pushes the arm
    towards -y, so it raises T_l. Mean mu and standard deviation of the window are (3,) [N], distances to the nearest
    object on the positive and the negative side of each axis (3,) [m].
    """
    for i in range(3):
        f_sigma = noise_force(sigma[i], p.f_std_n, p.sigma_max_n)
        f_positive = obstacle_force(positive[i], p.f_d_n, p.d_max_m, p.d_min_m)
        f_negative = obstacle_force(negative[i], p.f_d_n, p.d_max_m, p.d_min_m)
        # eq. 9: an object on the negative side pushes to the positive one, and lowers the upper threshold
        parts[0, i] = mean[i] + p.f_base_n + f_sigma - f_negative
        parts[1, i] = mean[i] - p.f_base_n - f_sigma + f_positive
        parts[2, i], parts[3, i], parts[4, i], parts[5, i] = mean[i], sigma[i], f_positive, f_negative


_NONE = np.full(3, np.nan)


@dataclass(frozen=True)
class MovingThresholds(ThresholdParams, Detector, name="thresholds"):
    """Thresholds of eqs. 9-11 on the force: near an object a light touch counts."""

    by_torques = False

    def step(self, state: None, body: Body, sample: Sample) -> tuple[Detection, None]:
        """Move the thresholds by the force window of this step, and compare its force with them."""
        robot, position = sample.robot, sample.kin.position[body.model.ee]
        force = None if robot.wrench is None else robot.wrench[:3]
        return self.judge(sample.window, force, sample.armed, position, sample.obstacles, robot.tau_ext), None

    def judge(
        self, window: Window, force: FloatArray | None, armed: bool, ee: FloatArray, near: Obstacles,
        residual: FloatArray = _NONE,
    ) -> Detection:  # fmt: skip
        """Compare a force (3,) [N] with the thresholds by its window and the obstacles.

        A contact has the force less its mean, F_ext of eq. 12. The window contains the force, on the robot, base
        frame, None without an estimate: then there is no contact. `armed`: the window was full before; `ee` (3,) is the
        end-effector's origin [m]; `residual` (n,) is that of the detection.
        """
        parts = np.empty((6, 3))
        # NaN crosses no threshold: without an estimate there is no contact
        compared = _NONE if force is None else window.newest if self.compare == "filtered" else force
        crosses, share = compare(window, compared, ee, near, self.numbers, parts)
        limits, contact = Thresholds(*parts), None
        if crosses and armed:
            axes = (compared > limits.upper) | (compared < limits.lower)
            contact = Contact(compared - limits.mean, axes)  # F_ext = F_reading - mu, eq. 12
        return Detection(limits, contact, armed, residual, 0.0 if force is None else share)

    def largest_missed_n(self, body: Body, speed: float) -> float:
        """Return F_b + F_std of eqs. 9 and 10: without obstacles, and with the largest noise."""
        return self.f_base_n + self.f_std_n


@compiled
def compare(
    window: Window, compared: FloatArray, ee: FloatArray, near: Obstacles, p: ThresholdParams, parts: FloatArray
) -> tuple[bool, float]:
    """Write the thresholds (6, 3); return whether a force (3,), NaN for none, crosses one, and its part of a band."""
    sums, count = window.sums, window.samples[0]
    positive, negative = side_distances(ee, near.point, near.ee_distance)
    threshold_parts(window_mean(sums, count), window_std(sums, count), positive, negative, p, parts)
    crosses, largest = False, 0.0
    for i in range(3):
        crosses = crosses or compared[i] > parts[0, i] or compared[i] < parts[1, i]
        off = compared[i] - parts[2, i]
        # on the lower side both are negative: the part of the band is positive on both sides
        band = parts[0, i] - parts[2, i] if off > 0.0 else parts[1, i] - parts[2, i]
        largest = max(largest, off / band)
    return crosses, largest
