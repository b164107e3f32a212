"""A sequential test for a contact: a bank of windows, each compared with forces on each link.

The statistic is Shiryaev's and Roberts', R = sum of prior weights times likelihood ratios, over the links that may be
touched and the instants at which it may have begun, namely 1, 2, 4, ... 32 samples ago. In free motion its
expectation is the sum of the weights, so that it exceeds A with a probability of at most sum / A a sample (Markov).
The force of a contact is unknown, and integrated out in closed form with a Gaussian prior whose spread is g times that
of free motion (Zellner 1986): with a prior as wide as all possible forces, a contact that only some joints measure
would lose evidence by the others.

**Hypotheses** are contacts in one posture, and their priors. An object adds hypotheses and removes none: a force on the
body's point nearest to it, away from it. Their weight is a hazard: the probability that both meet about now, by their
distance, its error and the closing speed. An object that stands still beside an arm that does not approach it adds
nothing, as one that no unit sees; all other contacts keep the weight they have without a skin.
"""

import math
from typing import NamedTuple

import numpy as np

from pretouch.cholesky import backward, factor, forward
from pretouch.compiled import compiled, kernel
from pretouch.contact.scatter import LENGTHS, WindowMeans, covariance_of_mean, spread_out
from pretouch.params import ProximityPriorParams, SequentialParams
from pretouch.robot.kinematics import Kinematics, Mechanism, jacobian_into, rotate
from pretouch.types import FloatArray, IntArray, Obstacles

_LARGEST = 300.0
"""Largest logarithm of a likelihood ratio."""
_SMALLEST = 1e-300
_SINGULAR = 1e-6
"""Part of its trace by which a force's information is made regular: a force along a joint's axis has none."""


def alarm_bound(p: SequentialParams, period: float) -> float:
    """Return ln A for the chosen rate of false alarms, at one sample a period [s]."""
    # A is the number of samples in which one false alarm is allowed
    return max(1.0, math.log(3600.0 / period / p.false_alarms_per_hour))


class Moment(NamedTuple):
    """Torques of one sample, with motion and surroundings of the arm. n joints, L links."""

    kin: Kinematics
    qd: FloatArray
    """(n,) measured joint velocities [rad/s]."""
    qd_commanded: FloatArray
    """(n,) [rad/s]."""
    tau_ext: FloatArray
    """(n,) external torques [Nm], without NaN."""
    obstacles: Obstacles
    touch_gain: FloatArray
    """(L,) factor on the prior of a contact on each link, by the touch sensors."""
    watched: bool
    """True if a skin watches: no unit is silent or touched."""
    reacting: bool
    """True while the arm moves with a contact."""


class Hypotheses(NamedTuple):
    """The possible contacts.

    The first n are torques on the joints before each link, by any wrench; the H others are forces at a point.
    """

    J: FloatArray
    """(H, 3, n) Jacobians of the points."""
    joints: IntArray
    """(H,) number of joints that move each point."""
    weight: FloatArray
    """(n + H,) prior weights of all hypotheses, for all windows together."""
    away: FloatArray
    """(H, 3) expected direction of the force, zero for any direction."""


@kernel
def judge(means: WindowMeans, contacts: Hypotheses, gain: float, tails: float) -> tuple[float, int, int]:
    """Return ln R, and the window and the hypothesis with the largest part in it.

    `means` are of residuals, with their distribution in free motion; `gain` is g, the ratio of a contact's spread to
    that of free motion; `tails` are the degrees of freedom of the Student distribution.
    """
    J, joints, weight, away = contacts
    scatter, whitened, squares, ratios = means.scatter, means.whitened, means.square, means.ratio
    n, total, best, window, which = len(means.S), 0.0, -1.0, 0, 0
    S0, L, z, y, pivot = np.empty((n, n)), np.zeros((n, n)), np.empty(n), np.empty(n), np.empty(n)
    K = np.empty((n, n))
    scratch, widened = np.empty((n, 3)), np.log1p(gain)
    for k in range(means.whole):
        for i in range(n):
            z[i] = means.mean[k, n - 1 - i]
        covariance_of_mean(means, k, S0)
        if not factor(S0, L):
            continue
        for i in range(n):
            ratios[k, n - 1 - i] = z[i] ** 2 / S0[i, i]
        forward(L, z, whitened[k])
        spread_out(scatter[k], L, K)
        for i in range(n):
            pivot[i] = 1.0 / L[i, i]
        squares[k] = square = forward(L, z, y)
        behind = 0.0
        alone = np.log1p(square / tails)
        for h in range(n + len(J)):
            link, size, explained, one_sided = h, 3, 0.0, 1.0
            if h < n:
                # a wrench explains any torques of the first n - h joints; the others, the beginning of y, stay noise
                link, size, explained = n - 1 - h, n - h, square - behind
                behind += y[h] ** 2
            if weight[link] <= 0.0:
                continue
            if h >= n:
                explained, one_sided = explained_by_force(L, pivot, y, J[h - n], joints[h - n], away[h - n], scratch)
            ratio = log_ratio(alone, square, explained, size, n, gain, widened, tails)
            # the windows share the weight equally
            part = weight[link] * np.exp(min(ratio, _LARGEST)) * one_sided / len(LENGTHS)
            total += part
            if part > best:
                best, window, which = part, k, link
    return np.log(max(total, _SMALLEST)), window, which


@kernel
def log_ratio(
    alone: float, square: float, explained: float, size: int, n: int, gain: float, widened: float, tails: float
) -> float:
    """Return the logarithm of the likelihood ratio of a sample z (n,), with a contact over free motion.

    Free motion is Student's, of spread S and `tails` degrees of freedom; with a contact the spread is 1 + g times as
    large in the `size` directions it can push. `square` is z^T S^-1 z, `explained` the part of it in these directions;
    `alone` = ln(1 + square / tails) and `widened` = ln(1 + g) are the same for many contacts.
    With many degrees of freedom this is ((1 + g)^-size exp(g / (1 + g) explained))^(1/2).
    """
    # in the directions of a contact the spread is 1 + g times as large: 1 / (1 + g) of their part is left
    rest = square - gain / (1.0 + gain) * explained
    return 0.5 * (tails + n) * (alone - np.log1p(rest / tails)) - 0.5 * size * widened


@kernel
def explained_by_force(
    L: FloatArray, pivot: FloatArray, y: FloatArray, J: FloatArray, joints: int, away: FloatArray, a: FloatArray
) -> tuple[float, float]:
    """Return the part of y . y that a force at a point explains, and the factor for its direction `away`, from 0 to 2.

    `L` is the factor of S, `pivot` (n,) the inverse of its diagonal, and y = L^-1 z, the last joint first; `J` (3, n)
    the point's Jacobian, moved by the first so many joints. The second value is 1 where `away` (3,) is zero. `a` (n, 3)
    is overwritten.
    """
    n, first = len(y), len(y) - joints
    b0 = b1 = b2 = g00 = g10 = g11 = g20 = g21 = g22 = 0.0
    for j in range(first, n):
        # L^-1 of the columns of J^T, whose entries before `first` are zero
        a0, a1, a2 = J[0, n - 1 - j], J[1, n - 1 - j], J[2, n - 1 - j]
        for k in range(first, j):
            a0 -= L[j, k] * a[k, 0]
            a1 -= L[j, k] * a[k, 1]
            a2 -= L[j, k] * a[k, 2]
        a0, a1, a2 = a0 * pivot[j], a1 * pivot[j], a2 * pivot[j]
        a[j, 0], a[j, 1], a[j, 2] = a0, a1, a2
        b0, b1, b2 = b0 + a0 * y[j], b1 + a1 * y[j], b2 + a2 * y[j]
        g00, g10, g11 = g00 + a0 * a0, g10 + a1 * a0, g11 + a1 * a1
        g20, g21, g22 = g20 + a2 * a0, g21 + a2 * a1, g22 + a2 * a2
    # the Cholesky factor c of J S^-1 J^T, and u = c^-1 b
    regular = _SINGULAR * (g00 + g11 + g22)
    if not regular > 0.0:  # no joint moves the point, or it is NaN
        return 0.0, 1.0
    c00 = 1.0 / np.sqrt(g00 + regular)
    c10, c20 = g10 * c00, g20 * c00
    c11 = 1.0 / np.sqrt(g11 + regular - c10 * c10)
    c21 = (g21 - c20 * c10) * c11
    c22 = 1.0 / np.sqrt(g22 + regular - c20 * c20 - c21 * c21)
    u0 = b0 * c00
    u1 = (b1 - c10 * u0) * c11
    u2 = (b2 - c20 * u0 - c21 * u1) * c22
    explained = u0 * u0 + u1 * u1 + u2 * u2
    if away[0] == 0.0 and away[1] == 0.0 and away[2] == 0.0:
        return explained, 1.0
    # along . force / its deviation, both with v = c^-1 away
    v0 = away[0] * c00
    v1 = (away[1] - c10 * v0) * c11
    v2 = (away[2] - c20 * v0 - c21 * v1) * c22
    along, deviation = u0 * v0 + u1 * v1 + u2 * v2, np.sqrt(v0 * v0 + v1 * v1 + v2 * v2)
    # 2 Phi(along / deviation): a prior on one side only is twice as dense there
    return explained, 1.0 + math.erf(along / deviation / math.sqrt(2.0))


MOST = 4
"""Number of nearest objects that count."""


@kernel
def link_prior(mechanism: Mechanism) -> float:
    """Return ln of the prior weight of a force on one link in one window, without obstacles and touches."""
    return -math.log(2.0 * len(mechanism.links.parts) * len(LENGTHS))


@kernel
def hypotheses(now: Moment, mechanism: Mechanism, near: ProximityPriorParams) -> tuple[Hypotheses, float]:
    """Return the hypotheses: any wrench beyond each joint, a force on each link, one by each of the nearest objects.

    At most `MOST` objects count. All weights are multiplied by the touch gain of the link; of several links behind one
    joint the largest gain counts. The second value is the largest probability of a touch a horizon from now.
    """
    obstacles, touch_gain, qd = now.obstacles, now.touch_gain, now.qd
    position, rotation, anchor, axis = now.kin
    moved_by, parts, middle = mechanism.arm.moved_by, mechanism.links.parts, mechanism.links.middle
    distance, direction = obstacles.body_distance, obstacles.direction
    n, count, full, point = len(anchor), len(parts), np.empty((6, len(anchor))), np.empty(3)
    order, k, touching = np.argsort(distance)[:MOST], 0, 0.0
    size = count + len(order)
    J, joints, weight, away = np.empty((size, 3, n)), np.empty(size, np.int64), np.empty(n + size), np.zeros((size, 3))
    # joints and links share a weight of 1, without the objects: half for any wrench on a link, which moves the joints
    # before it, half for a force at the middle of a link
    weight[:n] = 0.0
    for body in range(len(moved_by)):
        # in a serial chain the joints that move a link are the first ones, so their number determines them
        before = sum(moved_by[body])
        if before:
            weight[before - 1] = max(weight[before - 1], 0.5 / n * touch_gain[body])
    for h in range(len(J)):
        if h < count:
            link = parts[h]
            weight[n + h] = (0.5 / count) * touch_gain[link]
            rotate(rotation[link], middle[h], point)
            point += position[link]
        else:
            k = order[h - count]
            link, point[:] = obstacles.link[k], obstacles.body_point[k]
        jacobian_into(anchor, axis, moved_by[link], point, full)
        J[h], joints[h] = full[:3], sum(moved_by[link])
        if h >= count:
            # closing speed: that of the object towards the body, and u^T J qd of the body towards the object; a force
            # away from the object has the direction -u
            speed = obstacles.closing_speed[k]
            for a in range(3):
                away[h, a] = -direction[k, a]
                for j in range(n):
                    speed += direction[k, a] * J[h, a, j] * qd[j]
            touches, before = meeting(distance[k], speed, near.error_m, near.horizon_s)
            weight[n + h] = near.gain * (touches - before) * touch_gain[link]
            touching = max(touching, touches)
    return Hypotheses(J, joints, weight, away), touching


@kernel
def meeting(distance: float, closing: float, error: float, horizon: float) -> tuple[float, float]:
    """Return the probabilities that an object touches the body a `horizon` [s] from now, and that it did one ago.

    `distance` [m] is from the body's surface, with a standard deviation `error` [m]; `closing` [m/s] is the speed at
    which it shrinks. A growing distance counts as constant.
    """
    way, unit = max(closing, 0.0) * horizon, math.sqrt(2.0) * error
    return 0.5 * math.erfc((distance - way) / unit), 0.5 * math.erfc((distance + way) / unit)


_DAMPING = 0.02
"""Damping d: below it a direction is singular, and the force in it is underestimated."""


@compiled
def force_map_into(J: FloatArray, W: FloatArray) -> None:
    """Write the map (3, n) from joint torques [Nm] to the force at the end-effector that explains them best [N].

    Damped least squares: the first three rows of (J J^T + d^2 I)^-1 J of the Jacobian (6, n). Such a force does work on
    the end-effector in the direction in which the torques do work on the joints, wherever the contact is.
    """
    A, L, unit, y, x = np.empty((6, 6)), np.zeros((6, 6)), np.zeros(6), np.empty(6), np.empty(6)
    for i in range(6):
        for k in range(i + 1):
            # J J^T + d^2 I, of which `factor` reads the lower triangle only
            A[i, k] = _DAMPING**2 if i == k else 0.0
            for j in range(J.shape[1]):
                A[i, k] += J[i, j] * J[k, j]
    factor(A, L)
    for i in range(3):
        # x = A^-1 e_i, a row of A^-1 too, for A is symmetric
        unit[i] = 1.0
        forward(L, unit, y)
        backward(L, y, x)
        unit[i] = 0.0
        for j in range(J.shape[1]):
            W[i, j] = 0.0
            for k in range(6):
                W[i, j] += x[k] * J[k, j]
