"""What a reaction to a contact is: the interface of the parts, what they are given, and what they answer."""

from typing import Any, ClassVar, Self

import numpy as np

from pretouch.composition import Part
from pretouch.contact.detector import Body, Detection
from pretouch.modes import Event, ModeState
from pretouch.records import Flat
from pretouch.robot.kinematics import Kinematics
from pretouch.types import Contact, FloatArray, Mode, Obstacles, RobotState
from pretouch.values import value


@value
class ReactionInputs:
    """What a reaction is given in one step."""

    mode: ModeState
    """Mode of the step before."""
    kin: Kinematics
    robot: RobotState
    detection: Detection
    obstacles: Obstacles
    unseen: bool
    """Whether something near may be missed, for a unit or another source is silent."""
    command: FloatArray
    """(n,) joint velocities commanded last [rad/s]."""
    path_phase: float
    """Arc length of the task along its path [m]."""
    resume: bool
    """Whether a person asks to go on."""


@value
class ReactionMotion:
    """How the arm moves with a contact in one step."""

    velocity: FloatArray
    """(3,) of the end-effector origin [m/s], base frame."""
    qd: FloatArray | None = None
    """(n,) joint velocities [rad/s], None where only the end-effector's are asked for."""
    touch_speed: float | None = None
    """Speed at which the arm may touch what it sees [m/s], None as without a contact."""


class Reaction(Part, group="pretouch.reactions"):
    """How the arm answers a contact.

    In each step the controller calls `sense`, takes the mode that follows, and calls `move` with the same inputs. The
    arm reacts as long as `sense` names an event that keeps it in REACT, such as `Event.REACTING` (`modes.TABLE`).
    """

    by_torques: ClassVar[bool] = False
    """Whether it needs an estimate of the external torque of each joint."""

    def init(self, body: Body, q: FloatArray) -> Any:
        """Return the state without a contact, at joint positions (n,) [rad]."""
        return None

    def sense(self, state: Any, body: Body, inputs: ReactionInputs) -> tuple[dict[Event, str], Any]:
        """Take a step in before its mode is known.

        Returns what may change the mode, each event with the detail its sentence needs, and the state to go on with.
        """
        return contact_event(inputs.detection), state

    def move(
        self, state: Any, body: Body, inputs: ReactionInputs, mode: ModeState
    ) -> tuple[ReactionMotion | None, Any]:
        """Return how the arm moves in a mode, None where the reaction does not move it, and the state to go on with.

        The reaction begins where `mode` is REACT and `inputs.mode` is not: with `inputs.detection.contact`.
        """
        raise NotImplementedError

    def caught_up(self, state: Any, memory: Flat) -> Any:
        """Return the state after steps that were one compiled call each, by what these left in the memory."""
        return state

    def keep_free(self, state: Any, memory: Flat) -> bool:
        """Leave in the memory what compiled steps go on from; return whether they may, for there is no contact."""
        return False

    def adopted(self, state: Any, body: Body, before: "Reaction", q: FloatArray) -> Any:
        """Return the state to go on with from that of another profile's reaction, at joint positions (n,) [rad]."""
        return state if type(before) is type(self) else self.init(body, q)

    def stretched(self, factor: float) -> Self:
        """Return the reaction whose counts of control cycles are longer by a factor: at a rate higher by as much."""
        return self

    def announced(self, period: float) -> str:
        """Say to people beside the arm what it does where it is pushed, with a control period [s]."""
        return f"Pushed, it reacts as the part {self.name} does: nothing it could hit may be near it."


def contact_event(detection: Detection) -> dict[Event, str]:
    """Name a contact that is detected, with its force."""
    found = detection.contact
    return {} if found is None else {Event.CONTACT: f"{np.linalg.norm(found.force):.1f} N"}


def new_contact(inputs: ReactionInputs, mode: ModeState) -> Contact | None:
    """Return the contact that a reaction begins with in a step that ends in a mode, None where none begins."""
    begins = mode.mode is Mode.REACT and inputs.mode.mode is not Mode.REACT
    return inputs.detection.contact if begins else None
