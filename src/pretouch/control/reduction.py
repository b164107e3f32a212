"""Slowing the end-effector near obstacles: eqs. 3 and 4."""

from pretouch.values import value


@value
class ReductionState:
    """The factor a fading starts from, and how far it has come."""

    scale: float = 1.0
    """Factor when it last fell or kept pace."""
    cycles: int = 0
    """Cycles l_obs since then."""


def speed_scale(distance: float, d_max: float) -> float:
    """Factor d_lowest / d_max on the end-effector velocity, eq. 3 of the paper; 1 beyond d_max.

    `distance` [m] is from the end-effector origin to the nearest obstacle, infinite if there is none.
    """
    # whichever way the arm moves: eq. 3 slows a retreat as well (docs/explanation/paper.md, slow-down while retreating)
    return min(1.0, distance / d_max)


def faded_scale(scale: float, l_obs: int, l_max: int) -> float:
    """Factor s + (1 - s) l_obs / l_max of eq. 4 of the paper: back to full speed in l_max cycles after a loss."""
    return scale + (1.0 - scale) * min(1.0, l_obs / l_max)


def reduce_speed(state: ReductionState, fresh: float, l_max: int) -> tuple[float, ReductionState]:
    """One cycle of eqs. 3 and 4: the factor on the end-effector velocity, and what to remember.

    The fresh factor holds at once where it is the smaller one, and rises no faster than eq. 4 lets it: whether the
    nearest obstacle vanished, was seen again farther away, or left another one in view, the speed never jumps up.
    `fresh` is the factor of eq. 3 for what is seen now, or less where a unit is silent; 1 for nothing. `l_max` counts
    the cycles until full speed is restored.
    """
    faded = faded_scale(state.scale, state.cycles + 1, l_max)
    if fresh <= faded:
        return fresh, ReductionState(fresh, 0)
    # the factor at the loss stays, and the cycles count on: eq. 4 is linear in them and ends at 1 after l_max
    return faded, ReductionState(state.scale, state.cycles + 1)
