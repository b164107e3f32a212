"""The sequential detector: torques less their learnt mean, held against contacts of each link, in one compiled call."""

import math
from typing import NamedTuple

import numpy as np

from pretouch.compiled import compiled, entry
from pretouch.contact.cues import Cues
from pretouch.contact.force_map import force_map_into
from pretouch.contact.hypotheses import NearPrior, write_hypotheses
from pretouch.contact.lasting_load import (
    WeightPart,
    find_lasting,
    learn_lasting,
    stands_out,
    still_explains,
    weight_part,
)
from pretouch.contact.proximity_prior import MOST
from pretouch.contact.residual_model import (
    BLOCK,
    QUEUE,
    CalmSample,
    Learnt,
    Pace,
    ResidualModel,
    add_sample,
    features_into,
    learn_block,
    mean_and_doubt,
    prior_of,
    residual_init,
    spread_of_sample,
)
from pretouch.contact.sequential import LENGTHS, LONGEST, Hypotheses, alarm_level, judge, window_means
from pretouch.contact.turning import learn_turning, turning_doubt, turning_init
from pretouch.groups import Mechanism, ObstacleArrays
from pretouch.params import ProximityPriorParams, SequentialParams
from pretouch.robot.mass_matrix import mass_matrix_into
from pretouch.robot.model import Kinematics, RobotModel, jacobian_into
from pretouch.types import FloatArray, Obstacles, RobotState
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


def sequential_init(model: RobotModel, p: SequentialParams, learnt: ResidualModel | None = None) -> SequentialState:
    """Return the state before the first sample; `learnt` is what an earlier session knew of the arm."""
    known = residual_init(model.n, p) if learnt is None else learnt
    return SequentialState(
        known, np.zeros((LONGEST, model.n)), 0, 0, 0, 0, np.zeros(3 + model.n), 0, turning_init(model.n)
    )


def take_sample(
    state: SequentialState, model: RobotModel, kin: Kinematics, robot: RobotState,
    obstacles: Obstacles | ObstacleArrays, reacting: bool, watched: bool, period: float, p: SequentialParams,
    cues: Cues,
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
    m, n = state.model, model.n
    residual, speed, force, bands = np.empty(n), np.empty(n), np.empty(3), np.empty((6, 3))
    means, S, doubt = np.zeros((len(LENGTHS), n)), np.empty((n, n)), np.empty(n)
    ring, block, queue, prior = state.ring.copy(), m.block.copy(), m.queue, _NONE
    weights, covariance, spread, seen = m.weights, m.covariance, m.spread, m.seen
    settle = round(p.relearn_after_s / period) if p.learn != "never" else 0
    if m.filled + 1 == BLOCK or 0 < settle <= state.steady:  # in no other step are they written to
        queue = queue.copy()
        if m.waiting == QUEUE or 0 < settle <= state.steady:
            prior = prior_of(n, p)
            weights, covariance, spread, seen = weights.copy(), covariance.copy(), spread.copy(), seen.copy()
    lasting, turning = state.lasting.copy(), state.turning.copy()
    may, nearness = p.learn == "always" or (watched and p.learn == "watched"), p.proximity or _NO_PROXIMITY
    o = obstacles
    evidence, calm, filled, waiting, steady = _take.flat(
        robot.qd, robot.qd_commanded, robot.tau_ext,
        o.unit, o.link, o.body_point, o.direction, o.body_distance, o.closing_speed,
        weights, covariance, spread, seen, prior,
        block, m.filled, queue, m.waiting,
        ring, state.at, min(state.count + 1, LONGEST), state.calm, lasting, state.steady, turning, m.speed,
        math.exp(-p.observer_gain_1_s * period), period, settle, alarm_level(p, period), may, reacting,
        (_CEILING * p.velocity_prior_rad_s2) ** 2, (_CEILING * p.torque_prior_nm) ** 2, cues.gain,
        p.inertia, p.widen_at_turns, p.offset_prior_nm, p.proximity is not None, p.contact_gain, p.tails, nearness.gain,
        nearness.distance_m, nearness.horizon_s, p.clear_m, p.suspect, p.noise_floor_nm, p.bias_floor_nm,
        p.still_rad_s, p.memory_s, p.spread_memory_s,
        residual, speed, force, bands, means, S, doubt, *kin, *model.mechanism_fields,
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
_NO_PROXIMITY = ProximityPriorParams(gain=1.0)


class _Blocks(NamedTuple):
    """Blocks of samples that wait to be learnt, as of `ResidualModel`."""

    block: FloatArray
    filled: int
    queue: FloatArray
    waiting: int


class _Recent(NamedTuple):
    """The newest samples and what they leave, as of `SequentialState`."""

    ring: FloatArray
    at: int
    held: int
    calm: int
    lasting: FloatArray
    steady: int
    turning: FloatArray
    speed: FloatArray
    """(n,) commanded joint velocities as late as the torques, of the sample before [rad/s]."""


class _Memory(NamedTuple):
    """All that is remembered, and changed."""

    learnt: Learnt
    blocks: _Blocks
    recent: _Recent


class _Now(NamedTuple):
    """What else there is to say of one sample."""

    late: float
    """Part of the commanded velocities of the sample before that the torques still show."""
    period: float
    """Of control [s]."""
    settle: int
    """Samples after which what lasts is learnt, 0 for never."""
    level: float
    """ln A of the test."""
    may: bool
    """Whether free motion may be learnt."""
    reacting: bool
    """Whether the arm moves with a contact."""
    most_velocity: float
    """Largest variance A [(rad/s^2)^2]."""
    most_torque: float
    """Largest variance D [Nm^2]."""
    touch_gain: FloatArray
    """(L,) times a contact on each link is likelier than without what units say."""


class _Params(NamedTuple):
    """What is taken of `SequentialParams`."""

    inertia: bool
    widen_at_turns: bool
    offset_prior_nm: float
    use_proximity: bool
    contact_gain: float
    tails: float
    near_gain: float
    near_m: float
    near_horizon_s: float
    clear_m: float
    suspect: float
    noise_floor_nm: float
    bias_floor_nm: float
    still_rad_s: float
    memory_s: float
    spread_memory_s: float


class _Robot(NamedTuple):
    """What is taken of `RobotState`."""

    qd: FloatArray
    qd_commanded: FloatArray
    tau_ext: FloatArray


class _Room(NamedTuple):
    """Room for what a sample says, as of `Felt`, and for the velocities as late as the torques."""

    residual: FloatArray
    speed: FloatArray
    force: FloatArray
    bands: FloatArray
    means: FloatArray
    spread: FloatArray
    doubt: FloatArray


@entry
def _take(
    robot: _Robot, obstacles: ObstacleArrays, memory: _Memory, now: _Now, p: _Params, room: _Room, kin: Kinematics,
    mechanism: Mechanism,
) -> tuple[float, int, int, int, int]:  # fmt: skip
    """Write what a sample says, and what is learnt; return evidence, calm samples, and what waits."""
    learnt, blocks, recent = memory
    arm, S, doubt = mechanism.arm, room.spread, room.doubt
    speed, means, at, n = room.speed, room.means, recent.at, len(robot.qd)
    growth = np.empty(n)
    moving = _velocities(robot.qd_commanded, recent.speed, now.late, now.period, p.still_rad_s, speed, growth)

    # the mean of free motion, and how well it is known
    x, mean, M = np.empty((n, learnt.weights.shape[1])), np.empty(n), np.empty((n, n))
    features_into(kin, mechanism, speed, growth if p.inertia else np.zeros(n), x)
    mean_and_doubt(learnt.weights, learnt.covariance, x, mean, doubt)
    mass_matrix_into(kin, mechanism, M)
    spread_of_sample(M, learnt.spread[moving], p.noise_floor_nm, S)
    for j in range(n):
        doubt[j] += p.bias_floor_nm**2
        room.residual[j] = robot.tau_ext[j] - mean[j]
        recent.ring[at, j] = room.residual[j]
    if p.widen_at_turns:
        turning_doubt(M, growth, recent.turning, doubt)

    # the test against contacts
    whole = window_means(recent.ring, (at + 1) % LONGEST, recent.held, means)
    distance = obstacles.body_distance
    most = len(mechanism.links.parts) + (min(MOST, len(distance)) if p.use_proximity else 0)
    contacts = Hypotheses(np.empty((most, 3, n)), np.empty(most, np.int64), np.empty(n + most), np.zeros((most, 3)))
    near = NearPrior(p.near_gain, p.near_m, p.near_horizon_s)
    write_hypotheses(kin, mechanism, robot.qd, obstacles, now.touch_gain, near, contacts)
    log_r, window, which = judge(means, whole, S, doubt, contacts, p.contact_gain, p.tails)
    evidence = max(0.0, log_r / now.level)

    # what is learnt
    alone = now.may and distance.min() >= p.clear_m if len(distance) else now.may
    J_ee = np.empty((6, n))
    jacobian_into(kin.anchor, kin.axis, arm.moved_by[arm.ee], kin.position[arm.ee], J_ee)
    suspected = evidence >= p.suspect
    calm = 0 if suspected or now.reacting or not alone else min(recent.calm + 1, _CALM)
    if p.widen_at_turns and alone and not now.reacting and whole == len(LENGTHS):
        learn_turning(at, means, S, doubt, now.period / p.memory_s, recent.turning)
    filled, waiting = 0, 0
    if calm >= _CALM:
        sample = CalmSample(robot.tau_ext, x, room.residual, M, doubt, moving)
        add_sample(blocks.block, blocks.filled == 0, sample, learnt.spread[moving], p.tails, p.noise_floor_nm)
        pace = Pace(
            BLOCK * now.period / p.memory_s, BLOCK * now.period / p.spread_memory_s, _FIRST_S / now.period,
            now.most_velocity, now.most_torque,
        )  # fmt: skip
        filled, waiting = _learn_calm(blocks, blocks.filled + 1, learnt, pace)
    steady = 0
    something = recent.steady > 0 or suspected or now.reacting
    if now.settle > 0 and alone and whole == len(LENGTHS) and calm < _CALM and something:
        found = _Standing(means[-1], x, J_ee, S, moving)
        steady = _still_there(recent, now.settle, suspected, now.reacting, found, learnt, p.offset_prior_nm)

    for j in range(n):
        S[j, j] += doubt[j]
    away = contacts.away[max(which - n, 0)] if which >= n else np.zeros(3)
    _write_force(J_ee, means[window], mean, S, away, math.sqrt(2.0 * now.level), room.force, room.bands)
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
def _learn_calm(blocks: _Blocks, filled: int, learnt: Learnt, pace: Pace) -> tuple[int, int]:
    """Let a block that is full wait, and learn the one that has waited longest; return what waits now."""
    queue, waiting = blocks.queue, blocks.waiting
    if filled < BLOCK:
        return filled, waiting
    if waiting < QUEUE:
        queue[waiting] = blocks.block
        return 0, waiting + 1
    learn_block(queue[0], learnt, pace)
    queue[:-1] = queue[1:].copy()
    queue[-1] = blocks.block
    return 0, waiting


class _Standing(NamedTuple):
    """What is left of the torques over the longest window, and in which posture."""

    residual: FloatArray
    """(n,) mean [Nm]."""
    x: FloatArray
    """(n, f) features."""
    J: FloatArray
    """(6, n) Jacobian of the end-effector."""
    S: FloatArray
    """(n, n) spread of a sample [Nm^2]."""
    moving: int
    """1 if the arm moves, or 0."""


@compiled
def _still_there(
    recent: _Recent, settle: int, suspected: bool, reacting: bool, found: _Standing, known: Learnt, offset_prior: float
) -> int:
    """Return for how many samples that count the same load or step has explained the residual; -1: it was learnt.

    Samples count in which a contact is suspected or the arm reacts, but only what stands out is something to find out.
    """
    lasting, steady = recent.lasting, recent.steady
    residual, x, J, S, moving = found
    n = len(residual)
    weight = WeightPart(np.empty(n), np.empty(n), np.empty(n))
    weight_part(known.weights, x, weight)
    counts = suspected or reacting
    if steady and still_explains(lasting, residual, weight.unit, J, S, LONGEST, moving):
        steady += int(counts)
    else:
        steady, counts = 0, suspected or (reacting and stands_out(residual, S, LONGEST))
    if counts and (steady == 0 or steady > settle):
        now = np.empty(3 + n)
        if not find_lasting(residual, weight, J, S, LONGEST, offset_prior, now):
            return steady if steady <= 2 * settle else 0
        if steady > settle:
            learn_lasting(now, residual, x, S, LONGEST, offset_prior**2, known)
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
