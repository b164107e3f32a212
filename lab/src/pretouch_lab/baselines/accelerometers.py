"""Impacts, by the units' accelerometers: what they measure less what the commanded motion explains.

Each sample is put into a bin of 10 ms by its own stamp: units send at different times, a datagram at a time, and only
what they measured at the same time can be compared. `impact_pattern` says of a bin which link's contact explains it.
From that follow gains on the links of the sequential test, for a short while; where nothing jolts they are 1.
"""

import math
from dataclasses import dataclass, replace
from typing import Annotated, NamedTuple

import numpy as np

from pretouch.checks import Check, Checked, Fraction, NonNegative, Positive
from pretouch.compiled import ByName, compiled, entry
from pretouch.contact.cues import Cue, Cues, no_cues
from pretouch.contact.detector import Body, Sample
from pretouch.groups import Mechanism, SkinArrays
from pretouch.robot.link_motion import chain_motion, lever_acceleration
from pretouch.robot.model import Kinematics, RobotModel
from pretouch.sensing.imu_scale import STANDARD_GRAVITY
from pretouch.types import BoolArray, FloatArray, IntArray
from pretouch.values import value
from pretouch_lab.baselines.impact_pattern import likelihoods, responses

BIN_S = 0.01
"""Length of a bin [s]: about that of an impact of a hand, and four samples."""
BINS = 8
"""Bins that are kept: the oldest datagram is 60 ms old."""
SETTLED = 100
"""Bins of a unit after which its mean and spread are known."""
_MEAN_S = 0.3
"""Time over which a unit's mean innovation is averaged [s]: bias, mounting and scale errors times a turning gravity."""
_SPREAD_S = 10.0
"""Time over which its spread is."""
_LEAST = 0.02
"""Smallest standard deviation of a bin's mean [m/s^2]: noise of 90 ug/sqrt(Hz) at 100 Hz is 0.01."""
_OUTLIER = 9.0
"""Squared deviation from which a bin counts for less in what is learnt: most of an impact is not learnt as noise."""
_FINE_S = 0.001
"""Longest step in which the arm's way after a command is reckoned [s]."""


@value
class ImpactState:
    """What is remembered of B bins of K units."""

    number: int
    """Number of the newest bin; bin b lasts from b `BIN_S` on."""
    measured: FloatArray
    """(B, K, 3) sums of the accelerations in each bin, bin b in place b mod B [m/s^2]."""
    heard: IntArray
    """(B, K) how many there are."""
    expected: FloatArray
    """(B, K, 3) sums of those that the motion explains."""
    moved: FloatArray
    """(B, K) sums of their size, gravity left out."""
    steps: IntArray
    """(B,) how many steps they are of."""
    mean: FloatArray
    """(K, 3) mean innovation of each unit [m/s^2]."""
    spread: FloatArray
    """(K, 3) its variance, of whole bins [m^2/s^4]."""
    usual: FloatArray
    """(K,) mean count of samples in a bin."""
    seen: IntArray
    """(K,) bins learnt from."""
    speed: FloatArray
    """(n,) joint velocities as the arm follows its commands [rad/s]."""
    behind: FloatArray
    """(n,) by how much it is behind them [rad]."""
    excess: FloatArray
    """(L,) gain of each link less 1."""


def impact_init(model: RobotModel, units: int) -> ImpactState:
    """Return the state of so many units before their first sample."""
    grid = (BINS, units)
    return ImpactState(
        number=-1, measured=np.zeros((*grid, 3)), heard=np.zeros(grid, np.int64), expected=np.zeros((*grid, 3)),
        moved=np.zeros(grid), steps=np.zeros(BINS, np.int64), mean=np.zeros((units, 3)), spread=np.zeros((units, 3)),
        usual=np.zeros(units), seen=np.zeros(units, np.int64), speed=np.zeros(model.n), behind=np.zeros(model.n),
        excess=np.zeros(len(model.links)),
    )  # fmt: skip


@dataclass(frozen=True)
class AccelerometerParams(Checked):
    """How a jolt that the units' accelerometers measure raises the prior of a contact on the links that explain it."""

    gain: Annotated[float, Check(low=1.0, high=1e4)] = 100.0
    """Times the prior of all links together is larger, at most, after a jolt [1]. It is never lowered."""
    memory_s: Positive = 0.05
    """Time in which that fades to a third [s]: the torques follow an impact so late."""
    contact_gain: Positive = 30.0
    """Times the spread of the accelerations is larger with an impact, in each direction it can push [1]."""
    tails: Annotated[float, Check(low=3.0, high=1000.0)] = 8.0
    """Degrees of freedom of the Student distribution of the accelerations without one: real vibration has outliers."""
    follow_1_s: Positive = 50.0
    """How fast the arm follows a commanded velocity [1/s]: as a critically damped joint impedance of 3000 Nm/rad
    does, that carries 1.2 kg m^2."""
    motion_doubt: Fraction = 0.5
    """Part of what the commanded motion accelerates a unit by that may be otherwise [1], one standard deviation."""
    rotor_kg_m2: NonNegative = 0.1
    """Inertia of a drive at its joint [kg m^2], for what an impact accelerates (as the simulated arm's)."""


@dataclass(frozen=True)
class Accelerometers(AccelerometerParams, Cue, name="imu"):
    """The units' accelerometers; they tell of no contact sooner than the torques (docs/explanation/detection.md)."""

    State = ImpactState
    reads = "imu"

    def step(self, state: ImpactState | None, body: Body, sample: Sample) -> tuple[Cues | None, ImpactState | None]:
        """Take in new samples; without any, nothing is said and nothing changes."""
        if sample.imu is None:
            return None, state
        return listen(state or impact_init(body.model, len(body.skin)), body, sample, self)


def listen(state: ImpactState, body: Body, sample: Sample, p: AccelerometerParams) -> tuple[Cues, ImpactState]:
    """Take in the samples that came since the last step, and return what they say of an impact.

    Args:
        state: memory.
        body: the arm and its units.
        sample: of this step, with IMU samples whose units and numbers are sound.
        p: parameters.
    """
    s, model, skin, robot, imu, period = state, body.model, body.skin, sample.robot, sample.imu, body.period
    number = math.floor((sample.stamp - 0.5 * period) / BIN_S)
    gap = number - s.number
    if not 0 <= gap < BINS:  # the first step, or time has jumped: no bin is whole
        fresh = impact_init(model, len(skin))
        s = ImpactState(
            number, fresh.measured, fresh.heard, fresh.expected, fresh.moved, fresh.steps, s.mean, s.spread, s.usual,
            s.seen, robot.qd_commanded, fresh.behind, fresh.excess,
        )  # fmt: skip
        gap = 0
    measured, heard, expected = s.measured.copy(), s.heard.copy(), s.expected.copy()
    moved, steps = s.moved.copy(), s.steps.copy()
    mean, spread, usual, seen = s.mean.copy(), s.spread.copy(), s.usual.copy(), s.seen.copy()
    speed, behind, excess = s.speed.copy(), s.behind.copy(), s.excess * math.exp(-period / p.memory_s)
    likelihood = np.zeros((BINS, len(model.parts)))
    judged = _listen(
        sample.kin, model.mechanism, skin.arrays._replace(T_link_sensor=skin.T_link_board), robot.qd_commanded, imu,
        (
            number, gap, (measured, heard, expected, moved, steps), (mean, spread, usual, seen), speed, behind
        ),
        _Params(period, p.follow_1_s, p.motion_doubt, p.rotor_kg_m2, p.contact_gain, p.tails),
        likelihood,
    )  # fmt: skip
    if judged:
        _raise(excess, likelihood, model.parts, p)
    after = ImpactState(
        number, measured, heard, expected, moved, steps, mean, spread, usual, seen, speed, behind, excess
    )  # fmt: skip
    return replace(no_cues(len(model.links)), gain=1.0 + excess), after


def _raise(excess: FloatArray, likelihood: FloatArray, parts: IntArray, p: AccelerometerParams) -> None:
    """Raise the gains (L,) of links to what the bin that says most, of likelihood ratios (B, P), says of them.

    Their mean is the ratio of an impact anywhere; it is what is bounded, so that all links together weigh so much more.
    """
    anywhere, most = likelihood.mean(axis=1), p.gain - 1.0
    b = int(anywhere.argmax())
    if anywhere[b] > 0.0:
        excess[parts] = np.maximum(excess[parts], min(1.0, most / float(anywhere[b])) * likelihood[b])
        # what fades may be on other links than what is new
        excess[parts] *= min(1.0, most / float(excess[parts].mean()))


class _Bins(NamedTuple):
    """Sums of samples, as of `ImpactState`: B bins of K units, or one of them."""

    measured: FloatArray
    heard: IntArray
    expected: FloatArray
    moved: FloatArray
    steps: IntArray


class _Usual(NamedTuple):
    """What is usual of K units, as of `ImpactState`."""

    mean: FloatArray
    spread: FloatArray
    usual: FloatArray
    seen: IntArray


class _Memory(NamedTuple):
    """All that is remembered, and changed."""

    number: int
    """Number of the newest bin."""
    gap: int
    """By how many bins it is newer than the one of the step before."""
    bins: _Bins
    usual: _Usual
    speed: FloatArray
    behind: FloatArray


class _Params(NamedTuple):
    """The period, and what is taken of `AccelerometerParams`."""

    period: float
    follow: float
    motion_doubt: float
    rotor: float
    gain: float
    tails: float


class _Samples(NamedTuple):
    """As `ImuReadings`."""

    unit: IntArray
    stamp: FloatArray
    acceleration: FloatArray


@entry
def _listen(
    kin: Kinematics, mechanism: Mechanism, skin: SkinArrays, qd_commanded: FloatArray, imu: ByName[_Samples],
    memory: _Memory, p: _Params, likelihood: FloatArray,
) -> int:  # fmt: skip
    """Move the bins on to `number`, fill them, and write the likelihood ratios (B, P) of those that were added to.

    Returns how many there are. Writes what is remembered.
    """
    number, bins, usual = memory.number, memory.bins, memory.usual
    measured, heard, expected, moved, steps = bins
    unit, stamp, acceleration = imu
    for b in range(number - memory.gap + 1, number + 1):
        k = b % BINS
        _learn(measured[k], heard[k], expected[k], steps[k], usual)
        measured[k], heard[k], expected[k], moved[k], steps[k] = 0.0, 0, 0.0, 0.0, 0
    growth = _followed(qd_commanded, memory.speed, memory.behind, p.follow, p.period)
    newest = number % BINS
    _expect(kin, mechanism.arm.moved_by, skin, memory.speed, growth, expected[newest], moved[newest])
    steps[newest] += 1
    fresh = np.zeros(BINS, np.bool_)
    for i in range(len(unit)):
        b = int(np.floor(stamp[i] / BIN_S))
        if number - BINS < b <= number:
            k = b % BINS
            measured[k, unit[i]] += acceleration[i]
            heard[k, unit[i]] += 1
            fresh[k] = True
    judged = 0
    A = np.empty((0, 0, 3, 3))
    for k in range(BINS):
        if fresh[k] and steps[k]:
            if not judged:
                A = responses(kin, mechanism, p.rotor, skin)
            judged += 1
            z, variance, known = _innovation(bins, k, usual, p.motion_doubt)
            likelihoods(z, variance, known, A, p.gain, p.tails, likelihood[k])
    return judged


@compiled
def _followed(
    commanded: FloatArray, speed: FloatArray, behind: FloatArray, follow: float, period: float
) -> FloatArray:  # fmt: skip
    """Let the arm follow commanded velocities (n,) for a period [s]; return its mean acceleration (n,) [rad/s^2].

    A critically damped joint impedance about the commanded positions and velocities.
    """
    steps = int(np.ceil(period / _FINE_S))
    dt, before = period / steps, speed.copy()
    for j in range(len(commanded)):
        for _ in range(steps):
            ahead = commanded[j] - speed[j]
            behind[j] += ahead * dt
            speed[j] += (follow * follow * behind[j] + 2.0 * follow * ahead) * dt
    return (speed - before) / period


@compiled
def _expect(
    kin: Kinematics, moved_by: BoolArray, skin: SkinArrays, qd: FloatArray, qdd: FloatArray, expected: FloatArray,
    moved: FloatArray,
) -> None:  # fmt: skip
    """Add to `expected` (K, 3) the specific force of each unit, sensor frame, and to `moved` (K,) the motion's size."""
    position, rotation, anchor, axis = kin
    link, T = skin.link, skin.T_link_sensor
    w, alpha, a, point = chain_motion(anchor, axis, qd, qdd)
    for u in range(len(link)):
        body, k = link[u], moved_by[link[u]].sum()
        R = rotation[body] @ np.ascontiguousarray(T[u, :3, :3])
        place = position[body] + rotation[body] @ np.ascontiguousarray(T[u, :3, 3])
        force = a[k] + lever_acceleration(w[k], alpha[k], place - point[k])
        moved[u] += np.sqrt(force @ force)
        force[2] += STANDARD_GRAVITY
        expected[u] += R.T @ force


@compiled
def _innovation(bins: _Bins, k: int, known_of: _Usual, motion_doubt: float) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Innovations (K, 3) of bin k with their variances (K, 3), and which units' are known (K,)."""
    measured, heard, expected = bins.measured[k], bins.heard[k], bins.expected[k]
    moved, steps = bins.moved[k], bins.steps[k]
    mean, spread, usual, seen = known_of
    z, variance, known = np.zeros(mean.shape), np.ones(mean.shape), np.zeros(len(mean), np.bool_)
    for u in range(len(mean)):
        if heard[u] and seen[u] >= SETTLED:
            known[u] = True
            fewer = max(1.0, usual[u] / heard[u])
            for i in range(3):
                z[u, i] = measured[u, i] / heard[u] - expected[u, i] / steps - mean[u, i]
                variance[u, i] = fewer * spread[u, i] + (motion_doubt * moved[u] / steps) ** 2
    return z, variance, known


@compiled
def _learn(measured: FloatArray, heard: IntArray, expected: FloatArray, steps: int, known_of: _Usual) -> None:
    """Learn mean and spread (K, 3) of the units from a bin that gets no more samples; outliers count for less."""
    mean, spread, usual, seen = known_of
    if not steps:
        return
    for u in range(len(mean)):
        if not heard[u]:
            continue
        first = 1.0 / (seen[u] + 1)
        slow, slower = max(first, BIN_S / _MEAN_S), max(first, BIN_S / _SPREAD_S)
        usual[u] += slower * (heard[u] - usual[u])
        for i in range(3):
            z = measured[u, i] / heard[u] - expected[u, i] / steps - mean[u, i]
            if seen[u] == 0:
                mean[u, i] = z
                continue
            most = _OUTLIER * spread[u, i]
            within = 1.0 if seen[u] < SETTLED or z * z < most else np.sqrt(most) / abs(z)
            mean[u, i] += slow * within * z
            spread[u, i] = max(spread[u, i] + slower * ((within * z) ** 2 - spread[u, i]), _LEAST**2)
        seen[u] += 1
