"""A residual that lasts: a load that is gripped or put down, or a step of an estimate; the difference from a contact.

While nothing is near, a torque that the same weight at the end-effector continues to explain, or the same small torque
on one joint alone, is learnt as free motion, whether the arm stands or yields. A clamped person is neither: near, or
not constant, or not straight down, or measured by more than one joint.
"""

import numpy as np

from pretouch.cholesky import backward, factor, forward
from pretouch.compiled import kernel
from pretouch.contact.learning import least_squares_step
from pretouch.contact.residual_model import PLAIN, FreeSample, ResidualModel, SequentialNumbers, SequentialState
from pretouch.contact.scatter import LONGEST, WindowMeans
from pretouch.robot.kinematics import G_M_S2
from pretouch.types import FloatArray

MOST_KG = 3.0
"""Largest load: a Panda's payload [kg]."""
_LEAST_KG = -0.3
"""A load below this is a force from below [kg]: errors of the links' masses may look like so much."""
_FAR_M = 0.15
"""Distance of a load's centre from the end-effector's origin along each horizontal axis [m]: the prior's deviation
for the largest load. A sum of both beyond twice of it is refused, so along one axis alone 0.3 m."""
_OFFSETS = 3.0
"""Largest offset of a joint after a step, in deviations of its prior."""
_UNKNOWN_NM = 0.3
"""Error of the mean of a joint's torque by friction [Nm]."""
_UNKNOWN_ALONE_NM = 0.15
"""The same for a step of one joint: a contact would show in other joints too [Nm]."""
_CHANGE_NM = 0.6
"""Change of a constant torque while the arm creeps, by friction [Nm]."""
_CHANGE_PART = 0.1
"""Part of a load's largest torque that is added to that while the arm moves."""
_DEVIATIONS = 4.0
"""Deviations that a constant torque may seem to change, and that a load may leave unexplained."""
_ALONE_DEVIATIONS = 2.5
"""The same for a step of one joint."""


@kernel
def tilt_into(upright: FloatArray, J: FloatArray, tilt: FloatArray) -> None:
    """Write how joints turn the end-effector (2, n) about two horizontal axes, by its Jacobian J (6, n).

    `upright` (3, 3) is that of `Mechanism`.
    """
    for i in range(2):
        for j in range(tilt.shape[1]):
            tilt[i, j] = upright[i, 0] * J[3, j] + upright[i, 1] * J[4, j] + upright[i, 2] * J[5, j]


@kernel
def _stands_out(residual: FloatArray, S: FloatArray) -> bool:
    """Return whether a mean (n,) of the longest window [Nm] is more than noise and friction."""
    n = len(residual)
    C, L = np.empty((n, n)), np.zeros((n, n))
    _spread_of_mean(S, _UNKNOWN_ALONE_NM, C)
    # r^T C^-1 r is chi-square with n degrees of freedom in free motion: mean n, deviation sqrt(2 n)
    return bool(factor(C, L) and forward(L, residual, np.empty(n)) > n + _ALONE_DEVIATIONS * np.sqrt(2.0 * n))


@kernel
def _still_explains(
    lasting: FloatArray, residual: FloatArray, unit: FloatArray, tilt: FloatArray, S: FloatArray, moving: int
) -> bool:
    """Return whether a lasting load or step (3 + n,), see `find_lasting`, still explains a residual (n,) [Nm].

    It does if no joint's torque has changed, and it explains more than half of the residual.
    """
    whole = left = largest = 0.0
    for j in range(len(residual)):
        largest = max(largest, abs(unit[j] * lasting[0]))
    for j in range(len(residual)):
        # a weight has no moment about the vertical
        moments = G_M_S2 * (tilt[0, j] * lasting[1] + tilt[1, j] * lasting[2])
        rest = residual[j] - (lasting[0] * unit[j] + moments + lasting[3 + j])
        # the estimate came from a mean like this one: the difference of both has twice the variance of one
        allowed = _DEVIATIONS**2 * 2.0 * S[j, j] / LONGEST + _CHANGE_NM**2
        if moving:  # the mean is of another posture than this one
            allowed += (_CHANGE_PART * largest) ** 2
        if rest**2 > allowed:
            return False
        whole, left = whole + residual[j] ** 2 / allowed, left + rest**2 / allowed
    return left < 0.5 * whole


@kernel
def find_lasting(
    means: WindowMeans, x: FloatArray, weights: FloatArray, tilt: FloatArray, offset_prior: float, lasting: FloatArray
) -> bool:
    """Write a load or a step of one joint that explains the residual, and return whether there is one.

    Of the residual's means only the longest window counts. `x` (n, f) are features with `weights` (n, f) [Nm] of the
    mean learnt so far, `tilt` (2, n) that of `tilt_into`, `offset_prior` a joint offset's deviation [Nm].
    `lasting` (3 + n,) is written: load [kg], its moments about both horizontal axes [kg m], each joint's torque [Nm].
    """
    residual, S, n, last = means.mean[-1], means.S, x.shape[0], x.shape[1] - 1
    carried, load = np.empty(n), np.zeros(3)
    for j in range(n):
        # the part of the mean that may be weight: without friction, features 1 to PLAIN - 1
        carried[j] = weights[j, 0] * x[j, 0]
        for a in range(PLAIN, last + 1):
            carried[j] += weights[j, a] * x[j, a]
    lasting[:] = 0.0
    joint, step, rest = _one_joint(residual, S)
    misfit = load_misfit(residual, carried, x[:, last].copy(), tilt, S, load)
    # the whole offset is bounded, not the step: so pushes that pass for steps cannot accumulate
    if joint >= 0 and abs(weights[joint, 0] + step) <= _OFFSETS * offset_prior and rest < misfit:
        lasting[3 + joint] = step
        return True
    if misfit < np.inf:
        lasting[:3] = load
        return True
    return False


@kernel
def _one_joint(residual: FloatArray, S: FloatArray) -> tuple[int, float, float]:
    """Return the joint whose torque alone explains a residual, the torque and the misfit; joint -1 if none does."""
    n, joint, step, best = len(residual), -1, 0.0, np.inf
    C, L, y, a, unit = np.empty((n, n)), np.zeros((n, n)), np.empty(n), np.empty(n), np.zeros(n)
    _spread_of_mean(S, _UNKNOWN_ALONE_NM, C)
    if not factor(C, L):
        return -1, 0.0, np.inf
    square = forward(L, residual, y)
    for j in range(n):
        unit[j] = 1.0
        # a = L^-1 e_j, y = L^-1 r: the joint alone explains (a . y)^2 / a . a of y . y, by the torque a . y / a . a
        size, along = forward(L, unit, a), 0.0
        unit[j] = 0.0
        for i in range(n):
            along += a[i] * y[i]
        if square - along**2 / size < best:
            joint, step, best = j, along / size, square - along**2 / size
    return (joint, step, best) if best < n + _ALONE_DEVIATIONS * np.sqrt(2.0 * n) else (-1, 0.0, np.inf)


@kernel
def load_misfit(
    residual: FloatArray, carried: FloatArray, unit: FloatArray, tilt: FloatArray, S: FloatArray, load: FloatArray
) -> float:
    """Write the change of a load (3,), see `find_lasting`, that explains a lasting residual.

    Returns the unexplained square of the residual, infinite where it is no load. `carried` (n,) is the part of the mean
    that may be weight, `unit` (n,) are the torques of 1 kg [Nm].
    """
    n, whole = len(residual), np.empty(3)
    misfit = _fit_load(residual, unit, tilt, S, load)
    # the change has either sign, as a load can be put down; the whole load cannot weigh less than nothing
    _fit_load(residual + carried, unit, tilt, S, whole)
    # the centre is too far off: |x| + |y| > 0.3 m; a load below 0.1 kg may have the moments of 0.1 kg
    near = abs(load[1]) + abs(load[2]) <= 2.0 * _FAR_M * max(abs(load[0]), 0.1)
    few = misfit < n + _DEVIATIONS * np.sqrt(2.0 * n)
    light = abs(load[0]) < MOST_KG - _LEAST_KG and _LEAST_KG < whole[0] < MOST_KG - _LEAST_KG
    return misfit if near and few and light else np.inf


@kernel
def _fit_load(residual: FloatArray, unit: FloatArray, tilt: FloatArray, S: FloatArray, load: FloatArray) -> float:
    """Write the load (3,) that best explains a residual, see `find_lasting`; return its unexplained square."""
    n = len(residual)
    C, L, y, a = np.empty((n, n)), np.zeros((n, n)), np.empty(n), np.empty((3, n))
    G, K, b, u = np.zeros((3, 3)), np.zeros((3, 3)), np.zeros(3), np.empty(3)
    load[:] = 0.0
    _spread_of_mean(S, _UNKNOWN_NM, C)
    if not factor(C, L):
        return np.inf
    # ridge regression of the whitened residual on the weight and both of its moments
    forward(L, unit, a[0])
    for k in range(2):  # the moments of its centre about the horizontal axes
        forward(L, tilt[k] * G_M_S2, a[1 + k])
    square = forward(L, residual, y)
    for i in range(3):
        for j in range(n):
            b[i] += a[i, j] * y[j]
            for k in range(3):
                G[i, k] += a[i, j] * a[k, j]
        # prior deviations: the largest load, and that load at the largest distance
        G[i, i] += 1.0 / (MOST_KG if i == 0 else MOST_KG * _FAR_M) ** 2
    if not factor(G, K):
        return np.inf
    explained = forward(K, b, u)  # b^T (G + P)^-1 b
    backward(K, u, load)
    return float(square - explained)


@kernel
def _spread_of_mean(S: FloatArray, unknown: float, C: FloatArray) -> None:
    """Write the spread C (n, n) of a mean of the longest window, with an `unknown` error [Nm] of each joint."""
    for i in range(len(S)):
        for j in range(len(S)):
            C[i, j] = S[i, j] / LONGEST
        C[i, i] += unknown**2  # an error of the mean does not average out


@kernel
def _learn_lasting(
    lasting: FloatArray, residual: FloatArray, x: FloatArray, S: FloatArray, model: ResidualModel, prior: FloatArray
) -> None:
    """Add a lasting load or step to the mean at once: a load to all joints, a step to its joint.

    The rest of the residual (n,) goes into the load and the offset of each joint alone.
    """
    n, load = x.shape[0], x.shape[1] - 1
    weights, covariance, kg = model.weights, model.covariance, lasting[0]
    for j in range(n):
        # the torque itself: the residual and its mean
        torque = residual[j]
        for a in range(load + 1):
            torque += weights[j, a] * x[j, a]
        weights[j, load] += kg
        weights[j, 0] += lasting[3 + j]
        # the load's moments have no feature: the offsets absorb them, for this posture
        if kg != 0.0:
            covariance[j, 0, 0] += prior[0]
            covariance[j, load, load] += (_LOAD_KG + _LOAD_PART * abs(kg)) ** 2
        elif lasting[3 + j] != 0.0:
            covariance[j, 0, 0] += _UNKNOWN_NM**2
        least_squares_step(weights[j], covariance[j], x[j], torque, S[j, j] / LONGEST, prior, 0.0)


_LOAD_KG, _LOAD_PART = 0.1, 0.05
"""Deviation of a load that has just been learnt [kg], and the part of it that is added."""


@kernel
def follow_lasting(
    state: SequentialState, reacting: bool, suspected: bool, numbers: SequentialNumbers, sample: FreeSample,
    means: WindowMeans, tilt: FloatArray,
) -> None:  # fmt: skip
    """Count the samples that the same load or step explains, and learn it when these are enough.

    Samples with a suspected contact or a reaction count; a count starts only with a significant residual.

    Args:
        state: memory, changed.
        reacting: whether the arm moves with a contact.
        suspected: whether a contact is suspected.
        numbers: of the test.
        sample: the newest.
        means: of all windows.
        tilt: (2, n) of `tilt_into`.
    """
    residual, S, x, model, steady = means.mean[-1], means.S, sample.x, state.model, state.steady
    n, counts = len(residual), suspected or reacting
    # the torques of 1 kg depend on the posture: they are computed anew in each step
    if steady[0] and _still_explains(state.lasting, residual, x[:, -1].copy(), tilt, S, sample.moving[0]):
        steady[0] += int(counts)
    else:  # something else, or nothing: the count starts again
        steady[0], counts = 0, suspected or (reacting and _stands_out(residual, S))
    if not counts or 0 < steady[0] <= numbers.settle:
        return
    lasting = np.empty(3 + n)
    if not find_lasting(means, x, model.weights, tilt, numbers.p.offset_prior_nm, lasting):
        # a residual may be unexplained for a while; for too long it is a person
        steady[0] = steady[0] if steady[0] <= 2 * numbers.settle else 0
    elif steady[0] > numbers.settle:
        # estimated once more at the end, when it is learnt: a slow load was smaller at the beginning
        _learn_lasting(lasting, residual, x, S, model, numbers.prior)
        steady[0] = -1
    else:
        state.lasting[:] = lasting
        steady[0] = 1
