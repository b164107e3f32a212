"""Inputs of a control step. Fields are set once, at construction; arrays are read and never written to."""

import math
from dataclasses import dataclass
from enum import IntEnum
from typing import Annotated, NamedTuple

import numpy as np

from pretouch.desired import Desired
from pretouch.errors import ParameterError
from pretouch.values import LARGEST, LATEST, Below, BoolArray, FloatArray, IntArray, real_number, value


class RangeStatus(IntEnum):
    """Range status codes of the VL53L1X (ST, UM2356), and one of ours."""

    OK = 0
    SIGMA = 1
    SIGNAL = 2
    MIN_CLIPPED = 3
    OUT_OF_BOUNDS = 4
    HARDWARE = 5
    NO_WRAP_CHECK = 6
    WRAPPED = 7
    CROSSTALK = 9
    SYNC = 10
    MERGED = 11
    MIN_RANGE = 13
    INVALID = 14
    STUCK = 254
    """Set by whoever receives readings that repeat to the last digit."""
    NONE = 255
    """Set by the driver before the first measurement."""


@value
class RangeReadings:
    """The newest reading of each of K units, in skin order; before its first: stamp -inf, status NONE."""

    stamp: Annotated[FloatArray, "K"]
    """(K,) instant of each measurement [s]."""
    distance: Annotated[FloatArray, "K"]
    """(K,) distance along the beam from the sensor origin [m]; meaningless unless the status says so."""
    status: Annotated[IntArray, "K"]
    """(K,) `RangeStatus` codes."""


class TouchStatus(IntEnum):
    """State of a unit's touch sensor."""

    OK = 0
    FAILED = 1
    """The sensor answers with an impossible value: a broken lead."""
    NONE = 255
    """The unit has no touch sensor, or has not reported yet."""


@value
class TouchReadings:
    """The newest touch reading of each of K sensor units, in the order of the skin.

    A unit without a touch sensor, and one that has not reported yet, has stamp -inf and status NONE.
    """

    stamp: Annotated[FloatArray, "K"]
    """(K,) instant of each measurement [s]."""
    contact: Annotated[BoolArray, "K"]
    """(K,) whether the unit is touched; meaningless unless the status is OK."""
    force: Annotated[FloatArray, "K"]
    """(K,) size of the force on it [N], NaN where it is not measured."""
    status: Annotated[IntArray, "K"]
    """(K,) `TouchStatus` codes."""


@value
class RobotState:
    """State of the robot at one instant, as its own interface reports it. n joints."""

    stamp: Annotated[float, LATEST]
    """Instant of the measurement [s]."""
    q: Annotated[FloatArray, "n", LARGEST]
    """(n,) measured joint positions [rad]."""
    qd: Annotated[FloatArray, "n", LARGEST]
    """(n,) measured joint velocities [rad/s]."""
    q_commanded: Annotated[FloatArray, "n", LARGEST]
    """(n,) joint positions the robot's motion generator is at [rad] (the vendor's q_d)."""
    qd_commanded: Annotated[FloatArray, "n", LARGEST]
    """(n,) joint velocities the robot's motion generator is at [rad/s] (the vendor's dq_d)."""
    tau_ext: Annotated[FloatArray, "n"]
    """(n,) estimated torques by the environment on the joints [Nm]; within a step NaN where the robot gave none."""
    wrench: Annotated[FloatArray | None, 6]
    """(6,) estimated force [N] and torque about the TCP [Nm] **on the robot by the environment**, base frame.

    None where the robot has no estimate, as near a singularity.
    """


class SeenPoints(NamedTuple):
    """The newest M points of outside sources such as cameras, in the base frame.

    Points of the arm itself and of fixtures may be among them. A row with a NaN holds no point.
    """

    heard: float
    """Newest stamp [s] of the source that is silent for longest, -inf before the first. M = 0: nothing is near."""
    stamp: Annotated[FloatArray, "M"]
    """(M,) instant at which each point was measured [s]."""
    point: Annotated[FloatArray, "M", 3]
    """(M, 3) [m]."""
    sigma: Annotated[FloatArray, "M"]
    """(M,) standard deviation of each point in the worst direction, that of the sensor's own pose included [m]."""


_MOST = {"mass_kg": 100.0, "com_m": 2.0, "within_s": 10.0}
"""Largest values of a payload; larger ones are taken for another unit."""


@dataclass(frozen=True)
class Payload:
    """A load at the end-effector that the arm's own controller does not know.

    A Franka's external torques are already without a load that was set by `setLoad` or in Desk: leave that out here.

    Announce a load when the gripper begins to close or open, not later: until `within_s` after that, any part of the
    change counts as free motion. A wrong value is a ParameterError.
    """

    mass_kg: float
    """[kg]; 0 for nothing."""
    com_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Its centre of mass in the frame of `RobotDescription.ee_body` [m]."""
    within_s: float = 0.5
    """Longest time from the announcement until the load is on the arm, or off it [s]: the gripper's travel."""

    def __post_init__(self) -> None:
        try:
            x, y, z = map(real_number, self.com_m)
            mass, within = real_number(self.mass_kg), real_number(self.within_s)
        except (TypeError, ValueError) as error:
            raise ParameterError(f"{self!r} is no payload: give numbers, com_m three of them.") from error
        for (name, most), number in zip(_MOST.items(), (mass, math.hypot(x, y, z), within), strict=True):
            if not 0.0 <= number <= most:
                raise ParameterError(f"Payload.{name} is {getattr(self, name)}: give 0 to {most:g}, in SI units.")
        object.__setattr__(self, "com_m", (x, y, z))  # an array could not be compared


_FAR = Below(100.0)
"""Bound on coordinates [m] and speeds [m/s] of moving fixtures."""


class MovingFixtures(NamedTuple):
    """Bodies beside the arm whose motion is known, such as a second arm: C capsules in the arm's base frame.

    A reading of them adds no obstacle. The arm keeps away from the capsules as from obstacles: they are neither a
    person nor free space.
    """

    stamp: float
    """Instant of these positions [s]."""
    a: Annotated[FloatArray, "C", 3, _FAR]
    """(C, 3) one end of each axis [m]."""
    b: Annotated[FloatArray, "C", 3, _FAR]
    """(C, 3) other end of each axis [m]."""
    radius: Annotated[FloatArray, "C", _FAR]
    """(C,) [m]."""
    a_velocity: Annotated[FloatArray, "C", 3, _FAR]
    """(C, 3) velocity of the one end [m/s]."""
    b_velocity: Annotated[FloatArray, "C", 3, _FAR]
    """(C, 3) velocity of the other end [m/s]."""

    def at(self, time: float) -> tuple[FloatArray, FloatArray]:
        """Return both ends (C, 3) of each axis [m] at an instant close to the stamp [s], at constant velocities."""
        after = time - self.stamp
        return self.a + after * self.a_velocity, self.b + after * self.b_velocity


SOMEWHERE = MovingFixtures(-np.inf, np.zeros((1, 3)), np.zeros((1, 3)), np.zeros(1), np.zeros((1, 3)), np.zeros((1, 3)))
"""A moving fixture whose position has not been reported yet: the arm holds until it is."""


@value
class Inputs:
    """All inputs of one control step."""

    stamp: float
    """Instant of this step [s]."""
    robot: RobotState
    readings: RangeReadings
    resume: bool = False
    """A person asks to leave a latched HOLD."""
    touch: TouchReadings | None = None
    """Readings of the units' touch sensors; None for a skin without any."""
    points: SeenPoints | None = None
    """Points of outside sources; None without one. After the first points, silence of a source stops the arm."""
    payload: Payload | None = None
    """Load that is announced; None: the last announcement stays."""
    desired: Desired | None = None
    """Motion that a commander requests in place of the path; None: the arm follows the path."""
    moving: MovingFixtures | None = None
    """Bodies beside the arm whose motion is known; None without any."""
