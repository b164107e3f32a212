"""Contact detection of the paper: force against thresholds that move with its statistics and with nearness."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from pretouch.compiled import entry
from pretouch.contact.detector import Body, Detection, Detector, Sample
from pretouch.contact.thresholds import ThresholdNumbers, crossed, side_distances, threshold_parts
from pretouch.contact.window import WindowState, window_mean, window_std
from pretouch.params import ThresholdParams
from pretouch.types import Contact, FloatArray, Obstacles, Thresholds


@dataclass(frozen=True)
class MovingThresholds(ThresholdParams, Detector, name="thresholds"):
    """Thresholds of eqs. 9-11 on the force: near an object a light touch counts."""

    by_torques = False

    def step(self, state: None, body: Body, sample: Sample) -> tuple[Detection, None]:
        """Move the thresholds to the force window of this step, and hold its force against them."""
        robot, position = sample.robot, sample.kin.position[body.model.ee]
        force = None if robot.wrench is None else robot.wrench[:3]
        found = self.judged(sample.window, force, sample.armed, position, sample.obstacles)
        # made anew, for `replace` takes several times as long
        return Detection(found.thresholds, found.contact, found.armed, robot.tau_ext, found.evidence), None

    def judged(
        self, window: WindowState, force: FloatArray | None, armed: bool, ee_position: FloatArray, obstacles: Obstacles
    ) -> Detection:
        """Hold a force (3,) [N] against the thresholds by its window and by what is near; the residual is NaN.

        A contact has the force less its mean, F_ext of eq. 12.

        Args:
            window: with the force in it.
            force: on the robot, base frame; None where there is no estimate: then nothing is a contact.
            armed: whether the window was full before it.
            ee_position: (3,) end-effector origin [m].
            obstacles: what is near.
        """
        parts, o = np.empty((6, 3)), obstacles
        # NaN crosses no threshold: without an estimate nothing is a contact
        compared = _NONE if force is None else window.newest if self.compare == "filtered" else force
        found, share = _compare.flat(
            window.sums, window.count, compared, ee_position, o.point, o.ee_distance,
            self.f_base_n, self.f_std_n, self.sigma_max_n, self.f_d_n, self.d_max_m, self.d_min_m, parts,
        )  # fmt: skip
        limits, contact = Thresholds(parts), None
        if found and armed:
            contact = Contact(compared - limits.mean, crossed(compared, limits))  # F_ext = F_reading - mu, eq. 12
        return Detection(limits, contact, armed, _NONE, 0.0 if force is None else share)

    def largest_missed_n(self, body: Body, speed: float) -> float:
        """F_b + F_std, of eqs. 9 and 10: nothing near, and a force as noisy as counts."""
        return self.f_base_n + self.f_std_n


def thresholds_of(detector: Detector) -> MovingThresholds:
    """Return the thresholds of a detector, or the paper's of one that has none."""
    return detector if isinstance(detector, MovingThresholds) else MovingThresholds()


_NONE = np.full(3, np.nan)


class _Near(NamedTuple):
    """As of `Obstacles`."""

    point: FloatArray
    ee_distance: FloatArray


@entry
def _compare(
    sums: FloatArray, count: int, compared: FloatArray, ee_position: FloatArray, obstacles: _Near,
    p: ThresholdNumbers, parts: FloatArray,
) -> tuple[bool, float]:  # fmt: skip
    """Write the thresholds (6, 3); say whether a force (3,), NaN for none, crosses one, and its part of a band."""
    positive, negative = side_distances(ee_position, obstacles.point, obstacles.ee_distance)
    threshold_parts(window_mean(sums, count), window_std(sums, count), positive, negative, p, parts)
    found, largest = False, 0.0
    for i in range(3):
        found = found or compared[i] > parts[0, i] or compared[i] < parts[1, i]
        off = compared[i] - parts[2, i]
        # on the lower side both are negative: the part of the band is positive on either
        band = parts[0, i] - parts[2, i] if off > 0.0 else parts[1, i] - parts[2, i]
        largest = max(largest, off / band)
    return found, largest
