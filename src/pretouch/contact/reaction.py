"""How the arm answers a contact: the interface of reactions, and the paper's (eq. 12), a velocity that decays."""

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
    mass: VirtualMass
    """That of the reaction `admittance`, which writes to it: compiled code learns its mean in free motion."""


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

    def is_over(self, state: Any) -> bool:
        """Whether nothing is left of a contact, so that compiled steps may go on, which leave this state as it is."""
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
    contact = detection.contact
    return {} if contact is None else {Event.CONTACT: f"{np.linalg.norm(contact.force):.1f} N"}


def new_contact(inputs: ReactionInputs, mode: ModeState) -> Contact | None:
    """Return the contact that a reaction begins with in a step that ends in a mode, None where none begins."""
    begins = mode.mode is Mode.REACT and inputs.mode.mode is not Mode.REACT
    return inputs.detection.contact if begins else None


@value
class DecayState:
    """A reaction under way, or none."""

    velocity: FloatArray
    """(3,) velocity the reaction began with [m/s]."""
    cycle: int
    """Cycles since then; the reaction is over at `decay_cycles`."""

    def decayed(self, cycles: int) -> FloatArray:
        """Velocity (3,) [m/s] now: linear from the first value to zero over a number of cycles."""
        return self.velocity * max(0.0, 1.0 - self.cycle / cycles)

    def advanced(self) -> "DecayState":
        """Let one control cycle pass."""
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
    """Control cycles in which the reaction decays linearly to zero. Shorter than the window, the release of a
    push is taken for a new contact."""

    @classmethod
    def of(cls, reaction: Reaction, period: float) -> "DecayingVelocity":
        """Return a profile's reaction if it is one of these, else that of the paper at a control period [s].

        Without an arm in the loop it says for how long a detection is answered, and no other is looked for.
        """
        if isinstance(reaction, DecayingVelocity):
            return reaction
        return cls().stretched(TaskParams().control_period_s / period)

    def init(self, body: Body | None = None, q: FloatArray | None = None) -> DecayState:
        """Return the state without a reaction."""
        return DecayState(np.zeros(3), self.decay_cycles)

    def begun(self, force: FloatArray) -> DecayState:
        """Begin to move with an external force F_ext (3,) [N]."""
        return DecayState(reaction_velocity(force, self.compliance_m_s_n, self.speed_max_m_s), 0)

    def active(self, state: DecayState) -> bool:
        """Whether the reaction still moves the arm."""
        return state.cycle < self.decay_cycles

    def sense(self, state: DecayState, body: Body, inputs: ReactionInputs) -> tuple[dict[Event, str], DecayState]:
        """Name a contact, and how long the reaction under way still takes."""
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
            state = self.begun(contact.force)
        return ReactionMotion(state.decayed(self.decay_cycles)), state.advanced()

    def is_over(self, state: DecayState) -> bool:
        """Whether no reaction is under way: nothing else is remembered."""
        return not self.active(state)

    def adopted(self, state: DecayState, body: Body, before: Reaction, q: FloatArray) -> DecayState:
        """Go on with the reaction under way; one that is over stays so, however long this one lasts."""
        return state if isinstance(before, DecayingVelocity) and before.active(state) else self.init()

    def stretched(self, factor: float) -> Self:
        """Return the reaction that decays in a number of cycles higher by a factor."""
        return replace(self, decay_cycles=max(1, round(self.decay_cycles * factor)))

    def announced(self, period: float) -> str:
        """Say how fast and how far the arm goes with a push."""
        # the distance is the area under the linear decay: half of the speed times its time
        decay = self.decay_cycles * period
        return (
            f"When pushed, it yields in the direction of the push, at up to {self.speed_max_m_s:g} m/s and for"
            f" {decay:g} s: keep everything it could hit at least {self.speed_max_m_s * decay / 2:.1f} m away from it."
        )
