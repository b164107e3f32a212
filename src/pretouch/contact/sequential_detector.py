"""The sequential detector: external torques less their learnt mean, tested against contacts of each link."""

import math
from typing import NamedTuple

import numpy as np

from pretouch.contact.alarm_level import level_init
from pretouch.contact.model_update import CALM
from pretouch.contact.residual_model import BLOCK, QUEUE, ResidualModel, prior_of, residual_init
from pretouch.contact.scatter import LENGTHS, LONGEST, learns_scatter, scatter_init, turning_init
from pretouch.contact.sequential import alarm_bound
from pretouch.contact.sequential_step import detect_contact
from pretouch.contact.touch_cue import Cues
from pretouch.groups import Kinematics, ObstacleArrays
from pretouch.params import MisfitParams, ProximityPriorParams, SequentialParams
from pretouch.robot.model import RobotModel
from pretouch.types import FloatArray, Obstacles, RobotState
from pretouch.values import value

_CEILING = 4.0
"""Times the prior that the noise's standard deviations may grow to."""
_NONE = np.zeros(0)
_NO_PROXIMITY = ProximityPriorParams(gain=1.0)
_NO_MISFIT = MisfitParams()


@value
class SequentialState:
    """All that the sequential detector remembers. Recordings keep these names."""

    model: ResidualModel
    ring: FloatArray
    """(32, n) newest residuals [Nm]."""
    at: int
    """Where the next one goes."""
    count: int
    """How many there are."""
    calm: int
    """Samples since a contact was suspected, something was near, or the arm reacted."""
    lasting: FloatArray
    """(3 + n,) load or step of a joint's torque that explains a residual that stays, see `find_lasting`."""
    steady: int
    """Samples that it has explained with nothing near, the arm reacting or a contact suspected."""
    turning: FloatArray
    """(3, n) how much worse free motion is known where the arm accelerates hard, see `turning_init`."""
    scatter: FloatArray
    """How much more the windows' means vary than white noise would, see `scatter_init`."""
    level: FloatArray
    """What the level of an alarm follows, see `level_init`."""
    settled: int
    """Samples of free motion at rest, see `sequential_step`."""


class Observation(NamedTuple):
    """What one step knows of the arm and about it."""

    kin: Kinematics
    """The arm's posture."""
    robot: RobotState
    """The torques must be numbers."""
    obstacles: Obstacles | ObstacleArrays
    """What is near."""
    cues: Cues
    """What units say of a touch."""


class ResidualWindows(NamedTuple):
    """Means of the newest residuals, and what they are in free motion."""

    means: FloatArray
    """(6, n) of windows of each of `sequential.LENGTHS` [Nm]."""
    samples: int
    """How many samples there are."""
    covariance: FloatArray
    """(n, n) of one sample: its noise, and `model_variance` on the diagonal [Nm^2]."""
    model_variance: FloatArray
    """(n,) of the error of the mean of free motion, which does not average out [Nm^2]."""


@value
class SequentialDetection:
    """What one sample says."""

    residual: FloatArray
    """(n,) torques less their mean [Nm]."""
    windows: ResidualWindows
    log_likelihood_ratio: float
    """ln R / ln A: a contact from 1 on."""
    force: FloatArray
    """(3,) at the end-effector that explains the window that says most best [N]; none of it moves the arm towards a
    seen object if what says most is that this object touches."""
    bands: FloatArray
    """(6, 3) bands of the force that say the same of one sample, the parts of `Thresholds` [N]."""
    learning: bool
    """Whether the sample is to be learnt as free motion."""
    lasting: bool
    """Whether it is being found out if the residual is a load or a step of an estimate."""
    detectable_n: float
    """Force at the end-effector that is found, see `detectable_force` [N]."""


def sequential_init(model: RobotModel, p: SequentialParams, learnt: ResidualModel | None = None) -> SequentialState:
    """Return the state before the first sample; `learnt` is what an earlier session knew of the arm."""
    known = residual_init(model.n, p) if learnt is None else learnt
    return SequentialState(
        known, np.zeros((LONGEST, model.n)), 0, 0, 0, np.zeros(3 + model.n), 0, turning_init(model.n),
        scatter_init(model.n), level_init(), 0,
    )  # fmt: skip


def sequential_step(
    state: SequentialState, model: RobotModel, seen: Observation, reacting: bool, watched: bool, period: float,
    p: SequentialParams,
) -> tuple[SequentialDetection, SequentialState]:  # fmt: skip
    """Test one sample of the external torques for a contact, and learn from it if nothing can be one.

    Args:
        state: memory.
        model: the arm.
        seen: what the step knows.
        reacting: whether the arm moves with a contact.
        watched: whether a skin watches, all of it heard.
        period: of control [s].
        p: parameters.
    """
    m, n, robot, o = state.model, model.n, seen.robot, seen.obstacles
    residual, speed, force, bands = np.empty(n), np.empty(n), np.empty(3), np.empty((6, 3))
    # zeros, for windows that are not whole yet are not written
    means, covariance, model_variance = np.zeros((len(LENGTHS), n)), np.empty((n, n)), np.empty(n)
    ring, block, queue, prior = state.ring.copy(), m.block.copy(), m.queue, _NONE
    weights, weights_covariance, noise, learnt = m.weights, m.covariance, m.spread, m.seen
    settle = round(p.relearn_after_s / period) if p.learn != "never" else 0
    # The step is pure, so what it writes to is copied first: the model only where a block or what lasts may be learnt.
    if m.filled + 1 == BLOCK or 0 < settle <= state.steady:
        queue = queue.copy()
        if m.waiting == QUEUE or 0 < settle <= state.steady:
            prior = prior_of(n, p)
            weights, weights_covariance = weights.copy(), weights_covariance.copy()
            noise, learnt = noise.copy(), learnt.copy()
    scatter = state.scatter.copy() if p.misfit and learns_scatter(state.at) else state.scatter
    lasting, turning, level = state.lasting.copy(), state.turning.copy(), state.level.copy()
    misfit, nearness = p.misfit or _NO_MISFIT, p.proximity or _NO_PROXIMITY
    count = min(state.count + 1, LONGEST)
    # The fields of Joints, ObstacleArrays, Memory, Situation, DetectionNumbers, Results, Kinematics and Mechanism in
    # their order, which nothing checks: numbers of one type can change places in silence.
    ratio, detectable, calm, filled, waiting, steady, settled = detect_contact.flat(
        robot.qd, robot.qd_commanded, robot.tau_ext,
        o.unit, o.link, o.body_point, o.direction, o.body_distance, o.closing_speed,
        weights, weights_covariance, noise, learnt, prior,
        block, m.filled, queue, m.waiting,
        ring, state.at, count, state.calm, lasting, state.steady, turning, scatter, level, state.settled, m.speed,
        math.exp(-p.observer_gain_1_s * period), period, settle, alarm_bound(p, period),
        p.learn == "always" or (watched and p.learn == "watched"), reacting,
        (_CEILING * p.velocity_prior_rad_s2) ** 2, (_CEILING * p.torque_prior_nm) ** 2, seen.cues.gain,
        p.widen_at_turns, p.offset_prior_nm, p.proximity is not None, p.contact_gain, p.tails, nearness.gain,
        nearness.distance_m, nearness.horizon_s, p.clear_m, p.suspect, p.slack_nats, p.noise_floor_nm, p.bias_floor_nm,
        p.still_rad_s, p.memory_s, p.spread_memory_s, p.misfit is not None, misfit.memory_s,
        residual, speed, force, bands, means, covariance, model_variance, *seen.kin, *model.mechanism_fields,
    )  # fmt: skip
    relearnt = steady < 0  # the load that lasted is free motion now, and no contact
    if relearnt:
        ratio, force, count, calm, steady, filled, waiting = 0.0, np.zeros(3), 0, 0, 0, 0, 0
    found = SequentialDetection(
        residual, ResidualWindows(means, count, covariance, model_variance), ratio, force, bands,
        relearnt or calm == CALM, steady > 0, detectable,
    )  # fmt: skip
    after = ResidualModel(weights, weights_covariance, noise, learnt, speed, queue, block, filled, waiting)
    remembered = (calm, lasting, steady, turning, scatter, level, settled)
    return found, SequentialState(after, ring, (state.at + 1) % LONGEST, count, *remembered)
