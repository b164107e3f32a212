"""From samples of an arm in free motion to what kind of arm it is, with standard errors."""

import numpy as np

from pretouch.errors import CalibrationError
from pretouch.robot.model import RobotModel
from pretouch.sim.plant_params import PlantParams
from pretouch.types import BoolArray, FloatArray
from pretouch.values import value
from pretouch_lab.identification.fit import OWN, Fit, columns_of, fit
from pretouch_lab.identification.motion import moved
from pretouch_lab.identification.noise import Noise, free_samples, noise_of
from pretouch_lab.identification.samples import LEAST_S, ArmSamples, usable

_ROUNDS = 3
_KNOWN = 0.5
"""A number is identified where its standard error is below this part of what was known before [1]."""
_MOST_MASS_ERROR = 0.5
"""A link whose mass seems to be off by more than this, beyond doubt, is another arm's [1]."""


@value
class Identified:
    """What a recording of free motion tells of an arm with n joints."""

    fit: Fit
    noise: Noise
    time: FloatArray
    """(N,) instants of the samples used or left out [s]."""
    q: FloatArray
    """(N, n) [rad]."""
    tau: FloatArray
    """(N, n) what was to be explained [Nm]."""
    used: BoolArray
    """(N,) samples taken for free motion."""
    spans: tuple[tuple[float, float], ...]
    """From when to when something looked like a contact [s]."""
    notes: tuple[str, ...]
    seconds: float
    """Free motion that was used [s]."""
    usual: PlantParams
    """The arm as it is taken to be without a recording."""

    def known(self) -> BoolArray:
        """Which of the fit's numbers (p,) the recording tells: the error is well below what was believed before."""
        return np.asarray(self.fit.errors < _KNOWN * self.fit.priors)

    def ripple(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Amplitudes (n,) [Nm], their standard errors, and phases [rad], as the plant has them."""
        own, errors = self.fit.of_joints(self.fit.numbers), self.fit.of_joints(self.fit.errors)
        amplitude = np.hypot(own[:, 4], own[:, 5])
        return amplitude, np.hypot(errors[:, 4], errors[:, 5]) / np.sqrt(2.0), np.arctan2(own[:, 5], own[:, 4])


def identify(samples: ArmSamples, model: RobotModel, usual: PlantParams) -> Identified:
    """Identify an arm. CalibrationError for a recording that cannot tell, with what is missing."""
    if samples.q.shape[1] != model.n or samples.tau.shape[1] != model.n:
        raise CalibrationError(
            f"The recording has {samples.q.shape[1]} joints and {samples.tau.shape[1]} torques, and"
            f" {model.description.name} has {model.n} joints: give the arm it is of."
        )
    found, motions = moved(usable(samples))
    columns = columns_of(found, motions, model)
    cycles = np.array(usual.ripple_cycles)
    settled = used = columns.calm
    spans: tuple[tuple[float, float], ...] = ()
    if float(settled.sum()) * found.period < LEAST_S:
        raise CalibrationError(
            f"The arm's speed changes so often that {float(settled.sum()) * found.period:.1f} s of even motion are"
            f" left: record {LEAST_S:g} s or more along smooth paths, or slower."
        )
    for _ in range(_ROUNDS):
        fitted = fit(found, columns, used, usual, cycles)
        free, spans = free_samples(found, fitted)
        again = settled & free
        if np.array_equal(again, used):
            break
        used = again
    notes = [*found.notes]
    payload = OWN * model.n + model.n
    if fitted.numbers[payload] < 0.0:
        fitted = fit(found, columns, used, usual, cycles, payload=False)
        notes.append("The payload comes out below zero: it is kept at 0, and the masses of the links take the rest.")
    seconds = float(used.sum()) * found.period
    if seconds < LEAST_S:
        raise CalibrationError(
            f"Only {seconds:.1f} s of free motion are left without what looks like contacts: record {LEAST_S:g} s or"
            " more."
        )
    _check_arm(fitted, model)
    if spans:
        first = found.samples.stamp[0]
        listed = ", ".join(f"{a - first:.1f} to {b - first:.1f}" for a, b in spans[:8])
        notes.append(
            f"{len(spans)} spans look like contacts and are left out (seconds from the first sample): {listed}"
            f"{' and more' if len(spans) > 8 else ''}."
        )
    noise = noise_of(found, columns, fitted, used, usual)
    s = found.samples
    return Identified(
        fitted, noise, s.stamp, s.q, s.tau, used, spans, tuple(notes), seconds, usual
    )  # fmt: skip


def _check_arm(fitted: Fit, model: RobotModel) -> None:
    n = model.n
    mass, error = fitted.numbers[OWN * n : OWN * n + n], fitted.errors[OWN * n : OWN * n + n]
    far = np.flatnonzero(np.abs(mass) - 3.0 * error > _MOST_MASS_ERROR)
    if len(far):
        raise CalibrationError(
            f"The links behind {model.joints[far[0]]} would have masses off by {100 * mass[far[0]]:.0f} %: the"
            f" recording is of another arm than {model.description.name}, its torques have the other sign (--sign), or"
            " gravity is still in them."
        )
