"""The sequential detector: torques less their learnt mean, held against contacts of each link, in one compiled call."""

import math

import numpy as np

from pretouch.compiled import compiled
from pretouch.contact.fixed import force_map_into
from pretouch.contact.hypotheses import write_hypotheses
from pretouch.contact.lasting_load import MOST_KG, is_load, still_constant
from pretouch.contact.proximity_prior import MOST
from pretouch.contact.residual_model import (
    BLOCK,
    QUEUE,
    ResidualModel,
    add_sample,
    features_into,
    learn_block,
    least_squares_step,
    mean_and_doubt,
    prior_of,
    residual_init,
    spread_of_sample,
)
from pretouch.contact.sequential import LENGTHS, LONGEST, alarm_level, judge, window_means
from pretouch.params import DetectionParams
from pretouch.robot.mass_matrix import mass_matrix_into
from pretouch.robot.model import Kinematics, RobotModel, jacobian_into
from pretouch.types import BoolArray, FloatArray, IntArray, Obstacles, RobotState
from pretouch.values import value

_FIRST_S = 2.0
"""Time that the prior of the spread counts for [s]."""
_CEILING = 4.0
"""Times the prior that the spread's standard deviations may grow to."""
_CALM = BLOCK * QUEUE
"""Calm samples after which one is learnt."""


@value
class SequentialState:
    """All that the sequential detector remembers."""

    model: ResidualModel
    ring: FloatArray
    """(32, n) newest residuals [Nm]."""
    at: int
    """Where the next one goes."""
    count: int
    """How many there are."""
    calm: int
    """Samples since a contact was suspected, something was near, or the arm reacted."""
    confirmed: int
    """Samples in a row with the evidence of a contact."""
    held: FloatArray
    """(n,) mean residual that has lasted [Nm]."""
    steady: int
    """Samples for which it has, while the arm stood with nothing near."""


@value
class Felt:
    """What one sample says."""

    residual: FloatArray
    """(n,) torques less their mean [Nm]."""
    evidence: float
    """ln R / ln A: a contact from 1 on."""
    force: FloatArray
    """(3,) at the end-effector that explains the window that says most best [N]; none of it moves the arm towards a
    seen object if what says most is that this object touches."""
    bands: FloatArray
    """(6, 3) bands of the force that say the same of one sample, the parts of `Thresholds` [N]."""
    sure: bool
    """Whether it is a contact."""
    learning: bool
    """Whether the sample is to be learnt as free motion."""


def sequential_init(model: RobotModel, p: DetectionParams, learnt: ResidualModel | None = None) -> SequentialState:
    """Return the state before the first sample; `learnt` is what an earlier session knew of the arm."""
    known = residual_init(model.n, p) if learnt is None else learnt
    return SequentialState(known, np.zeros((LONGEST, model.n)), 0, 0, 0, 0, np.zeros(model.n), 0)


def take_sample(
    state: SequentialState, model: RobotModel, kin: Kinematics, robot: RobotState, obstacles: Obstacles,
    reacting: bool, watched: bool, period: float, p: DetectionParams,
) -> tuple[Felt, SequentialState]:  # fmt: skip
    """Hold one sample of the external torques against free motion, and learn from it if nothing can be a contact.

    Args:
        state: memory.
        model: the arm.
        kin: its posture.
        robot: its state; the torques must be numbers.
        obstacles: what is near.
        reacting: whether the arm moves with a contact.
        watched: whether a skin watches, all of it heard.
        period: of control [s].
        p: parameters.
    """
    m, o, n = state.model, obstacles, model.n
    residual, speed, force, bands = np.empty(n), np.empty(n), np.empty(3), np.empty((6, 3))
    ring, block, queue, prior = state.ring.copy(), m.block.copy(), m.queue, _NONE
    weights, covariance, spread, seen = m.weights, m.covariance, m.spread, m.seen
    settle = round(p.relearn_after_s / period) if p.learn else 0
    if m.filled + 1 == BLOCK or 0 < settle <= state.steady:  # in no other step are they written to
        queue = queue.copy()
        if m.waiting == QUEUE or 0 < settle <= state.steady:
            prior = prior_of(n, p)
            weights, covariance, spread, seen = weights.copy(), covariance.copy(), spread.copy(), seen.copy()
    held, late = state.held.copy(), math.exp(-p.observer_gain_1_s * period)
    may = p.learn and (watched or p.learn_unseen)
    evidence, calm, filled, waiting, steady = _take(
        kin.anchor, kin.axis, kin.position, kin.rotation,
        model.moved_by, model.mass, model.com, model.inertia, model.parts, model.middle, model.ee,
        robot.qd, robot.qd_commanded, robot.tau_ext, m.speed,
        o.link, o.body_point, o.direction, o.body_distance, o.closing_speed,
        ring, state.at, min(state.count + 1, LONGEST), state.calm, block, m.filled, queue, m.waiting,
        weights, covariance, spread, seen, prior,
        late, may, p.inertia, reacting, held, state.steady, settle, p.offset_prior_nm**2,
        alarm_level(p, period), period, p.use_proximity, p.contact_gain, p.tails,
        p.near_gain, p.near_m, p.near_horizon_s, p.clear_m, p.suspect, p.noise_floor_nm, p.bias_floor_nm, p.still_rad_s,
        p.memory_s, p.spread_memory_s, (_CEILING * p.velocity_prior_rad_s2) ** 2, (_CEILING * p.torque_prior_nm) ** 2,
        residual, speed, force, bands,
    )  # fmt: skip
    if steady < 0:  # learnt: what was felt before is no contact
        felt = Felt(residual, 0.0, np.zeros(3), bands, False, True)
        after = ResidualModel(weights, covariance, spread, seen, speed, queue, block, 0, 0)
        return felt, SequentialState(after, ring, state.at, 0, 0, 0, held, 0)
    confirmed = state.confirmed + 1 if evidence >= 1.0 else 0
    felt = Felt(residual, evidence, force, bands, confirmed >= p.confirm_samples, calm == _CALM)
    after = ResidualModel(weights, covariance, spread, seen, speed, queue, block, filled, waiting)
    at, count = (state.at + 1) % LONGEST, min(state.count + 1, LONGEST)
    return felt, SequentialState(after, ring, at, count, calm, confirmed, held, steady)


_NONE = np.zeros(0)


@compiled
def _take(
    anchor: FloatArray, axis: FloatArray, position: FloatArray, rotation: FloatArray,
    moved_by: BoolArray, mass: FloatArray, com: FloatArray, inertia: FloatArray, parts: IntArray, middle: FloatArray,
    ee: int, qd: FloatArray, qd_commanded: FloatArray, torque: FloatArray, speed_before: FloatArray,
    link: IntArray, body_point: FloatArray, direction: FloatArray, distance: FloatArray, closing: FloatArray,
    ring: FloatArray, at: int, count: int, calm: int, block: FloatArray, filled: int, queue: FloatArray, waiting: int,
    weights: FloatArray, covariance: FloatArray, spread: FloatArray, seen: FloatArray, prior: FloatArray,
    late: float, may: bool, inertial: bool, reacting: bool, held: FloatArray, steady: int, settle: int, widen: float,
    level: float, period: float, use_proximity: bool, gain: float, tails: float,
    near_gain: float, near: float, horizon: float, clear: float, suspect: float, floor: float, bias_floor: float,
    still: float, memory: float, spread_memory: float, most_velocity: float, most_torque: float,
    residual: FloatArray, speed: FloatArray, force: FloatArray, bands: FloatArray,
) -> tuple[float, int, int, int, int]:  # fmt: skip
    """Write the last line of arguments and what is learnt; return evidence, calm samples, and what waits for that."""
    n, growth = len(qd), np.empty(len(qd))
    for j in range(n):
        speed[j] = late * speed_before[j] + (1.0 - late) * qd_commanded[j]
        growth[j] = (speed[j] - speed_before[j]) / period if inertial else 0.0
    x, mean, doubt = np.empty((n, weights.shape[1])), np.empty(n), np.empty(n)
    M, S = np.empty((n, n)), np.empty((n, n))
    features_into(anchor, axis, position, rotation, moved_by, mass, com, ee, speed, growth, x)
    mean_and_doubt(weights, covariance, x, mean, doubt)
    moving = 0
    for j in range(n):
        doubt[j] += bias_floor**2
        residual[j] = torque[j] - mean[j]
        ring[at, j] = residual[j]
        if abs(speed[j]) > still:
            moving = 1
    mass_matrix_into(anchor, axis, position, rotation, moved_by, mass, com, inertia, M)
    spread_of_sample(M, spread[moving], floor, S)

    means = np.zeros((len(LENGTHS), n))
    whole = window_means(ring, (at + 1) % LONGEST, count, means)
    objects = min(MOST, len(distance)) if use_proximity else 0
    most = len(parts) + objects
    J, joints, weight = np.empty((most, 3, n)), np.empty(most, np.int64), np.empty(n + most)
    away = np.zeros((most, 3))
    write_hypotheses(
        anchor, axis, position, rotation, moved_by, parts, middle, qd, link, body_point, direction, distance, closing,
        near_gain, near, horizon, J, joints, weight, away,
    )  # fmt: skip
    log_r, window, which = judge(means, whole, S, doubt, J, joints, weight, away, gain, tails)
    evidence = max(0.0, log_r / level)

    is_near = False
    for d in distance:
        is_near = is_near or d < clear
    calm = 0 if evidence >= suspect or is_near or reacting or not may else min(calm + 1, _CALM)
    if calm < _CALM:
        filled, waiting = 0, 0
    else:
        if filled == 0:
            block[:] = 0.0
        add_sample(block, torque, x, residual, M, spread[moving], doubt, moving, tails, floor)
        filled += 1
        if filled == BLOCK:
            filled = 0
            if waiting < QUEUE:
                queue[waiting] = block
                waiting += 1
            else:
                learn_block(
                    queue[0], weights, covariance, spread, seen, prior, BLOCK * period / memory,
                    BLOCK * period / spread_memory, _FIRST_S / period, most_velocity, most_torque,
                )  # fmt: skip
                queue[:-1] = queue[1:].copy()
                queue[-1] = block
    steady = steady + 1 if settle and may and not is_near and not moving and whole == len(LENGTHS) else 0
    if steady and (steady == 1 or not still_constant(means[-1], held, S, LONGEST)):
        held[:], steady = means[-1], 1
    if steady > settle and evidence >= suspect:
        steady = 0
        if _learn_load(anchor, axis, moved_by[ee], position[ee], means[-1], x, S, weights, covariance, prior, widen):
            steady = -1
    for j in range(n):
        S[j, j] += doubt[j]
    _write_force(
        anchor, axis, moved_by[ee], position[ee], means[window], mean, S, away[max(which - n, 0)] if which >= n else
        np.zeros(3), math.sqrt(2.0 * level), force, bands,
    )  # fmt: skip
    return evidence, calm, filled, waiting, steady


@compiled
def _learn_load(
    anchor: FloatArray, axis: FloatArray, moved: BoolArray, point: FloatArray, residual: FloatArray, x: FloatArray,
    S: FloatArray, weights: FloatArray, covariance: FloatArray, prior: FloatArray, widen: float,
) -> bool:  # fmt: skip
    """Learn a lasting residual (n,) at once if it can be a load, and return whether it can."""
    n, load = x.shape[0], x.shape[1] - 1
    J, known, unit = np.empty((6, n)), np.empty(n), np.empty(n)
    jacobian_into(anchor, axis, moved, point, J)
    for j in range(n):
        unit[j] = x[j, load]
        known[j] = weights[j, load] * unit[j]
    if not is_load(residual, known, unit, J, S, LONGEST):
        return False
    for j in range(n):
        torque = residual[j]
        for a in range(load + 1):
            torque += weights[j, a] * x[j, a]
        covariance[j, 0, 0] += widen
        covariance[j, load, load] += MOST_KG**2
        least_squares_step(weights[j], covariance[j], x[j], torque, S[j, j] / LONGEST, prior, 0.0)
    return True


@compiled
def _write_force(
    anchor: FloatArray, axis: FloatArray, moved: BoolArray, point: FloatArray, torque: FloatArray, mean: FloatArray,
    S: FloatArray, away: FloatArray, wide: float, force: FloatArray, bands: FloatArray,
) -> None:  # fmt: skip
    """Write force and bands of `Felt`, of torques (n,) and of the mean and spread in free motion."""
    n = len(torque)
    J, W = np.empty((6, n)), np.empty((3, n))
    jacobian_into(anchor, axis, moved, point, J)
    force_map_into(J, W)
    against = 0.0
    for i in range(3):
        force[i], usual, variance = 0.0, 0.0, 0.0
        for j in range(n):
            force[i] += W[i, j] * torque[j]
            usual += W[i, j] * mean[j]
            for k in range(n):
                variance += W[i, j] * S[j, k] * W[i, k]
        sigma = math.sqrt(variance)
        bands[0, i], bands[1, i], bands[2, i] = usual + sigma * wide, usual - sigma * wide, usual
        bands[3, i], bands[4, i], bands[5, i] = sigma, 0.0, 0.0
        against += force[i] * away[i]
    if against < 0.0:
        for i in range(3):
            force[i] -= against * away[i]
