"""Caught between two things while yielding: what opposes the way the arm yields, and the way out (design 7.5)."""

import numpy as np

from pretouch.params import ReactionParams
from pretouch.types import FloatArray
from pretouch.values import value

_MARKS = 12
"""Places kept of the way the arm came."""
_APART_S = 0.05
"""Time between two of them [s]."""


@value
class ClampState:
    """What is remembered of one reaction to tell a clamp."""

    course: FloatArray
    """(n,) unit vector of the joint velocities with which the arm last followed a push, zero before."""
    pushed: float
    """Time since it followed one [s]."""
    opposed: float
    """Time for which the torque has been against the course [s]."""
    turns: int
    """Reversals of the course."""
    turned: float
    """Time since the last of them [s]."""
    trail: FloatArray
    """(M, n) joint positions commanded on the way, newest first [rad]."""
    marked: float
    """Time since the newest was noted [s]."""
    torque: float
    """Torque against the course that made it a clamp [Nm], 0 while there is none."""
    opening: float
    """Time for which the arm has opened [s]."""
    open: bool
    """Whether it has."""


def clamp_init(q: FloatArray) -> ClampState:
    """Return the state at the onset of a contact, at joint positions (n,) [rad]."""
    return ClampState(np.zeros(len(q)), np.inf, 0.0, 0, np.inf, np.tile(q, (_MARKS, 1)), 0.0, 0.0, 0.0, False)


def clamped(
    state: ClampState, torque: FloatArray, velocity: FloatArray, q: FloatArray, least: float, dt: float,
    params: ReactionParams,
) -> ClampState:  # fmt: skip
    """Judge one period of yielding.

    A clamp is a torque against the course the arm follows a push on, for longer than noise makes one, and so soon
    after the push that it may still be there. Later it is a push of its own, to be yielded to; but that too is a clamp
    when the arm has been sent to and fro. A push from the side, or harder the same way, is none.

    Args:
        state: memory.
        torque: (n,) external torque [Nm].
        velocity: (n,) of the virtual mass [rad/s].
        q: (n,) commanded joint positions [rad].
        least: speed in joint space from which the arm is on a course [rad/s].
        dt: period [s].
        params: parameters.
    """
    p, speed = params, float(np.sqrt(velocity @ velocity))
    along = float(torque @ state.course)
    opposed = state.opposed + dt if along < -p.clamp_nm else 0.0
    soon = state.pushed < p.clamp_window_s + p.clamp_s
    course, pushed, turns, turned = state.course, state.pushed + dt, state.turns, state.turned + dt
    if speed > least and torque @ velocity > 0.5 * p.clamp_nm * speed and not (soon and opposed > 0):
        reversed_ = bool(velocity @ course < 0)
        turns = (turns if turned < p.turn_s else 0) + 1 if reversed_ else turns
        course, pushed, turned = velocity / speed, 0.0, 0.0 if reversed_ else turned
    caught = (soon and opposed >= p.clamp_s - 1e-9) or turns >= p.clamp_turns
    trail, marked = state.trail, state.marked + dt
    if marked >= _APART_S:
        trail, marked = np.vstack((q[None], trail[:-1])), 0.0
    return ClampState(
        course, pushed, opposed, turns, turned, trail, marked,
        max(abs(along), p.clamp_nm) if caught else 0.0, 0.0, False,
    )  # fmt: skip


def opened(
    state: ClampState, torque: FloatArray, q: FloatArray, dt: float, params: ReactionParams
) -> tuple[FloatArray, ClampState]:
    """Return the joint velocities (n,) [rad/s] back to the next place of the way the arm came, of any length.

    It ends after its time, at the end of the way, and where something opposes it as a clamp does: the arm is then not
    pushed into what pushes it.

    Args:
        state: memory, of a clamp.
        torque: (n,) external torque [Nm].
        q: (n,) commanded joint positions [rad].
        dt: period [s].
        params: parameters.
    """
    trail = state.trail
    while len(trail) > 1 and np.abs(trail[0] - q).max() < _NEAR_RAD:
        trail = trail[1:]
    way = trail[0] - q
    length = float(np.sqrt(way @ way))
    against = length > 0 and float(torque @ way) < -params.clamp_nm * length
    opposed = state.opposed + dt if against else 0.0
    over = (
        state.opening + dt > params.open_s or opposed >= params.clamp_s - 1e-9 or float(np.abs(way).max()) < _NEAR_RAD
    )
    return way / dt, ClampState(
        state.course, state.pushed, opposed, state.turns, state.turned, trail, state.marked, state.torque,
        state.opening + dt, state.open or over,
    )  # fmt: skip


_NEAR_RAD = 0.002
"""Distance at which a place of the way counts as reached [rad]."""
