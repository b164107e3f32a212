"""From samples of an arm in free motion to what kind of arm it is, with standard errors.

What looks like a contact is no noise and is left out. The noise of the rest is of velocities and of torque sensors.
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
"""A number is identified where its standard error is below this part of what was assumed before [1]."""
_MOST_MASS_ERROR = 0.5
"""A link whose mass seems to be off by more than this, beyond doubt, is another arm's [1]."""
_CONTACT_SIGMAS, _CONTACT_S = 6.0, 0.15
"""A mean over so long [s], so many of its own robust deviations off, is taken for a contact."""
_MARGIN_S = 0.5
"""What is left out before and after a contact as well [s]."""
_MOST_CONTACTS = 0.3
"""Of a recording in which more than this part looks like contacts nothing is identified."""
_LEAST_BLOCKS = 8
_LEAST_VELOCITY_RAD_S = 1e-5
"""Least noise of measured velocities that is reported [rad/s]."""


@value
class Noise:
    """Standard deviations of the noise of n joints, with their standard errors."""

    torque_nm: FloatArray
    """(n,) of the torque sensors, before the observer [Nm]."""
    torque_errors_nm: FloatArray
    velocity_rad_s: float
    """Of the measured velocities [rad/s]."""
    velocity_error_rad_s: float


@value
class Quantity:
    """One number of each of n joints."""

    name: str
    """With its unit."""
    field: str
    """Of `PlantParams`; '' for a number that stands there otherwise."""
    values: FloatArray
    standard_errors: FloatArray
    identified: BoolArray
    """(n,) whether the recording tells it; else it stays near what is usual."""


@value
class IdentifiedArm:
    """What a recording of free motion tells of an arm with n joints."""

    fit: ResidualFit
    noise: Noise | None
    """None without velocities: theirs is then in what is left of the torques, and the observer's gain stays."""
    samples: ArmSamples
    """Those used or left out."""
    spans: tuple[tuple[float, float], ...]
    """From when to when something looked like a contact [s]."""
    notes: tuple[str, ...]
    seconds: float
    """Free motion that was used [s]."""
    usual: PlantParams
    """The arm as it is taken to be without a recording."""

    def of_joints(self) -> list[Quantity]:
        """Return the numbers of the joints. The friction F1 is that which the interface does not compensate."""
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
    """Identify an arm. CalibrationError for a recording that cannot tell, with what is missing."""
    if samples.q.shape[1] != model.n or samples.tau.shape[1] != model.n:
        raise CalibrationError(
            f"The recording has {samples.q.shape[1]} joints and {samples.tau.shape[1]} torques, and"
            f" {model.description.name} has {model.n} joints: give the arm it is of."
        )
    data, motions = moved(usable(samples))
    columns, notes = columns_of(data, motions, model), [*data.notes]
    used = columns.calm
    even_s = float(used.sum()) * data.period
    if even_s < LEAST_S:
        raise CalibrationError(
            f"The arm's speed changes so often that {even_s:.1f} s of even motion are left: record {LEAST_S:g} s or"
            " more along smooth paths, or slower."
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
        notes.append("The payload comes out below zero: it is 0, and the masses of the links take the rest.")
    seconds = float(used.sum()) * data.period
    if seconds < LEAST_S:
        raise CalibrationError(
            f"Only {seconds:.1f} s of free motion are left without what looks like contacts: record {LEAST_S:g} s or"
            " more."
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
    """Say which samples (N,) are of free motion, and from when to when [s] something else is.

    What a contact does lasts longer than noise: means over `_CONTACT_S` are compared with how far such means usually
    are off. CalibrationError if too much looks like that.
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
    """Take the noise of the samples that are used (N,) apart, where velocities are measured.

    A first-order noise of corner a through the discrete low-pass of the observer, alpha = K dt / (1 + K dt), keeps the
    part alpha / (2 - alpha) (1 + rho (1 - alpha)) / (1 - rho (1 - alpha)) of its variance, rho = exp(-a dt). What
    earlier noise of the velocities left in the integral is taken off: K'^2 (M M^T)_jj alpha / (2 - alpha) of it; and
    so is what the noise of the positions' derivatives, which is in what was taken for noise of the velocities, leaves.
    """
    left = data.samples.tau - fitted.expected - fitted.kicked
    # what is five deviations off is cut: one outlier would be most of a variance
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
    derivative = columns.motion[0].speed_noise ** 2  # is in what differs, too
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
