"""RealPushes of known force on recordings of real arms: J^T F, taken off the driving torques, by way of the observer.

The recorded motion stays, as if the arm were too stiff for a push to move it.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pretouch.params import SequentialParams
from pretouch.types import BoolArray, FloatArray
from pretouch.values import value
from pretouch_lab.bench.real_sets import TorqueStream

LASTING_S = 0.1
"""Duration of a push [s]."""
_FADES_S = 0.2
"""Time in which the observer forgets a push [s]."""
_EARLIEST_S, _ROOM_S = 0.5, 0.4
"""Least time from the start of a run to a push, and from a push to the run's end or to a contact [s]."""


@value
class RealPushes:
    """P pushes on a stream, `LASTING_S` each."""

    start: FloatArray
    """(P,) [s]."""
    force: FloatArray
    """(P, 3) on the robot, base frame [N]."""
    forearm: BoolArray
    """(P,) true at the end of the forearm, false at the end-effector."""


def starts(stream: TorqueStream, runs: Sequence[int], every_s: float, seed: int) -> FloatArray:
    """Return instants (P,) [s] for pushes in the free motion of some runs, `every_s` apart; the first is random."""
    time, random, begins = stream.recording.time, np.random.default_rng(seed), []
    for run in runs:
        own = np.flatnonzero(stream.run == run)
        labelled = time[own][stream.label[own] != 0]
        begin = time[own[0]] + every_s * random.random()
        for start in np.arange(begin, time[own[-1]] - _ROOM_S, every_s):
            near = (labelled > start - _ROOM_S) & (labelled < start + _ROOM_S)
            if start > time[own[0]] + _EARLIEST_S and not near.any():
                begins.append(float(start))
    return np.array(begins)


def in_any_direction(start: FloatArray, size: FloatArray | float, seed: int) -> RealPushes:
    """Return pushes of a size [N] in directions drawn evenly from the sphere, by turns on end-effector and forearm."""
    random = np.random.default_rng(seed)
    direction = random.normal(size=(len(start), 3))
    unit = direction / np.linalg.norm(direction, axis=1, keepdims=True)
    return RealPushes(start, unit * np.broadcast_to(size, len(start))[:, None], np.arange(len(start)) % 2 == 1)


def told_least(stream: TorqueStream, start: FloatArray, size: FloatArray, spread: FloatArray) -> RealPushes:
    """Return pushes of `size` (P,) [N] on the end-effector, in the direction that the torques tell least of.

    They begin at `start` (P,) [s]; `spread` (n, n) is the covariance of the torques in free motion [Nm^2].
    """
    r, force = stream.recording, np.empty((len(start), 3))
    for k, at in enumerate(np.searchsorted(r.time, start)):
        J = r.model.ee_jacobian(r.model.kinematics(r.q[at]))[:3]
        force[k] = size[k] * np.linalg.eigh(J @ np.linalg.solve(spread, J.T))[1][:, 0]  # ascending eigenvalues
    return RealPushes(start, force, np.zeros(len(start), np.bool_))


def pushed(stream: TorqueStream, pushes: RealPushes) -> TorqueStream:
    """Return a stream with pushes in its external torques.

    The observer is linear in the driving torques: a push adds to its residual what it makes of J^T F alone.
    """
    r, model, gain = stream.recording, stream.recording.model, SequentialParams().observer_gain_1_s
    joints, tau = model.moved_by.sum(axis=1), r.tau_ext.copy()
    forearm, wrist = (int(np.argmax(joints == model.n - count)) for count in (3, 2))
    for start, force, on_forearm in zip(pushes.start, pushes.force, pushes.forearm, strict=True):
        first, last = np.searchsorted(r.time, (start, start + LASTING_S + _FADES_S))
        added = np.zeros(model.n)
        for i in range(max(first, 1), last):
            kin, step = model.kinematics(r.q[i]), gain * (r.time[i] - r.time[i - 1])
            J = model.jacobian(kin, forearm, kin.position[wrist]) if on_forearm else model.ee_jacobian(kin)
            lasts = r.time[i] < start + LASTING_S
            added = (added + step * lasts * (J[:3].T @ force)) / (1.0 + step)
            tau[i] += added
    return replace(stream, recording=replace(r, tau_ext=tau))
