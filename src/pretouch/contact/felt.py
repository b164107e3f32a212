"""The sequential detector: torques less their learnt mean, held against contacts of each link, in one compiled call."""

import math

import numpy as np

from pretouch.compiled import compiled
from pretouch.contact.cues import Cues
from pretouch.contact.fixed import force_map_into
from pretouch.contact.hypotheses import write_hypotheses
from pretouch.contact.lasting_load import find_lasting, learn_lasting, stands_out, still_explains, weight_part
from pretouch.contact.proximity_prior import MOST
from pretouch.contact.residual_model import (
    BLOCK,
    QUEUE,
    ResidualModel,
    add_sample,
    features_into,
    learn_block,
    mean_and_doubt,
    prior_of,
    residual_init,
    spread_of_sample,
)
from pretouch.contact.sequential import LENGTHS, LONGEST, alarm_level, judge, window_means
from pretouch.contact.turning import learn_turning, turning_doubt, turning_init
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
    lasting: FloatArray
    """(3 + n,) load or step of a joint's torque that explains a residual that stays, see `find_lasting`."""
    steady: int
    """Samples that it has explained with nothing near, the arm reacting or a contact suspected."""
    turning: FloatArray
    """(3, n) how much worse free motion is known where the arm accelerates hard, see `turning_init`."""


@value
class Felt:
    """What one sample says."""

    residual: FloatArray
    """(n,) torques less their mean [Nm]."""
    means: FloatArray
    """(6, n) means of the newest residuals, of each of `sequential.LENGTHS` [Nm]."""
    spread: FloatArray
    """(n, n) of one of them, with the doubt on its diagonal [Nm^2]."""
    doubt: FloatArray
    """(n,) variance of the error of the mean of free motion, which does not average out [Nm^2]."""
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
    lasting: bool
    """Whether it is being found out if what is felt is a load or a step of an estimate."""


def sequential_init(model: RobotModel, p: DetectionParams, learnt: ResidualModel | None = None) -> SequentialState:
    """Return the state before the first sample; `learnt` is what an earlier session knew of the arm."""
    known = residual_init(model.n, p) if learnt is None else learnt
    return SequentialState(
        known, np.zeros((LONGEST, model.n)), 0, 0, 0, 0, np.zeros(3 + model.n), 0, turning_init(model.n)
    )


def take_sample(
    state: SequentialState, model: RobotModel, kin: Kinematics, robot: RobotState, obstacles: Obstacles,
    reacting: bool, watched: bool, period: float, p: DetectionParams, cues: Cues,
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
        cues: what units say of a touch.
    """
    m, o, n = state.model, obstacles, model.n
    residual, speed, force, bands = np.empty(n), np.empty(n), np.empty(3), np.empty((6, 3))
    means, S, doubt = np.zeros((len(LENGTHS), n)), np.empty((n, n)), np.empty(n)
    ring, block, queue, prior = state.ring.copy(), m.block.copy(), m.queue, _NONE
    weights, covariance, spread, seen = m.weights, m.covariance, m.spread, m.seen
    settle = round(p.relearn_after_s / period) if p.learn else 0
    if m.filled + 1 == BLOCK or 0 < settle <= state.steady:  # in no other step are they written to
        queue = queue.copy()
        if m.waiting == QUEUE or 0 < settle <= state.steady:
            prior = prior_of(n, p)
            weights, covariance, spread, seen = weights.copy(), covariance.copy(), spread.copy(), seen.copy()
    lasting, turning = state.lasting.copy(), state.turning.copy()
    may = p.learn and (watched or p.learn_unseen)
    evidence, calm, filled, waiting, steady = _take(
        kin.anchor, kin.axis, kin.position, kin.rotation,
        model.moved_by, model.mass, model.com, model.inertia, model.parts, model.middle, model.ee,
        robot.qd, robot.qd_commanded, robot.tau_ext, m.speed,
        o.link, o.body_point, o.direction, o.body_distance, o.closing_speed,
        ring, state.at, min(state.count + 1, LONGEST), state.calm, block, m.filled, queue, m.waiting,
        weights, covariance, spread, seen, prior, lasting, state.steady, settle, turning,
        math.exp(-p.observer_gain_1_s * period), may, p.inertia, p.widen_at_turns, reacting, p.offset_prior_nm,
        alarm_level(p, period), period, p.use_proximity, p.contact_gain, p.tails,
        cues.gain,
        p.near_gain, p.near_m, p.near_horizon_s, p.clear_m, p.suspect, p.noise_floor_nm, p.bias_floor_nm, p.still_rad_s,
        p.memory_s, p.spread_memory_s, (_CEILING * p.velocity_prior_rad_s2) ** 2, (_CEILING * p.torque_prior_nm) ** 2,
        residual, speed, force, bands, means, S, doubt,
    )  # fmt: skip
    at, count = (state.at + 1) % LONGEST, min(state.count + 1, LONGEST)
    if steady < 0:  # learnt: what was felt before is no contact
        felt = Felt(residual, means, S, doubt, 0.0, np.zeros(3), bands, False, True, False)
        after = ResidualModel(weights, covariance, spread, seen, speed, queue, block, 0, 0)
        return felt, SequentialState(after, ring, at, 0, 0, 0, lasting, 0, turning)
    confirmed = state.confirmed + 1 if evidence >= 1.0 else 0
    felt = Felt(
        residual, means, S, doubt, evidence, force, bands, confirmed >= p.confirm_samples, calm == _CALM, steady > 0
    )
    after = ResidualModel(weights, covariance, spread, seen, speed, queue, block, filled, waiting)
    return felt, SequentialState(after, ring, at, count, calm, confirmed, lasting, steady, turning)


_NONE = np.zeros(0)


@compiled
def _take(
    anchor: FloatArray, axis: FloatArray, position: FloatArray, rotation: FloatArray,
    moved_by: BoolArray, mass: FloatArray, com: FloatArray, inertia: FloatArray, parts: IntArray, middle: FloatArray,
    ee: int, qd: FloatArray, qd_commanded: FloatArray, torque: FloatArray, speed_before: FloatArray,
    link: IntArray, body_point: FloatArray, direction: FloatArray, distance: FloatArray, closing: FloatArray,
    ring: FloatArray, at: int, count: int, calm: int, block: FloatArray, filled: int, queue: FloatArray, waiting: int,
    weights: FloatArray, covariance: FloatArray, spread: FloatArray, seen: FloatArray, prior: FloatArray,
    lasting: FloatArray, steady: int, settle: int, turning: FloatArray,
    late: float, may: bool, inertial: bool, widened: bool, reacting: bool, offset_prior: float,
    level: float, period: float, use_proximity: bool, gain: float, tails: float,
    touch_gain: FloatArray,
    near_gain: float, near: float, horizon: float, clear: float, suspect: float, floor: float, bias_floor: float,
    still: float, memory: float, spread_memory: float, most_velocity: float, most_torque: float,
    residual: FloatArray, speed: FloatArray, force: FloatArray, bands: FloatArray,
    means: FloatArray, S: FloatArray, doubt: FloatArray,
) -> tuple[float, int, int, int, int]:  # fmt: skip
    """Write the last two lines of arguments and what is learnt; return evidence, calm samples, and what waits."""
    n, growth = len(qd), np.empty(len(qd))
    moving = _velocities(qd_commanded, speed_before, late, period, still, speed, growth)
    x, mean = np.empty((n, weights.shape[1])), np.empty(n)
    M, J_ee = np.empty((n, n)), np.empty((6, n))
    features_into(
        anchor, axis, position, rotation, moved_by, mass, com, ee, speed, growth if inertial else np.zeros(n), x
    )
    mean_and_doubt(weights, covariance, x, mean, doubt)
    mass_matrix_into(anchor, axis, position, rotation, moved_by, mass, com, inertia, M)
    spread_of_sample(M, spread[moving], floor, S)
    for j in range(n):
        doubt[j] += bias_floor**2
        residual[j] = torque[j] - mean[j]
        ring[at, j] = residual[j]
    if widened:
        turning_doubt(M, growth, turning, doubt)

    whole = window_means(ring, (at + 1) % LONGEST, count, means)
    most = len(parts) + (min(MOST, len(distance)) if use_proximity else 0)
    J, joints, weight = np.empty((most, 3, n)), np.empty(most, np.int64), np.empty(n + most)
    away = np.zeros((most, 3))
    write_hypotheses(
        anchor, axis, position, rotation, moved_by, parts, middle, qd, link, body_point, direction, distance, closing,
        touch_gain, near_gain, near, horizon, J, joints, weight, away,
    )  # fmt: skip
    log_r, window, which = judge(means, whole, S, doubt, J, joints, weight, away, gain, tails)
    evidence = max(0.0, log_r / level)

    alone = may and distance.min() >= clear if len(distance) else may
    jacobian_into(anchor, axis, moved_by[ee], position[ee], J_ee)
    calm = 0 if evidence >= suspect or reacting or not alone else min(calm + 1, _CALM)
    if widened and alone and not reacting and whole == len(LENGTHS):
        learn_turning(at, means, S, doubt, period / memory, turning)
    if calm < _CALM:
        filled, waiting = 0, 0
    else:
        add_sample(block, filled == 0, torque, x, residual, M, spread[moving], doubt, moving, tails, floor)
        filled, waiting = _learn_calm(
            block, filled + 1, queue, waiting, weights, covariance, spread, seen, prior, period, memory, spread_memory,
            most_velocity, most_torque,
        )  # fmt: skip
    suspected = evidence >= suspect
    if settle and alone and whole == len(LENGTHS) and calm < _CALM and (steady or suspected or reacting):
        steady = _still_there(
            lasting, steady, settle, suspected, reacting, means[-1], x, J_ee, S, weights, covariance, prior,
            offset_prior, moving,
        )  # fmt: skip
    else:
        steady = 0
    for j in range(n):
        S[j, j] += doubt[j]
    _write_force(
        J_ee, means[window], mean, S, away[max(which - n, 0)] if which >= n else np.zeros(3), math.sqrt(2.0 * level),
        force, bands,
    )  # fmt: skip
    return evidence, calm, filled, waiting, steady


@compiled
def _velocities(
    commanded: FloatArray, before: FloatArray, late: float, period: float, still: float, speed: FloatArray,
    growth: FloatArray,
) -> int:  # fmt: skip
    """Write the commanded velocities as late as the torques are, and their growth; return 1 if the arm moves, or 0."""
    moving = 0
    for j in range(len(commanded)):
        speed[j] = late * before[j] + (1.0 - late) * commanded[j]
        growth[j] = (speed[j] - before[j]) / period
        if abs(speed[j]) > still:
            moving = 1
    return moving


@compiled
def _learn_calm(
    block: FloatArray, filled: int, queue: FloatArray, waiting: int, weights: FloatArray, covariance: FloatArray,
    spread: FloatArray, seen: FloatArray, prior: FloatArray, period: float, memory: float, spread_memory: float,
    most_velocity: float, most_torque: float,
) -> tuple[int, int]:  # fmt: skip
    """Let a block that is full wait, and learn the one that has waited longest; return what waits now."""
    if filled < BLOCK:
        return filled, waiting
    if waiting < QUEUE:
        queue[waiting] = block
        return 0, waiting + 1
    learn_block(
        queue[0], weights, covariance, spread, seen, prior, BLOCK * period / memory, BLOCK * period / spread_memory,
        _FIRST_S / period, most_velocity, most_torque,
    )  # fmt: skip
    queue[:-1] = queue[1:].copy()
    queue[-1] = block
    return 0, waiting


@compiled
def _still_there(
    lasting: FloatArray, steady: int, settle: int, suspected: bool, reacting: bool, residual: FloatArray, x: FloatArray,
    J: FloatArray, S: FloatArray, weights: FloatArray, covariance: FloatArray, prior: FloatArray, offset_prior: float,
    moving: int,
) -> int:  # fmt: skip
    """Return for how many samples that count the same load or step has explained the residual; -1: it was learnt.

    Samples count in which a contact is suspected or the arm reacts, but only what stands out is something to find out.
    """
    n = len(residual)
    learnt, offset, unit = np.empty(n), np.empty(n), np.empty(n)
    weight_part(weights, x, learnt, offset, unit)
    counts = suspected or reacting
    if steady and still_explains(lasting, residual, unit, J, S, LONGEST, moving):
        steady += int(counts)
    else:
        steady, counts = 0, suspected or (reacting and stands_out(residual, S, LONGEST))
    if counts and (steady == 0 or steady > settle):
        now = np.empty(3 + n)
        if not find_lasting(residual, learnt, offset, unit, J, S, LONGEST, offset_prior, now):
            return steady if steady <= 2 * settle else 0
        if steady > settle:
            learn_lasting(now, residual, x, S, LONGEST, offset_prior**2, weights, covariance, prior)
            return -1
        lasting[:] = now
        steady = 1
    return steady


@compiled
def _write_force(
    J: FloatArray, torque: FloatArray, mean: FloatArray, S: FloatArray, away: FloatArray, wide: float,
    force: FloatArray, bands: FloatArray,
) -> None:  # fmt: skip
    """Write force and bands of `Felt`, of torques (n,) and of the mean and spread in free motion."""
    n = len(torque)
    W = np.empty((3, n))
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
