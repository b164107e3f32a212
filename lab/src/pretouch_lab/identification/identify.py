"""Identification of an arm from samples of free motion, with standard errors.

Spans that look like contacts are left out. The noise of the rest is that of velocities and of torque sensors.
"""

import numpy as np

from pretouch.errors import CalibrationError
from pretouch.robot.model import RobotModel
from pretouch.sim.plant_params import PlantParams
from pretouch.types import BoolArray, FloatArray
from pretouch.values import value
from pretouch_lab.identification.fit import BLOCK_S, OWN, Columns, ResidualFit, columns_of, fit
from pretouch_lab.identification.motion import moved
from pretouch_lab.identification.recording import LEAST_S, ArmSamples, Usable, joint_scale, usable

_ROUNDS = 3
_IDENTIFIED = 0.5
"""Largest standard error of an identified number, as a fraction of its prior standard deviation [1]."""
_MOST_MASS_ERROR = 0.5
"""Largest relative error of a link's mass [1]: more, beyond doubt, means a recording of another arm."""
_CONTACT_SIGMAS, _CONTACT_S = 6.0, 0.15
"""Threshold for a contact in robust deviations of a mean, and duration of the mean [s]."""
_MARGIN_S = 0.5
"""Time left out before and after a contact [s]."""
_MOST_CONTACTS = 0.3
"""Largest fraction of a recording that may look like contacts [1]."""
_LEAST_BLOCKS = 8
_LEAST_VELOCITY_RAD_S = 1e-5
"""Least noise of measured velocities that is reported [rad/s]."""


@value
class Noise:
    """Standard deviations of the noise of n joints, with their standard errors."""

    torque_nm: FloatArray
    """(n,) noise of the torque sensors, before the observer [Nm]."""
    torque_errors_nm: FloatArray
    velocity_rad_s: float
    """Noise of the measured velocities [rad/s]."""
    velocity_error_rad_s: float


@value
class Quantity:
    """One parameter of each of n joints."""

    name: str
    """Name with unit."""
    field: str
    """Field of `PlantParams`; '' for a parameter without a field of its own."""
    values: FloatArray
    standard_errors: FloatArray
    identified: BoolArray
    """(n,) true where the recording determines the value; else it stays near its default."""


@value
class IdentifiedArm:
    """An arm with n joints, identified from a recording of free motion."""

    fit: ResidualFit
    noise: Noise | None
    """None without velocities: the residuals then contain their noise, and the observer's gain keeps its default."""
    samples: ArmSamples
    """All samples, used or left out."""
    spans: tuple[tuple[float, float], ...]
    """Start and end of each span that looks like a contact [s]."""
    notes: tuple[str, ...]
    seconds: float
    """Duration of the used free motion [s]."""
    usual: PlantParams
    """Default parameters of the arm."""

    def of_joints(self) -> list[Quantity]:
        """Return the parameters of the joints. The friction F1 is the part that the interface does not compensate."""
        own, errors = self.fit.of_joints(self.fit.numbers), self.fit.of_joints(self.fit.errors)
        clear = self.fit.errors < _IDENTIFIED * self.fit.priors
        of_own, steepness = clear[: own.size].reshape(own.shape), np.exp(own[:, 2])
        ripple, ripple_error = np.hypot(own[:, 4], own[:, 5]), np.hypot(errors[:, 4], errors[:, 5]) / np.sqrt(2.0)
        masses, noise = slice(own.size, own.size + len(own)), self.noise
        phase, phase_error = np.arctan2(own[:, 5], own[:, 4]), ripple_error / np.maximum(ripple, 1e-9)
        rows = [
            ("offset [Nm]", "offsets_nm", own[:, 0], errors[:, 0], of_own[:, 0]),
            ("friction F1, not compensated [Nm]", "friction_f1_nm", own[:, 1], errors[:, 1], of_own[:, 1]),
            ("friction F2 [s/rad]", "friction_f2_s_rad", steepness, steepness * errors[:, 2], of_own[:, 2]),
            ("friction F3 [rad/s]", "friction_f3_rad_s", own[:, 3], errors[:, 3], of_own[:, 3]),
            ("ripple [Nm]", "ripple_nm", ripple, ripple_error, of_own[:, 4] & (ripple > 3.0 * ripple_error)),
            ("phase of the ripple [rad]", "ripple_phases_rad", phase, phase_error, np.ones(len(own), np.bool_)),
            ("mass error of its links", "", self.fit.numbers[masses], self.fit.errors[masses], clear[masses]),
        ]
        if noise is not None:
            torque = noise.torque_nm
            rows.append(("torque noise [Nm]", "torque_noise_nm", torque, noise.torque_errors_nm, torque > 0.0))
        return [Quantity(*row) for row in rows]


def identify(samples: ArmSamples, model: RobotModel, usual: PlantParams) -> IdentifiedArm:
    """Identify an arm. Raises CalibrationError for an unsuitable recording, with the reason."""
    if samples.q.shape[1] != model.n or samples.tau.shape[1] != model.n:
        raise CalibrationError(
            f"The recording has {samples.q.shape[1]} joints and {samples.tau.shape[1]} torques, and"
            f" {model.description.name} has {model.n} joints: name the recorded arm by --arm."
        )
    data, motions = moved(usable(samples))
    columns, notes = columns_of(data, motions, model), [*data.notes]
    used = columns.calm
    even_s = float(used.sum()) * data.period
    if even_s < LEAST_S:
        raise CalibrationError(
            f"The arm's speed changes too often: {even_s:.1f} s of even motion are left. Record {LEAST_S:g} s or more"
            " along smooth paths, or more slowly."
        )
    for _ in range(_ROUNDS):
        fitted = fit(data, columns, used, usual)
        free, spans = free_samples(data, fitted)
        again = columns.calm & free
        if np.array_equal(again, used):
            break
        used = again
    if fitted.payload[0] < 0.0:
        fitted = fit(data, columns, used, usual, payload=False)
        notes.append("The fitted payload is below zero: it is set to 0, and the masses of the links are fitted again.")
    seconds = float(used.sum()) * data.period
    if seconds < LEAST_S:
        raise CalibrationError(
            f"Only {seconds:.1f} s of free motion are left without spans that look like contacts: record {LEAST_S:g} s"
            " or more."
        )
    masses = slice(OWN * model.n, OWN * model.n + model.n)
    far = np.flatnonzero(np.abs(fitted.numbers[masses]) - 3.0 * fitted.errors[masses] > _MOST_MASS_ERROR)
    if len(far):
        raise CalibrationError(
            f"The links behind {model.joints[far[0]]} would have masses off by"
            f" {100 * fitted.numbers[masses][far[0]]:.0f} %: the recording is of another arm than"
            f" {model.description.name}, its torques have the other sign (--sign), or gravity is still in them."
        )
    if spans:
        first = data.samples.stamp[0]
        listed = ", ".join(f"{a - first:.1f} to {b - first:.1f}" for a, b in spans[:8])
        notes.append(
            f"{len(spans)} spans look like contacts and are left out (seconds from the first sample): {listed}"
            f"{' and more' if len(spans) > 8 else ''}."
        )
    noise = None if samples.qd is None else noise_of(data, columns, fitted, used, usual)
    return IdentifiedArm(fitted, noise, data.samples, spans, tuple(notes), seconds, usual)


def free_samples(data: Usable, fitted: ResidualFit) -> tuple[BoolArray, tuple[tuple[float, float], ...]]:
    """Return flags (N,) of the samples in free motion, and start and end of each other span [s].

    A contact lasts longer than noise: means over `_CONTACT_S` are compared with the usual deviation of such means.
    Raises CalibrationError if too much of the recording looks like contacts.
    """
    stamp, left = data.samples.stamp, data.samples.tau - fitted.expected
    length = max(round(_CONTACT_S / data.period), 1)
    means = np.zeros_like(left)
    for span in data.stretches:
        count = span.stop - span.start
        total = np.cumsum(np.vstack([np.zeros((1, left.shape[1])), left[span]]), axis=0)
        ends = np.minimum(np.arange(count) + length // 2 + 1, count)
        begins = np.maximum(np.arange(count) - (length - 1) // 2 - (1 - length % 2), 0)
        means[span] = (total[ends] - total[begins]) / (ends - begins)[:, None]
    far = np.any(np.abs(means - np.median(means, axis=0)) > _CONTACT_SIGMAS * joint_scale(means), axis=1)
    used, spans = np.ones(len(stamp), np.bool_), []
    for span in data.stretches:
        times = stamp[span][far[span]]
        for group in np.split(times, np.flatnonzero(np.diff(times) > 2.0 * _MARGIN_S) + 1):
            if len(group):
                begin, end = float(group[0]) - _MARGIN_S, float(group[-1]) + _MARGIN_S
                spans.append((begin, end))
                used &= (stamp < begin) | (stamp > end)
    share = 1.0 - float(used.mean())
    if share > _MOST_CONTACTS:
        raise CalibrationError(
            f"{100 * share:.0f} % of the recording looks like contacts: nothing may touch the arm while it is"
            " identified. Record free motion, or cut the contacts out."
        )
    return used, tuple(spans)


def noise_of(data: Usable, columns: Columns, fitted: ResidualFit, used: BoolArray, usual: PlantParams) -> Noise:
    """Separate the noise of torques and velocities in the samples with `used` (N,), if velocities are measured.

    The discrete low-pass of the observer, alpha = K dt / (1 + K dt), passes a first-order noise of corner a with the
    fraction alpha / (2 - alpha) (1 + rho (1 - alpha)) / (1 - rho (1 - alpha)) of its variance, rho = exp(-a dt). Two
    parts are subtracted: earlier noise of the velocities in the integral, K'^2 (M M^T)_jj alpha / (2 - alpha) of it,
    and the noise of the positions' derivatives, which counts as noise of the velocities.
    """
    left = data.samples.tau - fitted.expected - fitted.kicked
    # clipped at five deviations: one outlier could dominate a variance
    bound = 5.0 * joint_scale(left[used])
    square = np.clip(left - np.median(left[used], axis=0), -bound, bound) ** 2
    length = round(BLOCK_S / data.period)
    begins = [begin for span in data.stretches for begin in range(span.start, span.stop - length, length)]
    whole = [slice(begin, begin + length) for begin in begins if used[begin : begin + length].all()]
    if len(whole) < _LEAST_BLOCKS:
        raise CalibrationError(
            f"There are {len(whole)} stretches of {BLOCK_S:g} s without a break: the noise needs {_LEAST_BLOCKS}."
            " Record longer, along smoother paths, with nothing touching the arm."
        )
    derivative = columns.motion[0].speed_noise ** 2  # part of the difference
    noise = columns.velocity_noise[used]
    velocity = max(float(np.mean(joint_scale(noise) ** 2 - derivative)), _LEAST_VELOCITY_RAD_S**2)
    dt, gain = usual.period_s, fitted.gain
    alpha, rho = gain * dt / (1.0 + gain * dt), np.exp(-2.0 * np.pi * usual.torque_noise_hz * dt)
    late = rho * (1.0 - alpha)
    part = alpha / (2.0 - alpha) * (1.0 + late) / (1.0 - late)
    shares = velocity * alpha / (2.0 - alpha) + derivative * velocity / (derivative + velocity)
    of_velocities = (alpha / dt) ** 2 * columns.mass_square @ shares
    blocks = np.array([square[block].mean(axis=0) for block in whole])
    without = (blocks.sum(axis=0) - blocks) / (len(blocks) - 1)  # each with one block left out: the jackknife
    torque, again = (
        np.sqrt(np.maximum(variance - of_velocities, 0.0) / part) for variance in (blocks.mean(axis=0), without)
    )
    errors = np.sqrt(len(again) - 1.0) * again.std(axis=0)
    return Noise(torque, errors, float(np.sqrt(velocity)), 1.17 * float(np.sqrt(velocity / (2.0 * noise.size))))
