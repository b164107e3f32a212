"""The load at the end-effector, as a program announces it."""

import math
from dataclasses import dataclass

from pretouch.errors import ParameterError

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
        bounds = {"mass_kg": (0.0, _MOST_KG), "within_s": (0.0, _LONGEST_S)}
        try:
            x, y, z = map(float, self.com_m)
            given = {"mass_kg": self.mass_kg, "within_s": self.within_s, "com_m": math.hypot(x, y, z)}
            for name, number in given.items():
                low, high = bounds.get(name, (0.0, _FARTHEST_M))
                if not low <= number <= high:
                    raise ParameterError(
                        f"Payload.{name} is {getattr(self, name)}: give {low:g} to {high:g}, SI units."
                    )
        except (TypeError, ValueError) as error:
            raise ParameterError(f"{self!r} is no payload: give numbers, com_m three of them.") from error
        object.__setattr__(self, "com_m", (x, y, z))  # an array could not be compared
