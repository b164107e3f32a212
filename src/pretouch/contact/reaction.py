"""Moving with a push: eq. 12, and its linear decay."""

import numpy as np

from pretouch.params import ReactionParams
from pretouch.types import FloatArray
from pretouch.values import value


@value
class ReactionState:
    """A reaction under way, or none."""

    velocity: FloatArray
    """(3,) velocity the reaction began with [m/s]."""
    cycle: int
    """Cycles since then; the reaction is over at `decay_cycles`."""


def reaction_init(params: ReactionParams) -> ReactionState:
    """Return the state without a reaction."""
    return ReactionState(np.zeros(3), params.decay_cycles)


def external_force(reading: FloatArray, mean: FloatArray) -> FloatArray:
    """F_ext = F_reading - mu (3,) [N], the first part of eq. 12 of the paper."""
    return reading - mean


def reaction_velocity(force: FloatArray, compliance: float, speed_max: float) -> FloatArray:
    """Velocity x_des = C F_ext (3,) [m/s], the second part of eq. 12 of the paper, its norm clipped at `speed_max`.

    `force` (3,) [N] acts on the robot, base frame; `compliance` [(m/s)/N] is the diagonal of C. The arm moves the
    way it was pushed.
    """
    velocity = compliance * force
    speed = float(np.sqrt(velocity @ velocity))
    return velocity if speed <= speed_max else velocity * (speed_max / speed)


def start_reaction(force: FloatArray, params: ReactionParams) -> ReactionState:
    """Begin to move with an external force F_ext (3,) [N]."""
    return ReactionState(reaction_velocity(force, params.compliance_m_s_n, params.speed_max_m_s), 0)


def active(state: ReactionState, params: ReactionParams) -> bool:
    """Whether the reaction still moves the arm."""
    return state.cycle < params.decay_cycles


def decayed(state: ReactionState, params: ReactionParams) -> FloatArray:
    """Velocity (3,) [m/s] now: linear from the first value to zero over `decay_cycles`."""
    return state.velocity * max(0.0, 1.0 - state.cycle / params.decay_cycles)


def advance(state: ReactionState) -> ReactionState:
    """Let one control cycle pass."""
    return ReactionState(state.velocity, state.cycle + 1)
