"""The force window, thresholds and reaction: eqs. 8-12, with the window's statistics from its samples each time."""

import math

import numpy as np

from pretouch.contact.reaction import DecayingVelocity
from pretouch.params import ThresholdParams, WindowParams
from pretouch.types import Contact, Obstacles, Thresholds


def statistics(samples: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Mean and sample standard deviation (3,) of what a window holds, in exactly rounded sums; zero without samples."""
    mean, sigma = np.zeros(3), np.zeros(3)
    for axis in range(3):
        values = [float(s[axis]) for s in samples]
        if values:
            mean[axis] = math.fsum(values) / len(values)
        if len(values) > 1:
            sigma[axis] = math.sqrt(math.fsum((v - mean[axis]) ** 2 for v in values) / (len(values) - 1))
    return mean, sigma


class Touch:
    """What is remembered of the force."""

    def __init__(self, params: ThresholdParams, window: WindowParams) -> None:
        self.params, self.window = params, window
        self.samples: list[np.ndarray] = []
        self.newest = np.zeros(3)

    def feel(
        self, force: np.ndarray | None, ee: np.ndarray, obstacles: Obstacles
    ) -> tuple[Thresholds, Contact | None, bool]:
        """Take a sample in; return the thresholds, a contact or None, and whether the window was full before."""
        p = self.params
        armed = len(self.samples) == self.window.samples
        if force is not None:
            self._add(force, armed)
        mean, sigma = statistics(self.samples)
        noise = np.array([min(s / p.sigma_max_n, 1.0) * p.f_std_n for s in sigma])  # eq. 10
        positive, negative = np.zeros(3), np.zeros(3)
        for k, point in enumerate(obstacles.point):
            f_obs = self._obstacle_force(float(obstacles.ee_distance[k]))
            # of several on one side the nearest counts, which gives the largest force
            positive = np.where(point > ee, np.maximum(positive, f_obs), positive)
            negative = np.where(point < ee, np.maximum(negative, f_obs), negative)
        upper = mean + p.f_base_n + noise - negative  # eq. 9
        lower = mean - p.f_base_n - noise + positive
        limits = Thresholds(*np.array([upper, lower, mean, sigma, positive, negative]))
        if force is None or not armed:
            return limits, None, armed
        reading = self.newest if p.compare == "filtered" else force
        axes = (reading > upper) | (reading < lower)
        return limits, Contact(reading - mean, axes) if axes.any() else None, armed

    def _add(self, force: np.ndarray, full: bool) -> None:
        value = np.array(force)
        if full:
            mean, sigma = statistics(self.samples)
            alpha = self.window.alpha
            for axis in range(3):  # eq. 8
                if abs(force[axis] - mean[axis]) > self.window.lambda_ * sigma[axis]:
                    value[axis] = alpha * force[axis] + (1 - alpha) * self.newest[axis]
        self.samples = [*self.samples, value][-self.window.samples :]
        self.newest = value

    def _obstacle_force(self, distance: float) -> float:
        p = self.params  # eq. 11
        return min(max((p.d_max_m - distance) / (p.d_max_m - p.d_min_m), 0.0), 1.0) * p.f_d_n


def reaction(force: np.ndarray, params: DecayingVelocity) -> np.ndarray:
    """Velocity (3,) a contact of F_ext starts [m/s]: eq. 12, its norm bounded."""
    velocity = params.compliance_m_s_n * force
    return velocity * min(1.0, params.speed_max_m_s / np.linalg.norm(velocity)) if velocity.any() else velocity
