"""What a sample teaches of free motion: calm samples in blocks, and a load or a step of an estimate that lasts."""

from typing import NamedTuple

import numpy as np

from pretouch.compiled import compiled, inlined
from pretouch.contact.alarm_level import learn_level
from pretouch.contact.lasting_load import (
    WeightPart,
    find_lasting,
    learn_lasting,
    stands_out,
    still_explains,
    weight_part,
)
from pretouch.contact.residual_model import BLOCK, QUEUE, CalmSample, Learnt, Pace, add_sample, learn_block
from pretouch.contact.scatter import LENGTHS, LONGEST, FreeMeans, learn_scatter, learn_turning
from pretouch.types import FloatArray

CALM = BLOCK * QUEUE
"""Calm samples after which one is learnt."""
_FIRST_S = 2.0
"""Time that the prior of the noise counts for [s]."""


class Blocks(NamedTuple):
    """Blocks of samples that wait to be learnt, as of `ResidualModel`."""

    block: FloatArray
    filled: int
    queue: FloatArray
    waiting: int


class Recent(NamedTuple):
    """The newest samples and what they leave, as of `SequentialState`."""

    ring: FloatArray
    at: int
    held: int
    calm: int
    lasting: FloatArray
    steady: int
    turning: FloatArray
    scatter: FloatArray
    level: FloatArray
    settled: int
    speed: FloatArray
    """(n,) commanded joint velocities as late as the torques, of the sample before [rad/s]."""


class Memory(NamedTuple):
    """All that is remembered, and changed."""

    learnt: Learnt
    blocks: Blocks
    recent: Recent


class Situation(NamedTuple):
    """What else there is to say of one sample."""

    delay: float
    """Part of the commanded velocities of the sample before that the torques still show."""
    period: float
    """Of control [s]."""
    settle: int
    """Samples after which what lasts is learnt, 0 for never."""
    bound: float
    """ln A of the test, see `alarm_bound`."""
    may_learn: bool
    """Whether free motion may be learnt."""
    reacting: bool
    """Whether the arm moves with a contact."""
    most_velocity: float
    """Largest variance A [(rad/s^2)^2]."""
    most_torque: float
    """Largest variance D [Nm^2]."""
    touch_gain: FloatArray
    """(L,) factor on the prior of a contact on each link, by what units say."""


class DetectionNumbers(NamedTuple):
    """What compiled code takes of `SequentialParams`."""

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
def update_model(memory: Memory, now: Situation, p: DetectionNumbers, tested: Tested) -> tuple[int, int, int, int]:
    """Learn from a sample; return calm samples, samples of the block, blocks that wait, and `steady` of the state."""
    learnt, blocks, recent = memory
    sample, whole, free, alone, suspected = tested.sample, tested.whole, tested.expected, tested.alone, tested.suspected
    # What was gathered before a contact is suspected may be its beginning: it is thrown away, not learnt. Where misfit
    # is learnt it only counts less: a spread without what it does not expect shrinks, and expects less and less.
    calm = 0 if (suspected and not p.learn_misfit) or now.reacting or not alone else min(recent.calm + 1, CALM)
    # learnt also where a contact is suspected: an alarm at a reversal would otherwise come at each of them
    if p.widen_at_turns and alone and not now.reacting and whole == len(LENGTHS):
        learn_turning(recent.at, tested.means, free.S, sample.model_variance, now.period / p.memory_s, recent.turning)
    if p.learn_misfit and alone and not now.reacting:
        learn_scatter(recent.at, whole, free, p.tails, now.period / p.misfit_memory_s)
        if whole == len(LENGTHS):
            learn_level(tested.log_r, tested.level)
    filled, waiting = 0, 0
    if calm >= CALM:
        add_sample(
            blocks.block, blocks.filled == 0, sample, learnt.spread[sample.moving], p.tails, p.noise_floor_nm
        )  # fmt: skip
        pace = Pace(
            BLOCK * now.period / p.memory_s, BLOCK * now.period / p.spread_memory_s, _FIRST_S / now.period,
            now.most_velocity, now.most_torque,
        )  # fmt: skip
        filled, waiting = _queue_block(blocks, blocks.filled + 1, learnt, pace)
    # something that lasts is worth finding only if it troubles the arm; calm samples learn it anyway
    steady, unclear = 0, recent.steady > 0 or suspected or now.reacting
    if now.settle > 0 and alone and whole == len(LENGTHS) and (calm < CALM or suspected) and unclear:
        steady = _lasting_samples(recent, now, tested, learnt, p.offset_prior_nm)
    return calm, filled, waiting, steady


@compiled
def _queue_block(blocks: Blocks, filled: int, learnt: Learnt, pace: Pace) -> tuple[int, int]:
    """Let a block that is full wait, and learn the one that has waited longest; return what waits now."""
    # A contact that begins slowly is suspected late. By then its first samples are in the queue, which is thrown away.
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


@compiled
def _lasting_samples(recent: Recent, now: Situation, tested: Tested, known: Learnt, offset_prior: float) -> int:
    """Return for how many samples that count the same load or step has explained the residual; -1: it was learnt.

    Samples count in which a contact is suspected or the arm reacts, but only what stands out is something to find out.
    """
    lasting, steady, settle = recent.lasting, recent.steady, now.settle
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
    if counts and (steady == 0 or steady > settle):
        found = np.empty(3 + n)
        if not find_lasting(residual, weight, J, noise, LONGEST, offset_prior, found):
            # what has lasted may be unexplained for a while; for too long it is a person
            return steady if steady <= 2 * settle else 0
        # found once more at the end, when it is learnt: a load that came slowly was less at the beginning
        if steady > settle:
            learn_lasting(found, residual, x, noise, LONGEST, offset_prior**2, known)
            return -1
        lasting[:] = found
        steady = 1
    return steady
