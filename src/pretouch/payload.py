"""The load at the end-effector, as a program announces it."""

import math
from dataclasses import dataclass

from pretouch.errors import ParameterError
from pretouch.values import real_number

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


def sound_payload(payload: Payload | None, most_kg: float) -> tuple[Payload | None, str]:
    """Return an announced payload, or None and what is wrong with it for an arm that can hold so much [kg]."""
    if payload is None or (isinstance(payload, Payload) and payload.mass_kg <= most_kg):
        return payload, ""
    if not isinstance(payload, Payload):
        return None, f"a {type(payload).__name__}, no Payload"
    return None, f"{payload.mass_kg:g} kg, more than the {most_kg:.3g} kg that this arm's joints can hold"
