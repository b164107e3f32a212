"""Model of the LSM6DS3 inertial sensors of a skin: what each unit's accelerometer and gyroscope put into its FIFO."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Literal, NamedTuple

import mujoco
import numpy as np

from pretouch.checks import Check, Checked, Fraction, NonNegative, Positive
from pretouch.compiled import compiled, kernel
from pretouch.sensing.skin import Skin
from pretouch.sensing.unit import ACCELERATION_LSB, ANGULAR_RATE_LSB, STANDARD_GRAVITY
from pretouch.sim.plant import Plant
from pretouch.sim.rays import placed
from pretouch.types import FloatArray, IntArray

_SI = np.repeat((np.deg2rad(1.0), STANDARD_GRAVITY), 3)
"""(6,) degrees/s and g in SI units, gyroscope first."""
_DRAWS = 2048
"""Samples whose noise is drawn at once."""


@dataclass(frozen=True)
class ImuParams(Checked):
    """Errors of a skin's inertial sensors. Where ST gives a typical value, each sensor's is uniform up to it."""

    rate_hz: Annotated[float, Check(low=12.0, high=1666.0)] = 416.0
    """Nominal rate of samples, of both sensors alike [Hz]: the first of the sensor's rates above 400 Hz."""
    rate_error: Fraction = 0.03
    """Each sensor's true rate is off by up to this fraction: its oscillator is trimmed, not a crystal. The data sheet
    gives no tolerance; an assumption."""
    acceleration_range_g: Literal[2, 4, 8, 16] = 4
    """Full scale of the accelerometer [g]."""
    angular_rate_range_dps: Literal[125, 245, 500, 1000, 2000] = 500
    """Full scale of the gyroscope [degrees/s]; like the accelerometer's counts, its counts end at 16 bits."""
    acceleration_bandwidth_hz: Positive = 200.0
    """First-order low-pass of the accelerometer [Hz]: its analogue filter at 416 Hz (data sheet, BW_XL)."""
    angular_rate_bandwidth_hz: Positive = 137.0
    """First-order low-pass of the gyroscope [Hz]: about a third of the rate, as ST's sensors of this family have."""
    scale_error: Fraction = 0.01
    """Each axis' scale is off by up to this fraction (data sheet: 1 % over temperature)."""
    misalignment_deg: NonNegative = 0.5
    """Each sensor is turned by up to this about each axis [degrees]: how well a board is glued on; an assumption. The
    data sheet gives no cross-axis sensitivity; it would do the same."""
    acceleration_bias_mg: NonNegative = 40.0
    """Each axis' constant error, uniform up to this [mg] (data sheet, zero-g level offset)."""
    angular_rate_bias_dps: NonNegative = 10.0
    """Each axis' constant error, uniform up to this [degrees/s] (data sheet, zero-rate level); can be taken off by
    whoever reads the sensor at rest."""
    acceleration_noise_ug: NonNegative = 90.0
    """Density of white noise [ug/sqrt(Hz)] (data sheet, An)."""
    angular_rate_noise_mdps: NonNegative = 7.0
    """Density of white noise [mdps/sqrt(Hz)] (data sheet, Rn)."""


class ImuSample(NamedTuple):
    """One sample of one sensor's FIFO."""

    unit: int
    """Index of the unit in the skin, of one with zones that of its first."""
    time: float
    """Time of the sample [s]."""
    counts: IntArray
    """(6,) gyroscope x, y, z, accelerometer x, y, z, in the unit's sensor frame, each of 16 bits."""


class _Bodies(NamedTuple):
    """MuJoCo's bodies, in the simulation's memory; all in the base frame."""

    position: FloatArray  # (L, 3) origins [m]
    rotation: FloatArray  # (L, 9) rows of the rotation matrices
    center: FloatArray  # (L, 3) centre of mass of each body and all that hangs on it [m]
    velocity: FloatArray  # (L, 6) angular [rad/s], then linear [m/s], of the body's point at its tree's centre
    acceleration: FloatArray  # (L, 6) likewise [rad/s^2, m/s^2]; see `_true`


class _ImusOnLinks(NamedTuple):
    """Poses of K sensors, their errors, gyroscope first, and their state from one physics step to the next."""

    bodies: _Bodies
    link: IntArray  # (K,)
    root: IntArray  # (K,) first body of the tree that the link is in: `center` is that of its tree
    T_link_sensor: FloatArray  # (K, 4, 4)
    rate: FloatArray  # (K,) [Hz]
    mix: FloatArray  # (K, 2, 3, 3) from true to sensed values
    bias: FloatArray  # (K, 6) [rad/s, m/s^2]
    noise: FloatArray  # (K, 6) standard deviation of a sample [rad/s, m/s^2]
    lsb: FloatArray  # (6,) a count [rad/s, m/s^2]
    follow: FloatArray  # (6,) share of the way to the true value that the low-pass goes in one physics step
    dt: float  # physics step [s]
    filtered: FloatArray  # (K, 6) what the low-pass gives [rad/s, m/s^2], NaN before the first step
    due: FloatArray  # (K,) when the next sample is taken [s]
    samples: FloatArray  # (M, 8) those of a step: sensor, when [s], and six counts


class Imus:
    """All inertial sensors of a skin on a simulated arm: `send` is handed each sample as it is taken.

    A sensor measures its own proper acceleration (at rest, that against gravity) and angular velocity, where the unit
    sits; it samples at its own true rate, with its own errors.
    """

    def __init__(
        self, plant: Plant, skin: Skin, params: ImuParams, seed: int, send: Callable[[ImuSample], None]
    ) -> None:
        """Mount the sensors; the seed decides errors, rates, phases and noise."""
        self._plant, self._send, self._first = plant, send, skin.first.tolist()
        data, link = plant.mj_data, skin.link[skin.first]
        rng, count, dt = np.random.default_rng([seed, 5]), len(skin.mounted), plant.params.period_s
        self.rate: FloatArray = params.rate_hz * (1.0 + params.rate_error * rng.uniform(-1, 1, count))
        """(B,) true rate of each sensor [Hz]."""
        due = rng.uniform(0, 1, count) / self.rate
        mix, bias = _errors(params, count, rng)
        self._rng, self._draws, self._drawn = rng, np.zeros((0, 6)), 0
        density = np.repeat((1e-3 * params.angular_rate_noise_mdps, 1e-6 * params.acceleration_noise_ug), 3) * _SI
        noise = density * np.sqrt(self.rate[:, None] / 2.0)
        bandwidth = np.repeat((params.angular_rate_bandwidth_hz, params.acceleration_bandwidth_hz), 3)
        follow = 1.0 - np.exp(-2 * np.pi * bandwidth * dt)
        most = count * (int(dt * self.rate.max(initial=0.0)) + 2)
        root = plant.mj_model.body_rootid[link].astype(np.int64)
        # views into the simulation's memory, taken once
        bodies = _Bodies(data.xpos, data.xmat, data.subtree_com, data.cvel, data.cacc)
        places, errors = (bodies, link, root, skin.T_link_board[skin.first]), (mix, bias, noise, imu_counts(params))
        buffers = np.full((count, 6), np.nan), due, np.zeros((most, 8))
        self._imus = _ImusOnLinks(*places, self.rate, *errors, follow, dt, *buffers)
        self._qvel, self._last_qvel = data.qvel, data.qvel.copy()
        plant.before_each_step(self._sample)

    def _sample(self, time: float) -> None:
        """Take the samples due by one step before `time`: what MuJoCo derives from a state is one step behind it."""
        plant, most = self._plant, len(self._imus.samples)
        if self._drawn + most > len(self._draws):
            self._draws, self._drawn = self._rng.standard_normal((max(_DRAWS, most), 6)), 0
        dt, qvel = plant.params.period_s, self._qvel.copy()
        # MuJoCo's steps are semi-implicit: its velocities belong half a step before its positions and accelerations
        self._qvel[:] = 0.5 * (self._last_qvel + qvel)
        mujoco.mj_comVel(plant.mj_model, plant.mj_data)
        mujoco.mj_rnePostConstraint(plant.mj_model, plant.mj_data)
        self._qvel[:] = self._last_qvel = qvel
        count = _take(time - dt, self._draws[self._drawn :], self._imus)
        self._drawn += count
        for unit, instant, *counts in self._imus.samples[:count].tolist():
            self._send(ImuSample(self._first[int(unit)], instant, np.array(counts, dtype=np.int64)))


def imu_counts(params: ImuParams) -> FloatArray:
    """One count (6,) of gyroscope [rad/s] and accelerometer [m/s^2]."""
    rate = ANGULAR_RATE_LSB[params.angular_rate_range_dps]
    return np.repeat((rate, ACCELERATION_LSB[params.acceleration_range_g]), 3)


def _errors(params: ImuParams, count: int, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Draw how sensors err: matrices (K, 2, 3, 3) from true to sensed values, and biases (K, 6), gyroscope first."""
    from scipy.spatial.transform import Rotation  # a fifth of a second, and many runs have no IMU

    angle = np.deg2rad(params.misalignment_deg) * rng.uniform(-1, 1, (count, 3))
    turn = Rotation.from_rotvec(angle.reshape(-1, 3)).as_matrix().reshape(count, 1, 3, 3)
    scale = 1.0 + params.scale_error * rng.uniform(-1, 1, (count, 2, 3, 1))
    most = np.repeat((params.angular_rate_bias_dps, 1e-3 * params.acceleration_bias_mg), 3) * _SI
    return scale * turn, most * rng.uniform(-1, 1, (count, 6))


@compiled
def _take(now: float, draws: FloatArray, imus: _ImusOnLinks) -> int:
    """Follow the motion to `now`, one physics step after the last call [s], and take what samples are due.

    Writes the samples, and returns how many they are; `draws` (D, 6) are normal, a row for each sample.
    """
    filtered, due, samples = imus.filtered, imus.due, imus.samples
    count, sensed, before = 0, np.zeros(6), np.zeros(6)
    for k in range(len(due)):
        true = _true(imus, k)
        for i in range(6):
            begun = not np.isnan(filtered[k, i])
            before[i] = filtered[k, i] if begun else true[i]
            filtered[k, i] = before[i] + imus.follow[i] * (true[i] - before[i])
        while due[k] <= now:
            # a sample falls between two physics steps: the filtered signal is taken as straight between them
            part = 1.0 - (now - due[k]) / imus.dt
            for i in range(6):
                sensed[i] = before[i] + part * (filtered[k, i] - before[i])
            for i in range(6):
                kind = i // 3
                value = imus.bias[k, i] + imus.noise[k, i] * draws[count, i]
                for j in range(3):
                    value += imus.mix[k, kind, i % 3, j] * sensed[3 * kind + j]
                # beyond full scale the counts stay at the ends of 16 bits
                samples[count, 2 + i] = min(max(np.round(value / imus.lsb[i]), -32768.0), 32767.0)
            samples[count, 0], samples[count, 1] = k, due[k]
            count += 1
            due[k] += 1.0 / imus.rate[k]
    return count


@kernel
def _true(imus: _ImusOnLinks, k: int) -> FloatArray:
    """True angular velocity and proper acceleration (6,) of a sensor, in its own frame.

    MuJoCo gives each body's velocity and acceleration as those of its point at `center` (3,), turning first, along
    the base frame's axes; the acceleration has gravity taken off, and lacks the part from the velocity's own turning.
    """
    bodies, link = imus.bodies, imus.link[k]
    cvel, cacc = bodies.velocity[link], bodies.acceleration[link]
    arm, R = placed(bodies.position[link] - bodies.center[imus.root[k]], bodies.rotation[link], imus.T_link_sensor[k])
    w, alpha = cvel[:3], cacc[:3]
    velocity = cvel[3:] + cross(w, arm)
    # a spatial acceleration is how the velocity changes at a point fixed in space; a point that moves with the body has
    # w x v on top (Featherstone 2008, section 2.11)
    acceleration = cacc[3:] + cross(alpha, arm) + cross(w, velocity)
    own = np.zeros(6)
    for i in range(3):
        for j in range(3):
            own[i] += R[j, i] * w[j]
            own[3 + i] += R[j, i] * acceleration[j]
    return own


@kernel
def cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Cross product (3,)."""
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])
