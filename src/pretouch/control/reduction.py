"""Slowing the end-effector near obstacles: eqs. 3 and 4."""

from dataclasses import dataclass

from pretouch.params import ReductionParams


@dataclass(frozen=True, slots=True)
class ReductionState:
    """The factor obstacles left behind, and how far it has faded."""

    scale: float = 1.0
    """Factor d_lowest / d_max when the obstacle was last seen."""
    cycles: int = 0
    """Cycles l_obs since it vanished; 0 while it is seen."""


def speed_scale(distance: float, d_max: float) -> float:
    """Factor d_lowest / d_max on the end-effector velocity, eq. 3 of the paper; 1 beyond d_max.

    `distance` [m] is from the end-effector origin to the nearest obstacle, infinite if there is none.
    """
    return min(1.0, distance / d_max)


def faded_scale(scale: float, l_obs: int, l_max: int) -> float:
    """Factor s + (1 - s) l_obs / l_max of eq. 4 of the paper: back to full speed in l_max cycles after a loss."""
    return scale + (1.0 - scale) * min(1.0, l_obs / l_max)


def reduce_speed(state: ReductionState, distance: float, params: ReductionParams) -> tuple[float, ReductionState]:
    """One cycle of eqs. 3 and 4: the factor on the end-effector velocity, and what to remember.

    Once a nearest obstacle within d_max is lost its factor fades. When one is seen again during the fading, the
    smaller of fading and fresh factor holds, so the speed never jumps up. `distance` [m] is infinite without one.
    """
    fresh = speed_scale(distance, params.d_max_m)
    seen = distance < params.d_max_m
    if seen and state.cycles == 0:
        return fresh, ReductionState(fresh, 0)
    faded = faded_scale(state.scale, state.cycles + 1, params.l_max_cycles)
    if faded >= 1.0 or (seen and fresh <= faded):
        return fresh, ReductionState(fresh, 0)
    return faded, ReductionState(state.scale, state.cycles + 1)
