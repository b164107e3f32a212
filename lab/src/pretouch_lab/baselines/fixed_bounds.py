"""Constant bounds on torques and force from the vendor's examples, and profiles that detect contacts by them."""

from dataclasses import dataclass, replace

import numpy as np

from pretouch.checks import Positive
from pretouch.contact.detector import Body, Detection, Detector, Sample, no_torques, strongest
from pretouch.contact.sequential import force_map_into
from pretouch.errors import ParameterError
from pretouch.profiles import PROFILES
from pretouch.types import FloatArray, Thresholds

_LARGEST_NM = 1e4


@dataclass(frozen=True)
class FixedBounds(Detector, name="fixed"):
    """Constant bounds on each joint's external torque and on the force."""

    joint_torques_nm: tuple[float, ...] = (20.0, 20.0, 18.0, 18.0, 16.0, 14.0, 12.0)
    """Bound on each joint's external torque [Nm] (libfranka, examples_common.cpp). An arm with another number of joints
    takes the value at the same relative place between base and hand."""
    force_n: Positive = 20.0
    """Bound on the norm of the force [N] (the same file has 20 to 25)."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "joint_torques_nm", tuple(float(bound) for bound in self.joint_torques_nm))
        super().__post_init__()
        if not self.joint_torques_nm or not all(0.0 < bound < _LARGEST_NM for bound in self.joint_torques_nm):
            raise ParameterError(
                f"FixedBounds.joint_torques_nm is {self.joint_torques_nm}: give positive torques, one a joint."
            )

    def step(self, state: None, body: Body, sample: Sample) -> tuple[Detection, None]:
        """Compare the torques and the force of one step with the bounds."""
        robot, nothing = sample.robot, no_torques(body, sample)
        if nothing is not None:
            return nothing, None
        measured, W = None if robot.wrench is None else robot.wrench[:3], np.empty((3, body.model.n))
        force_map_into(body.model.ee_jacobian(sample.kin), W)
        force = W @ robot.tau_ext if measured is None else measured
        share, zero, band = self.share(robot.tau_ext, measured), np.zeros(3), np.full(3, self.force_n)
        bands = Thresholds(band, -band, zero, np.full(3, np.nan), zero, zero)  # the spread is unknown
        contact = strongest(force, bands) if share >= 1.0 and sample.armed else None
        return Detection(bands, contact, sample.armed, robot.tau_ext, share), None

    def share(self, tau_ext: FloatArray, force: FloatArray | None) -> float:
        """Largest ratio of a torque (n,) [Nm] or of the force's norm (3,) [N] to its bound: 1 or more is a contact."""
        share = float(np.max(np.abs(tau_ext) / self.bounds(len(tau_ext))))
        return share if force is None else max(share, float(np.sqrt(force @ force)) / self.force_n)

    def bounds(self, n: int) -> FloatArray:
        """Bounds (n,) on the joints' torques [Nm], each from the same relative place between base and hand."""
        table = np.array(self.joint_torques_nm)
        return table[np.rint(np.linspace(0, len(table) - 1, n)).astype(np.int64)]

    def largest_missed_n(self, body: Body, speed: float) -> float:
        """Bound on the force [N]."""
        return self.force_n


OBSERVER_NM = (3.2, 5.2, 3.2, 4.0, 1.8, 1.1, 1.4)
"""Bounds of the profile `observer` [Nm]: five times the rms residual of a real Panda in free motion, 0.64 1.03 0.64
0.79 0.35 0.22 0.28 Nm."""
FIXED = replace(PROFILES["blind"], name="fixed", detect=FixedBounds())
"""Profile `blind` with the bounds of the vendor's examples on torques and force."""
OBSERVER = replace(PROFILES["blind"], name="observer", detect=FixedBounds(OBSERVER_NM, 1000.0))
"""Profile `blind` with tighter constant bounds on the torques of the momentum observer."""
