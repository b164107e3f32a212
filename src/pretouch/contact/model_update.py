"""What a sample teaches of free motion: calm samples in blocks, and a load or a step of an estimate that lasts."""

from typing import Annotated, NamedTuple

import numpy as np

from pretouch.compiled import inlined, kernel
from pretouch.contact.alarm_level import learn_level
from pretouch.contact.lasting_load import (
    WeightPart,
    find_lasting,
    learn_lasting,
    stands_out,
    still_explains,
    weight_part,
)
from pretouch.contact.residual_model import (
    BLOCK,
    QUEUE,
    CalmSample,
    Learnt,
    Pace,
    ResidualModel,
    add_sample,
    learn_block,
)
from pretouch.contact.scatter import LENGTHS, LONGEST, FreeMeans, learn_scatter, learn_turning
from pretouch.records import IntCell
from pretouch.types import FloatArray

CALM = BLOCK * QUEUE
"""Calm samples after which one is learnt."""
_FIRST_S = 2.0
"""Time that the prior of the noise counts for [s]."""


class SequentialState(NamedTuple):
    """All that the sequential detector remembers, and changes."""

    model: ResidualModel
    ring: Annotated[FloatArray, "R", "n"]
    """(32, n) newest residuals [Nm]."""
    at: IntCell
    """Where the next one goes."""
    samples: IntCell
    """How many there are."""
    calm: IntCell
    """Samples since a contact was suspected, something was near, or the arm reacted."""
    lasting: Annotated[FloatArray, "3 + n"]
    """(3 + n,) load or step of a joint's torque that explains a residual that stays, see `find_lasting`."""
    steady: IntCell
    """Samples that it has explained with nothing near, the arm reacting or a contact suspected; -1: it was learnt."""
    turning: Annotated[FloatArray, 3, "n"]
    """(3, n) how much worse free motion is known where the arm accelerates hard, see `turning_init`."""
    scatter: Annotated[FloatArray, 2, "W", "n + 2", "n"]
    """How much more the windows' means vary than white noise would, see `scatter_init`."""
    level: Annotated[FloatArray, 2, 5]
    """What the level of an alarm follows, see `level_init`."""
    settled: IntCell
    """Samples of free motion at rest."""


class SequentialNumbers(NamedTuple):
    """What compiled code takes of `SequentialParams`."""

    period: float
    """Of control [s]."""
    delay: float
    """Part of the commanded velocities of the sample before that the torques still show."""
    settle: int
    """Samples after which what lasts is learnt, 0 for never."""
    bound: float
    """ln A of the test, see `alarm_bound`."""
    learns: int
    """Whether free motion is learnt: 0 never, 1 while a skin watches, 2 always."""
    prior: Annotated[FloatArray, "f"]
    """(f,) variances of the weights before anything is learnt [Nm^2]."""
    most_velocity: float
    """Largest variance A [(rad/s^2)^2]."""
    most_torque: float
    """Largest variance D [Nm^2]."""
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
    slack_nats: float
    noise_floor_nm: float
    bias_floor_nm: float
    still_rad_s: float
    memory_s: float
    spread_memory_s: float
    learn_misfit: bool
    misfit_memory_s: float


class Situation(NamedTuple):
    """What else there is to say of one sample."""

    watched: bool
    """Whether a skin watches, all of it heard and none of it touched."""
    reacting: bool
    """Whether the arm moves with a contact."""
    touch_gain: FloatArray
    """(L,) factor on the prior of a contact on each link, by what units say."""


class Tested(NamedTuple):
    """A sample as the test leaves it."""

    sample: CalmSample
    means: FloatArray
    """(6, n) means of the newest residuals, of each of `LENGTHS` [Nm]."""
    whole: int
    """How many of them are of as many samples as they should be."""
    expected: FreeMeans
    """What the means are in free motion, and how they compare with it."""
    J: FloatArray
    """(6, n) Jacobian of the end-effector."""
    alone: bool
    """Whether nothing that is seen can touch the arm."""
    suspected: bool
    """Whether a contact is."""
    log_r: float
    """ln R of the test."""
    level: FloatArray
    """(5,) what the level follows in the present regime, see `level_init`; changed."""


@inlined
def update_model(state: SequentialState, now: Situation, p: SequentialNumbers, tested: Tested) -> None:
    """Learn from a sample: of the state, count what is calm and what lasts."""
    model, sample, whole, free = state.model, tested.sample, tested.whole, tested.expected
    alone, suspected = tested.alone, tested.suspected
    # What was gathered before a contact is suspected may be its beginning: it is thrown away, not learnt. Where misfit
    # is learnt it only counts less: a spread without what it does not expect shrinks, and expects less and less.
    lost = (suspected and not p.learn_misfit) or now.reacting or not alone
    state.calm[0] = 0 if lost else min(state.calm[0] + 1, CALM)
    # learnt also where a contact is suspected: an alarm at a reversal would otherwise come at each of them
    if p.widen_at_turns and alone and not now.reacting and whole == len(LENGTHS):
        learn_turning(state.at[0], tested.means, free.S, sample.model_variance, p.period / p.memory_s, state.turning)
    if p.learn_misfit and alone and not now.reacting:
        learn_scatter(state.at[0], whole, free, p.tails, p.period / p.misfit_memory_s)
        if whole == len(LENGTHS):
            learn_level(tested.log_r, tested.level)
    learnt = Learnt(model.weights, model.covariance, model.spread, model.seen, p.prior)
    if state.calm[0] >= CALM:
        add_sample(
            model.block, model.filled[0] == 0, sample, model.spread[sample.moving], p.tails, p.noise_floor_nm
        )  # fmt: skip
        pace = Pace(
            BLOCK * p.period / p.memory_s, BLOCK * p.period / p.spread_memory_s, _FIRST_S / p.period,
            p.most_velocity, p.most_torque,
        )  # fmt: skip
        _queue_block(model, learnt, pace)
    else:
        model.filled[0] = model.waiting[0] = 0
    # something that lasts is worth finding only if it troubles the arm; calm samples learn it anyway
    unclear = state.steady[0] > 0 or suspected or now.reacting
    if p.settle > 0 and alone and whole == len(LENGTHS) and (state.calm[0] < CALM or suspected) and unclear:
        state.steady[0] = _lasting_samples(state, now, p, tested, learnt)
    else:
        state.steady[0] = 0


@kernel
def _queue_block(model: ResidualModel, learnt: Learnt, pace: Pace) -> None:
    """Count a sample of the block; let a block that is full wait, and learn the one that has waited longest."""
    # A contact that begins slowly is suspected late. By then its first samples are in the queue, which is thrown away.
    queue = model.queue
    model.filled[0] += 1
    if model.filled[0] < BLOCK:
        return
    model.filled[0] = 0
    if model.waiting[0] < QUEUE:
        queue[model.waiting[0]] = model.block
        model.waiting[0] += 1
        return
    learn_block(queue[0], learnt, pace)
    queue[:-1] = queue[1:].copy()
    queue[-1] = model.block


@kernel
def _lasting_samples(
    state: SequentialState, now: Situation, p: SequentialNumbers, tested: Tested, known: Learnt
) -> int:  # fmt: skip
    """Return for how many samples that count the same load or step has explained the residual; -1: it was learnt.

    Samples count in which a contact is suspected or the arm reacts, but only what stands out is something to find out.
    """
    lasting, steady = state.lasting, state.steady[0]
    residual, x, J, noise, moving = tested.means[-1], tested.sample.x, tested.J, tested.expected.S, tested.sample.moving
    n = len(residual)
    # what may be weight and what one joint's offset depend on the posture: both are found anew in each step
    weight = WeightPart(np.empty(n), np.empty(n), np.empty(n))
    weight_part(known.weights, x, weight)
    counts = tested.suspected or now.reacting
    if steady and still_explains(lasting, residual, weight.unit, J, noise, LONGEST, moving):
        steady += int(counts)
    else:  # something else, or nothing: the count starts again
        steady, counts = 0, tested.suspected or (now.reacting and stands_out(residual, noise, LONGEST))
    if counts and (steady == 0 or steady > p.settle):
        found = np.empty(3 + n)
        if not find_lasting(residual, weight, J, noise, LONGEST, p.offset_prior_nm, found):
            # what has lasted may be unexplained for a while; for too long it is a person
            return steady if steady <= 2 * p.settle else 0
        # found once more at the end, when it is learnt: a load that came slowly was less at the beginning
        if steady > p.settle:
            learn_lasting(found, residual, x, noise, LONGEST, p.offset_prior_nm**2, known)
            return -1
        lasting[:] = found
        steady = 1
    return steady
