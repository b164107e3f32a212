"""Moving with a push: eq. 12, a velocity set at the onset of a contact that decays whatever is measured."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from pretouch.checks import Positive, PositiveCount
from pretouch.contact.detector import Body
from pretouch.contact.reaction import Reaction, ReactionInputs, ReactionMotion, contact_event, new_contact
from pretouch.modes import Event, ModeState
from pretouch.params import TaskParams
from pretouch.records import Flat
from pretouch.types import FloatArray, Mode
from pretouch.values import value


@value
class DecayState:
    """A reaction under way, or none."""

    velocity: FloatArray
    """(3,) velocity the reaction began with [m/s]."""
    cycle: int
    """Cycles since then; the reaction is over at `decay_cycles`."""


def reaction_velocity(force: FloatArray, compliance: float, speed_max: float) -> FloatArray:
    """Velocity x_des = C F_ext (3,) [m/s], the second part of eq. 12 of the paper, its norm clipped at `speed_max`.

    `force` (3,) [N] acts on the robot, base frame; `compliance` [(m/s)/N] is the diagonal of C. The arm moves the
    way it was pushed.
    """
    velocity = compliance * force
    speed = float(np.sqrt(velocity @ velocity))
    # scaled as a whole: clipping each axis would turn the motion away from the force
    return velocity if speed <= speed_max else velocity * (speed_max / speed)


def decayed(state: DecayState, cycles: int) -> FloatArray:
    """Velocity (3,) [m/s] now: linear from the first value to zero over a number of cycles."""
    return state.velocity * max(0.0, 1.0 - state.cycle / cycles)


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

    def rest(self) -> DecayState:
        """Return the state without a reaction."""
        return DecayState(np.zeros(3), self.decay_cycles)

    def begun(self, force: FloatArray) -> DecayState:
        """Begin to move with an external force F_ext (3,) [N]."""
        return DecayState(reaction_velocity(force, self.compliance_m_s_n, self.speed_max_m_s), 0)

    def active(self, state: DecayState) -> bool:
        """Whether the reaction still moves the arm."""
        return state.cycle < self.decay_cycles

    def init(self, body: Body, q: FloatArray) -> DecayState:
        """Return the state without a contact."""
        return self.rest()

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
            return None, self.rest()
        contact = new_contact(inputs, mode)
        if contact is not None:
            state = self.begun(contact.force)
        return ReactionMotion(decayed(state, self.decay_cycles)), advanced(state)

    def keep_free(self, state: DecayState, memory: Flat) -> bool:
        """Return whether no reaction is under way: nothing else is remembered."""
        return not self.active(state)

    def adopted(self, state: DecayState, body: Body, before: Reaction, q: FloatArray) -> DecayState:
        """Go on with the reaction under way; one that is over stays so, however long this one lasts."""
        return state if isinstance(before, DecayingVelocity) and before.active(state) else self.rest()

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


def advanced(state: DecayState) -> DecayState:
    """Let one control cycle pass."""
    return DecayState(state.velocity, state.cycle + 1)
