"""The interface of contact detectors: what one is given of each step, and what it answers."""

import math
from dataclasses import field
from typing import Any, ClassVar

import numpy as np

from pretouch.composition import Part
from pretouch.contact.residual_model import ResidualModel
from pretouch.contact.window import Window
from pretouch.robot.body import Capsules, no_capsules
from pretouch.robot.kinematics import Kinematics, below
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.types import (
    NOT_TOUCHED,
    Contact,
    FloatArray,
    Obstacles,
    RobotState,
    Thresholds,
    Touched,
    TouchReadings,
)
from pretouch.values import value


@value
class Body:
    """What is fixed of an arm, its units and what stands beside it."""

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
    """What a detector is given of one step."""

    stamp: float
    """Instant of the step [s]."""
    kin: Kinematics
    """Posture of the arm."""
    robot: RobotState
    """State of the arm, with the estimates of external torques and force; NaN and None where there is none."""
    window: Window
    """Force window with the force of this step in it (eq. 8)."""
    armed: bool
    """Whether the window was full before this step: a contact before is none."""
    obstacles: Obstacles
    """What is near."""
    reacting: bool = False
    """Whether the arm moves with a contact."""
    watched: bool = False
    """Whether a skin watches, all of its units heard."""
    touches: TouchReadings | None = None
    """Of the units' touch sensors; None without."""
    doubted_kg: float = 0.0
    """How much of an announced load is taken out of torques and force anew, and may be a little off [kg]."""


@value
class Detection:
    """What a detector says of one step."""

    thresholds: Thresholds
    contact: Contact | None
    armed: bool
    """Whether a contact could be detected."""
    residual: FloatArray
    """(n,) external joint torques less what the detector takes for free motion [Nm]; NaN without torques."""
    evidence: float
    """How far the test is on the way to a contact: one from 1 on, while armed."""
    lasting: bool = False
    """Whether it is being found out if the residual is a load or an error of the estimate: the arm waits for that."""
    touched: Touched = field(default_factory=lambda: NOT_TOUCHED)
    """Where the arm is touched; empty where no contact is detected or the profile does not localise."""
    significant: tuple[FloatArray, FloatArray] | None = None
    """Residual (n,), averaged over the time in which it stands out most [Nm], and the covariance (n, n) that it has in
    free motion [Nm^2]; None where the detector has none, or no contact is detected."""
    detectable_n: float = math.nan
    """Force at the end-effector, in the direction the torques tell least of, that is found in 95 of 100 cases if it is
    held for 0.1 s [N]; NaN of a detector that does not say."""


class Detector(Part, group="pretouch.detectors"):
    """Distinguishes a contact from free motion, from the external torques and the force of each step.

    A frozen dataclass of its own parameters. `init` and `step` are pure: what is remembered goes in and out as `state`.
    """

    by_torques: ClassVar[bool] = True
    """Whether it needs the external joint torques; else the force."""

    @property
    def reads_touch(self) -> bool:
        """Whether it takes the units' touch readings."""
        return False

    def init(self, body: Body, learnt: ResidualModel | None = None) -> Any:
        """Return what is remembered before the first step.

        `learnt` is the arm's free motion as an earlier session left it, for a detector that learns it.
        """
        return None

    def step(self, state: Any, body: Body, sample: Sample) -> tuple[Detection, Any]:
        """Take in one step, and say whether it is a contact; return that and what to remember."""
        raise NotImplementedError

    def adopted(self, state: Any, body: Body, before: "Detector") -> Any:
        """Go on from the state of another detector; by default only from one of the same kind."""
        return state if type(before) is type(self) else self.init(body)

    def learnt(self, state: Any) -> ResidualModel | None:
        """Return what was learnt of free motion, to be kept for the next session; None of one that learns none."""
        return None

    def largest_missed_n(self, body: Body, speed: float) -> float:
        """Largest force on one axis [N] at which it may still be silent, at this speed of the joints [rad/s].

        An arm that stops by itself must not do so before.
        """
        raise NotImplementedError


def no_torques(body: Body, sample: Sample) -> Detection | None:
    """Return what a detector by torques says where there are none, or None where there are."""
    if below(sample.robot.tau_ext, np.inf):
        return None
    return Detection(Thresholds(*np.full((6, 3), np.nan)), None, False, np.full(body.model.n, np.nan), 0.0)


def strongest(force: FloatArray, bands: Thresholds) -> Contact:
    """Return a contact with the axes whose equivalent band is passed, or else the one with the largest part."""
    # the bands are of one sample: where the test decided by a longer mean it may be that no axis passes its own
    share = np.abs(force) / (bands.upper - bands.mean)
    return Contact(force, share >= min(1.0, float(share.max())))
