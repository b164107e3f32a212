"""Reactions to a contact: their interface, and the paper's reaction (eq. 12), a velocity that decays."""

from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np

from pretouch.checks import Positive, PositiveCount
from pretouch.composition import Part
from pretouch.contact.detector import Body, Detection
from pretouch.contact.virtual_mass import VirtualMass
from pretouch.modes import Event, ModeState
from pretouch.params import TaskParams
from pretouch.robot.kinematics import Kinematics
from pretouch.types import Contact, FloatArray, Mode, Obstacles, RobotState
from pretouch.values import value


@value
class ReactionInputs:
    """Inputs of a reaction in one step."""

    mode: ModeState
    """Mode of the step before."""
    kin: Kinematics
    robot: RobotState
    detection: Detection
    obstacles: Obstacles
    unseen: bool
    """True if an obstacle may be missed, because a unit or another source is silent."""
    command: FloatArray
    """(n,) last joint velocity command [rad/s]."""
    path_phase: float
    """Arc length of the task along its path [m]."""
    resume: bool
    """True if a person requests to continue."""
    mass: VirtualMass
    """Virtual mass of the reaction `admittance`, which changes it; compiled code learns its mean in free motion."""


@value
class ReactionMotion:
    """Motion of the arm with a contact in one step."""

    velocity: FloatArray
    """(3,) velocity of the end-effector origin [m/s], base frame."""
    qd: FloatArray | None = None
    """(n,) joint velocities [rad/s], None for a motion of the end-effector alone."""
    touch_speed: float | None = None
    """Speed at which the arm may touch obstacles [m/s], None as without a contact."""


class Reaction(Part, group="pretouch.reactions"):
    """Reaction of the arm to a contact.

    In each step the controller calls `sense`, sets the mode, and calls `move` with the same inputs. The arm reacts as
    long as `sense` returns an event that keeps it in REACT, such as `Event.REACTING` (`modes.TABLE`).
    """

    by_torques: ClassVar[bool] = False
    """True if it needs an estimate of the external torque of each joint."""

    def init(self, body: Body, q: FloatArray) -> Any:
        """Return the state without a contact, at joint positions (n,) [rad]."""
        return None

    def sense(self, state: Any, body: Body, inputs: ReactionInputs) -> tuple[dict[Event, str], Any]:
        """Process a step before its mode is known.

        Returns the events that may change the mode, each with the detail of its sentence, and the state after it.
        """
        return contact_event(inputs.detection), state

    def move(
        self, state: Any, body: Body, inputs: ReactionInputs, mode: ModeState
    ) -> tuple[ReactionMotion | None, Any]:
        """Return the motion of the arm in a mode, None where the reaction does not move it, and the state after it.

        The reaction begins where `mode` is REACT and `inputs.mode` is not: with `inputs.detection.contact`.
        """
        raise NotImplementedError

    def is_over(self, state: Any) -> bool:
        """Return whether the contact is over: compiled steps may then continue, which do not change this state."""
        return False

    def adopted(self, state: Any, body: Body, before: "Reaction", q: FloatArray) -> Any:
        """Return the state that follows that of another profile's reaction, at joint positions (n,) [rad]."""
        return state if type(before) is type(self) else self.init(body, q)

    def stretched(self, factor: float) -> Self:
        """Return the reaction with its counts of control cycles times a factor, for a rate higher by the factor."""
        return self

    def announced(self, period: float) -> str:
        """Tell people beside the arm how it moves when it is pushed, with a control period [s]."""
        return f"When pushed, it reacts as the part {self.name} does: keep everything it could hit away from it."


def contact_event(detection: Detection) -> dict[Event, str]:
    """Return the event of a detected contact, with its force."""
    contact = detection.contact
    return {} if contact is None else {Event.CONTACT: f"{np.linalg.norm(contact.force):.1f} N"}


def new_contact(inputs: ReactionInputs, mode: ModeState) -> Contact | None:
    """Return the contact with which a reaction begins in a step of a mode, None where none begins."""
    begins = mode.mode is Mode.REACT and inputs.mode.mode is not Mode.REACT
    return inputs.detection.contact if begins else None


@value
class DecayState:
    """A present reaction, or none."""

    velocity: FloatArray
    """(3,) velocity at the beginning of the reaction [m/s]."""
    cycle: int
    """Cycles since then; the reaction is over at `decay_cycles`."""

    def decayed(self, cycles: int) -> FloatArray:
        """Return the present velocity (3,) [m/s]: linear from the first value to zero over a number of cycles."""
        return self.velocity * max(0.0, 1.0 - self.cycle / cycles)

    def advanced(self) -> "DecayState":
        """Return the state one control cycle later."""
        return DecayState(self.velocity, self.cycle + 1)


def reaction_velocity(force: FloatArray, compliance: float, speed_max: float) -> FloatArray:
    """Velocity x_des = C F_ext (3,) [m/s], the second part of eq. 12 of the paper, its norm clipped at `speed_max`.

    `force` (3,) [N] acts on the robot, base frame; `compliance` [(m/s)/N] is the diagonal of C. The arm moves the
    way it was pushed.
    """
    velocity = compliance * force
    speed = float(np.sqrt(velocity @ velocity))
    # scaled as a whole: clipping each axis would turn the motion away from the force
    return velocity if speed <= speed_max else velocity * (speed_max / speed)


@dataclass(frozen=True)
class DecayingVelocity(Reaction, name="decay"):
    """The paper's reaction (eq. 12): the end-effector moves in the direction of the push, for a while."""

    State = DecayState

    compliance_m_s_n: Positive = 0.03
    """Diagonal of the compliance matrix C [(m/s)/N] (authors' code family)."""
    speed_max_m_s: Positive = 0.3
    """Bound on the norm of the reaction velocity [m/s] (authors' code family, there per axis)."""
    decay_cycles: PositiveCount = 200
    """Control cycles in which the reaction decays linearly to zero. If it is shorter than the window, the release of a
    push passes for a new contact."""

    @classmethod
    def of(cls, reaction: Reaction, period: float) -> "DecayingVelocity":
        """Return a profile's reaction if it is one of these, else that of the paper at a control period [s].

        Without an arm in the loop it gives the time after a detection in which no other one counts.
        """
        if isinstance(reaction, DecayingVelocity):
            return reaction
        return cls().stretched(TaskParams().control_period_s / period)

    def init(self, body: Body | None = None, q: FloatArray | None = None) -> DecayState:
        """Return the state without a reaction."""
        return DecayState(np.zeros(3), self.decay_cycles)

    def begin(self, force: FloatArray) -> DecayState:
        """Return the reaction to an external force F_ext (3,) [N]."""
        return DecayState(reaction_velocity(force, self.compliance_m_s_n, self.speed_max_m_s), 0)

    def active(self, state: DecayState) -> bool:
        """Return whether the reaction still moves the arm."""
        return state.cycle < self.decay_cycles

    def sense(self, state: DecayState, body: Body, inputs: ReactionInputs) -> tuple[dict[Event, str], DecayState]:
        """Return the events: a contact, and the rest of the time of the present reaction."""
        events = contact_event(inputs.detection)
        if self.active(state):
            events[Event.REACTING] = f"{(self.decay_cycles - state.cycle) * body.period:.2f} s"
        return events, state

    def move(
        self, state: DecayState, body: Body, inputs: ReactionInputs, mode: ModeState
    ) -> tuple[ReactionMotion | None, DecayState]:
        """Return the velocity of the end-effector, and the state one cycle later."""
        if mode.mode is not Mode.REACT:
            return None, self.init()
        contact = new_contact(inputs, mode)
        if contact is not None:
            state = self.begin(contact.force)
        return ReactionMotion(state.decayed(self.decay_cycles)), state.advanced()

    def is_over(self, state: DecayState) -> bool:
        """Return whether there is no present reaction: there is no other state."""
        return not self.active(state)

    def adopted(self, state: DecayState, body: Body, before: Reaction, q: FloatArray) -> DecayState:
        """Continue the present reaction; one that is over stays so, also if this one lasts longer."""
        return state if isinstance(before, DecayingVelocity) and before.active(state) else self.init()

    def stretched(self, factor: float) -> Self:
        """Return the reaction that decays in more cycles, by a factor."""
        return replace(self, decay_cycles=max(1, round(self.decay_cycles * factor)))

    def announced(self, period: float) -> str:
        """Say how fast and how far the arm moves with a push."""
        # the distance is the area under the linear decay: half of the speed times its time
        decay = self.decay_cycles * period
        return (
            f"When pushed, it yields in the direction of the push, at up to {self.speed_max_m_s:g} m/s and for"
            f" {decay:g} s: keep everything it could hit at least {self.speed_max_m_s * decay / 2:.1f} m away from it."
        )
