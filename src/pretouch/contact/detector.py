"""The interface of contact detectors: samples in, detections out."""

import math
from dataclasses import field
from typing import Any, ClassVar

import numpy as np

from pretouch.composition import Part
from pretouch.contact.residual_model import ResidualModel
from pretouch.contact.window import Window
from pretouch.params import TouchSensorParams
from pretouch.robot.body import Capsules, no_capsules
from pretouch.robot.kinematics import Kinematics, below
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.types import NOT_TOUCHED, Contact, FloatArray, Obstacles, RobotState, Thresholds, Touched, TouchReadings
from pretouch.values import value


@value
class Body:
    """Constants: an arm, its units and its fixtures."""

    model: RobotModel
    skin: Skin
    period: float
    """Control period [s]."""
    planes: FloatArray = field(default_factory=lambda: np.zeros((0, 4)))
    """(P, 4) planes of fixtures, rows (normal, offset), base frame."""
    standing: Capsules = field(default_factory=no_capsules)
    """Other fixtures, base frame."""


@value
class Sample:
    """Inputs of a detector in one step."""

    stamp: float
    """Instant of the step [s]."""
    kin: Kinematics
    """Posture of the arm."""
    robot: RobotState
    """State of the arm, with the estimates of external torques and force; NaN and None where there is none."""
    window: Window
    """Force window with `Detector.counted` of this step in it (eq. 8)."""
    armed: bool
    """True if the window was full before this step: before that no contact counts."""
    obstacles: Obstacles
    """Obstacles near the arm."""
    reacting: bool = False
    """True while the arm moves with a contact."""
    watched: bool = False
    """True if there is a skin and none of its units is silent."""
    touches: TouchReadings | None = None
    """Readings of the units' touch sensors; None without any."""
    doubted_kg: float = 0.0
    """Change of the announced load that is removed from torques and force from this step on [kg]."""


@value
class Detection:
    """Result of a detector for one step."""

    thresholds: Thresholds
    contact: Contact | None
    armed: bool
    """True if a contact could be detected."""
    residual: FloatArray
    """(n,) external joint torques less the detector's model of free motion [Nm]; NaN without torques."""
    evidence: float
    """Evidence for a contact: from 1 on there is one, while armed."""
    suspected: bool = False
    """True if a contact is suspected: one that has been detected may have become lighter."""
    lasting: bool = False
    """True while the detector decides whether the residual is a load or an error of the estimate: the arm waits."""
    touched: Touched = field(default_factory=lambda: NOT_TOUCHED)
    """Place and force of the contact; empty where none is detected or the profile does not localise."""
    significant: tuple[FloatArray, FloatArray] | None = None
    """Residual (n,), averaged over the time in which it is most significant [Nm], and its covariance (n, n) in free
    motion [Nm^2]; None without them, or without a contact."""
    detectable_n: float = math.nan
    """Force at the end-effector that is detected in 95 of 100 cases if it lasts for 0.1 s, in the direction where the
    torques are least sensitive [N]; NaN if the detector does not compute it."""


class Detector(Part, group="pretouch.detectors"):
    """Distinguishes contacts from free motion, by the external torques and the force of each step.

    A frozen dataclass of its own parameters. `init` and `step` are pure: all memory goes in and out as `state`.
    """

    by_torques: ClassVar[bool] = True
    """True if it uses the external joint torques, False if it uses the force."""

    touch: TouchSensorParams | None = None
    """Weight of the units' touch sensors; None: they do not count."""

    def counted(self, robot: RobotState, window: Window) -> FloatArray | None:
        """Return the force (3,) [N] that fills the window and so arms the detector; None in a step that does not.

        Torques alone arm a detector that uses them: without a force, as near a singularity, the newest is repeated.
        """
        if robot.wrench is None:
            return window.newest if self.by_torques and below(robot.tau_ext, np.inf) else None
        return robot.wrench[:3]

    def init(self, body: Body, learnt: ResidualModel | None = None) -> Any:
        """Return the state before the first step.

        `learnt` is the model of free motion from an earlier session, for a detector that learns one.
        """
        return None

    def step(self, state: Any, body: Body, sample: Sample) -> tuple[Detection, Any]:
        """Return the detection for one step, and the state after it."""
        raise NotImplementedError

    def adopted(self, state: Any, body: Body, before: "Detector") -> Any:
        """Return the state that follows that of another detector, by default only of one of the same kind."""
        return state if type(before) is type(self) else self.init(body)

    def learnt(self, state: Any) -> ResidualModel | None:
        """Return the model of free motion, to be stored for the next session; None for a detector without one."""
        return None

    def largest_missed_n(self, body: Body, speed: float) -> float:
        """Return the largest force on one axis [N] that it may miss, at a speed of the joints [rad/s].

        An arm that stops by itself must not do so below that force.
        """
        raise NotImplementedError


def no_torques(body: Body, sample: Sample) -> Detection | None:
    """Return the detection of a detector by torques for a step without torques; None for a step with them."""
    if below(sample.robot.tau_ext, np.inf):
        return None
    return Detection(Thresholds(*np.full((6, 3), np.nan)), None, False, np.full(body.model.n, np.nan), 0.0)


def strongest(force: FloatArray, bands: Thresholds) -> Contact:
    """Return a contact with the axes whose band is exceeded, or with the axis of the largest part of its band."""
    # the bands are for one sample: where the test decides by a longer mean, no axis may exceed its own
    share = np.abs(force) / (bands.upper - bands.mean)
    return Contact(force, share >= min(1.0, float(share.max())))
