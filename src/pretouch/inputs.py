"""What a control step is given. All are set once, when they are made; arrays are read and not written to."""

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
    """The newest reading of each of K units, in the order of the skin; of one never heard -inf, and status NONE."""

    stamp: Annotated[FloatArray, "K"]
    """(K,) instant of each measurement [s]."""
    distance: Annotated[FloatArray, "K"]
    """(K,) distance along the beam from the sensor origin [m]; meaningless unless the status says so."""
    status: Annotated[IntArray, "K"]
    """(K,) `RangeStatus` codes."""


class TouchStatus(IntEnum):
    """What a unit says of its touch sensor."""

    OK = 0
    FAILED = 1
    """It measures, and what it measures can be no reading: a broken lead."""
    NONE = 255
    """It has none, or none was heard of."""


@value
class TouchReadings:
    """The newest touch reading of each of K sensor units, in the order of the skin.

    A unit without a touch sensor, and one that has never been heard, has stamp -inf and status NONE.
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
    """What the robot's own interface reports at one instant, n joints."""

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
    """The newest M points of what outside sources see, such as cameras, in the base frame.

    What a source shows of the arm itself or of fixtures may be in it. A row with a NaN shows nothing.
    """

    heard: float
    """Newest measurement of the source silent for longest [s], -inf before the first; no points: nothing is seen."""
    stamp: Annotated[FloatArray, "M"]
    """(M,) instant at which each point was measured [s]."""
    point: Annotated[FloatArray, "M", 3]
    """(M, 3) [m]."""
    sigma: Annotated[FloatArray, "M"]
    """(M,) standard deviation of each point in the worst direction, that of the sensor's own pose included [m]."""


_MOST_KG, _FARTHEST_M, _LONGEST_S = 100.0, 2.0, 10.0
"""From here on a mass, a distance or a time is given in another unit."""


@dataclass(frozen=True)
class Payload:
    """What the end-effector carries beyond what the arm's own controller knows.

    What was set in a Franka by `setLoad` or in Desk is taken out of its external torques already: leave it out here.

    Announce it as the gripper begins to close or open, not later: until `within_s` after that, any part of the change
    passes for free motion. A wrong value is a ParameterError.
    """

    mass_kg: float
    """[kg]; 0 for nothing."""
    com_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Its centre of mass in the frame of `RobotDescription.ee_body` [m]."""
    within_s: float = 0.5
    """Longest time from the announcement until the arm carries it, or no longer carries it [s]: a gripper's way."""

    def __post_init__(self) -> None:
        try:
            x, y, z = map(real_number, self.com_m)
            given = {
                "mass_kg": (real_number(self.mass_kg), _MOST_KG), "com_m": (math.hypot(x, y, z), _FARTHEST_M),
                "within_s": (real_number(self.within_s), _LONGEST_S),
            }  # fmt: skip
        except (TypeError, ValueError) as error:
            raise ParameterError(f"{self!r} is no payload: give numbers, com_m three of them.") from error
        for name, (number, most) in given.items():
            if not 0.0 <= number <= most:
                raise ParameterError(f"Payload.{name} is {getattr(self, name)}: give 0 to {most:g}, in SI units.")
        object.__setattr__(self, "com_m", (x, y, z))  # an array could not be compared


_FAR = Below(100.0)
"""Of a coordinate [m] or a speed [m/s] of a moving fixture."""


class MovingFixtures(NamedTuple):
    """Bodies beside the arm that move and are known: C capsules in the arm's base frame.

    What units see of them is no obstacle, while the arm keeps off them as off any: they are neither a person nor free
    space.
    """

    stamp: float
    """Instant at which they were there [s]."""
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
"""Something that nobody has told of yet: the arm holds until then."""


@value
class Inputs:
    """All that one control step is given."""

    stamp: float
    """Instant of this step [s]."""
    robot: RobotState
    readings: RangeReadings
    resume: bool = False
    """A person asks to leave a latched HOLD."""
    touch: TouchReadings | None = None
    """What units say of being touched; None of a skin that has no touch sensors."""
    points: SeenPoints | None = None
    """What outside sources see; None without one. Once given, silence of theirs stops the arm."""
    payload: Payload | None = None
    """What the arm carries; None: nothing is said, and what was said last stays."""
    desired: Desired | None = None
    """What a commander asks for, in place of the path; None: the path is followed."""
    moving: MovingFixtures | None = None
    """What is known to move beside the arm; None: nothing is said of any."""
