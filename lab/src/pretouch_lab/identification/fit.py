"""The parts of an arm's residual in free motion, found together: robust, with standard errors.

The residual that a momentum observer of gain K leaves of an arm in free motion is, with L its low-pass,

    r = -L[(1 - c) tau_f(qd)] - offset - L[ripple(q)] + L[masses and payload] + K' M v + noise,

for the torque sensors' errors are taken for torques of the environment with their sign turned round, and so is the part
(1 - c) of the friction that the interface does not subtract. v is the noise of the measured joint velocities, which is
in the recording: what is measured less the derivative of the positions. It kicks the momentum, so that K' = K / (1 +
K dt) follows from a regression. All else is linear but for the friction's shape, F2 and F3: Gauss-Newton, with priors
so wide that they only hold what the motion does not show.

Outliers count little (weights of a Student distribution). Standard errors are of a sandwich: the scores are summed over
blocks of 1 s, so that they may be correlated within a block, and the priors stand in both breads and filling.
"""

import numpy as np

from pretouch.types import BoolArray, FloatArray
from pretouch.values import value
from pretouch_lab.identification.columns import Columns, carried_late, friction_parts, low_passed
from pretouch_lab.identification.params import IdentifyParams, Usual
from pretouch_lab.identification.samples import Usable, joint_scale

OWN = 6
"""Numbers of a joint: offset, friction, ln F2, F3, both parts of the ripple."""
_ROUNDS = 20
_SETTLED = 1e-2
"""A fit is done when no number moves by more than this part of what was known before [1]."""
_REACH = 1.0


@value
class Fit:
    """What was found; n joints, p = 6 n + n + 2 numbers."""

    numbers: FloatArray
    """(p,) six of each joint, then the relative errors of the links' masses [1], the payload [kg], and K' [1/s]."""
    errors: FloatArray
    """(p,) standard errors."""
    priors: FloatArray
    """(p,) standard deviations before."""
    gain: float
    """K of the low-pass [1/s]."""
    expected: FloatArray
    """(N, n) what is explained [Nm], the velocities' noise not in it."""
    kicked: FloatArray
    """(N, n) what the velocities' noise explains [Nm]."""
    scale: FloatArray
    """(n,) robust standard deviation of what is left [Nm]."""

    def of_joints(self, which: FloatArray) -> FloatArray:
        """Return numbers or errors (p,) of the joints as (n, 6)."""
        n = self.expected.shape[1]
        return which[: OWN * n].reshape(n, OWN)


def fit(
    found: Usable, columns: Columns, used: BoolArray, usual: Usual, cycles: FloatArray, p: IdentifyParams,
    payload: bool = True,
) -> Fit:  # fmt: skip
    """Find all parts from the samples that are used (N,); without `payload` that stays 0."""
    n = found.samples.q.shape[1]
    start, priors = _begin(n, usual, p, payload)
    theta, gain = start.copy(), usual.observer_gain_1_s
    kicks = bool(columns.kick.any())
    precision = np.diag(priors**-2.0)
    carried = carried_late(found, columns, gain)
    for _ in range(_ROUNDS):
        X, expected = design(found, columns, carried, theta, gain, cycles)
        left = found.samples.tau - expected - theta[-1] * columns.kick
        scale = joint_scale(left[used])
        weight = (p.tails + 1.0) / (p.tails + (left / scale) ** 2) / scale**2 * used[:, None]
        H, g = precision.copy(), precision @ (start - theta)
        for j in range(n):
            weighted = X[:, j] * weight[:, j, None]
            H += weighted.T @ X[:, j]
            g += weighted.T @ left[:, j]
        step = np.linalg.solve(H, g)
        # no farther than the linearisation of the friction's shape is good for
        shape = (step / priors)[: OWN * n].reshape(n, OWN)[:, 2:4]
        step = step / max(float(np.abs(shape).max()) / _REACH, 1.0)
        theta = theta + step
        sure = np.linalg.inv(H)[-1, -1] ** 0.5 < 0.05 * abs(theta[-1])
        new = theta[-1] / (1.0 - theta[-1] * usual.period_s) if kicks and sure and theta[-1] > 0.0 else gain
        if abs(new - gain) > 0.001 * gain:
            carried = carried_late(found, columns, new)
        done, gain = bool(np.all(np.abs(step) < _SETTLED * priors)), new
        if done:
            break
    X, expected = design(found, columns, carried, theta, gain, cycles)
    kicked = theta[-1] * columns.kick
    score = (found.samples.tau - expected - kicked) * weight
    covariance = _sandwich(H, precision, _block_scores(found, X, score, p.block_s))
    errors = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    return Fit(theta, errors, priors, gain, expected, kicked, scale)


def _begin(n: int, usual: Usual, p: IdentifyParams, payload: bool) -> tuple[FloatArray, FloatArray]:
    """Return what is believed before, and its standard deviations."""
    own, spread = np.zeros((n, OWN)), np.zeros((n, OWN))
    own[:, 1] = (1.0 - usual.friction_compensated) * np.array(usual.friction_f1_nm)
    own[:, 2], own[:, 3] = np.log(usual.friction_f2_s_rad), np.array(usual.friction_f3_rad_s)
    spread[:] = (
        p.offset_prior_nm, p.friction_prior_nm, p.steepness_prior, p.asymmetry_prior_rad_s, p.ripple_prior_nm,
        p.ripple_prior_nm,
    )  # fmt: skip
    shared = np.array([p.mass_prior] * n + [p.payload_prior_kg if payload else 1e-6, 1e4])
    start = np.concatenate([own.ravel(), np.zeros(n + 1), [usual.observer_gain_1_s]])
    return start, np.concatenate([spread.ravel(), shared])


def design(
    found: Usable, columns: Columns, carried: FloatArray, theta: FloatArray, gain: float, cycles: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the derivatives (N, n, p) of the residual by all numbers, and what they explain (N, n) [Nm]."""
    count, n = found.samples.q.shape
    own = theta[: OWN * n].reshape(n, OWN)
    shapes = []
    for q, speed in zip(columns.q, columns.speed, strict=True):
        friction = friction_parts(speed, np.exp(own[:, 2]), own[:, 3])
        shapes.append(np.stack([*friction, np.sin(cycles * q), np.cos(cycles * q)], axis=1))
    late = low_passed(found, columns, gain, shapes)
    X = np.zeros((count, n, len(theta)))
    for j in range(n):
        at = OWN * j
        X[:, j, at] = -1.0
        X[:, j, at + 1] = -late[:, 0, j]
        X[:, j, at + 2] = -own[j, 1] * late[:, 1, j]
        X[:, j, at + 3] = -own[j, 1] * late[:, 2, j]
        X[:, j, at + 4], X[:, j, at + 5] = -late[:, 3, j], -late[:, 4, j]
    X[:, :, OWN * n : -1] = carried
    X[:, :, -1] = columns.kick
    linear = theta.copy()
    linear[-1] = 0.0
    own_linear = linear[: OWN * n].reshape(n, OWN)
    own_linear[:, 2:4] = 0.0
    return X, X @ linear


def _block_scores(found: Usable, X: FloatArray, score: FloatArray, block_s: float) -> FloatArray:
    """Scores (B, p) of blocks."""
    time = found.samples.stamp
    block = ((time - time[0]) / block_s).astype(np.int64)
    each = np.einsum("ijp,ij->ip", X, score)
    total = np.zeros((int(block.max()) + 1, X.shape[2]))
    np.add.at(total, block, each)
    return total[np.bincount(block, minlength=len(total)) > 0]


def _sandwich(H: FloatArray, precision: FloatArray, scores: FloatArray) -> FloatArray:
    """Covariance of the numbers, with the usual correction for the number of blocks."""
    blocks = len(scores)
    bread = np.linalg.inv(H)
    centred = scores - scores.mean(axis=0)
    filling = centred.T @ centred * blocks / max(blocks - 1, 1) + precision
    return np.asarray(bread @ filling @ bread)
