"""Joint positions, velocities and torques of an arm in free motion: reading, and choice of usable samples."""

from itertools import pairwise
from pathlib import Path
from typing import Literal

import numpy as np

from pretouch.errors import CalibrationError, RecordingError
from pretouch.imported_data.log import PARQUET, TABLES, Choice, Log, check_reach
from pretouch.imported_data.reading import open_log
from pretouch.recording.reader import open_recording
from pretouch.robot.model import RobotModel
from pretouch.sim.observer import observe, observer_init
from pretouch.traces import JointTrace
from pretouch.types import BoolArray, FloatArray
from pretouch.values import value

Sign = Literal["on-robot", "by-robot"]

LEAST_S = 20.0
"""Shortest free motion [s]: the fit needs it to separate noise from friction."""
_LEAST_MOVED_RAD = 0.1
"""Least motion of a joint in a recording of a moving arm [rad]."""
_GAP_PERIODS, _BRIDGED_S = 3.5, 0.1
"""Longest time between two samples without a gap, in periods and in seconds; shorter breaks are interpolated."""
_LEAST_STRETCH_S = 1.0
_HIGHEST_HZ = 250.0
"""Highest rate [Hz]: more samples are left out, as the observer's low-pass removes faster signals."""
_LOWEST_HZ, _LEAST_OBSERVED_HZ = 40.0, 400.0
"""Least rates of samples, and of measured torques for an observer [Hz]."""
_OBSERVER_GAIN_1_S = 60.0
"""Gain of that observer [1/s]."""


@value
class ArmSamples(JointTrace):
    """Motion and torques reported by an arm with n joints. T samples."""

    qd: FloatArray | None
    """(T, n) measured joint velocities [rad/s] of the same instants; None without velocities."""
    tau: FloatArray
    """(T, n) estimated external torques on the robot by its environment [Nm]."""

    def numbers(self) -> list[FloatArray]:
        """Return all measured arrays (T, n)."""
        return [each for each in (self.q, self.tau, self.qd) if each is not None]


def read_free_motion(
    place: Path, model: RobotModel | None, sign: Sign = "on-robot"
) -> tuple[ArmSamples, RobotModel, str]:
    """Read a recording; return samples, the arm, and a sentence on their source.

    Args:
        place: a recording of Pretouch, or a CSV or Parquet file with time_s, q1_rad ..., optionally dq1_rad_s ..., and
            tau_ext1_Nm ... (external torques) or tau1_Nm ... (measured torques, gravity in them).
        model: the arm; None: the arm of the recording, or a Panda.
        sign: sign of the torques of a CSV file.

    Raises:
        RecordingError: for an unreadable or ambiguous recording, with the way out.
    """
    if place.suffix.lower() in (*TABLES, PARQUET):
        log = open_log(place, Choice(arm=model or "auto")).torques()
        arm = log.model
        samples, sentence = _of_table(log, sign)
    else:
        recorded = open_recording(place)
        arm, states = recorded.runs[0].model, [cycle.inputs.robot for cycle in recorded if cycle.inputs]
        if model is not None and model.description.name != arm.description.name:
            raise RecordingError(
                f"{place} is of {arm.description.name}, and --arm is {model.description.name}: omit --arm."
            )
        if not states:
            raise RecordingError(f"{place} holds no state of the robot: give another recording.")
        names = ("stamp", "q", "qd", "tau_ext")
        received = ArmSamples(*(np.array([getattr(state, name) for state in states]) for name in names))
        samples = received.at(np.append(True, np.diff(received.stamp) > 0.0))  # a repeated state counts once
        sentence = f"{place}: states of {arm.description.name} as the controller had them"
    if samples.q.shape[1] == arm.n:  # `identify` raises the error for other numbers
        check_reach(place, samples.q, arm)
    return samples, arm, sentence


def _of_table(log: Log, sign: Sign) -> tuple[ArmSamples, str]:
    time, q, qd = log.time / 1e9, log.arrays["q"], log.arrays.get("dq")
    if "tau_ext" in log.arrays:
        on_robot = sign == "on-robot"
        sentence = f"{log.place}: external torques, taken as {'on' if on_robot else 'by'} the robot (--sign)"
        return ArmSamples(time, q, qd, (1.0 if on_robot else -1.0) * log.arrays["tau_ext"]), sentence
    if "tau" not in log.arrays:
        raise RecordingError(f"{log.place} has motor currents: give torques, tau1_Nm and so on, in their place.")
    tau, period = log.arrays["tau"], float(np.median(np.diff(time)))
    if qd is None or period > 1.0 / _LEAST_OBSERVED_HZ or not np.isfinite(np.hstack([q, qd, tau])).all():
        raise RecordingError(
            f"{log.place} has measured torques: an observer over them needs velocities as well, {_LEAST_OBSERVED_HZ:g}"
            " Hz or more, and numbers throughout. Give external torques (tau_ext1_Nm ...), or such a recording."
        )
    state, external = observer_init(log.model.mass_matrix(q[0]), qd[0]), np.zeros_like(tau)
    for i in range(len(time)):
        mass, bias = log.model.mass_matrix_and_bias(q[i], qd[i], np.empty(log.model.n))
        state = observe(state, mass, bias, qd[i], tau[i], _OBSERVER_GAIN_1_S, period)
        external[i] = state.residual
    sentence = f"{log.place}: an observer of {_OBSERVER_GAIN_1_S:g} 1/s over measured torques"
    return ArmSamples(time, q, qd, external), sentence


@value
class Usable:
    """Samples of stretches without a gap, one stretch after the other."""

    samples: ArmSamples
    stretches: tuple[slice, ...]
    notes: tuple[str, ...]
    """Sentences on samples that are left out."""

    @property
    def period(self) -> float:
        """Median time between two samples [s]."""
        return float(np.median(np.diff(self.samples.stamp)))


def usable(samples: ArmSamples) -> Usable:
    """Leave out samples that are not finite or too frequent, and split the rest at gaps.

    Raises CalibrationError for a recording that is too short or too slow, or of a standing arm.
    """
    notes: list[str] = []

    def chosen(of: ArmSamples, which: BoolArray, why: str) -> ArmSamples:
        if not which.all():
            notes.append(f"{int((~which).sum())} of {len(which)} samples {why}, and are left out.")
        return of.at(which)

    finite = np.all([np.isfinite(each).all(axis=1) for each in samples.numbers()], axis=0)
    samples = chosen(samples, finite & np.isfinite(samples.stamp), "are not finite numbers")
    if len(samples.stamp) < 2:
        raise CalibrationError("There are no two samples with numbers for all joints: give another recording.")
    later = np.append(np.diff(np.maximum.accumulate(samples.stamp)) > 0.0, True)
    samples = chosen(samples, later, "do not come after the one before them")
    turned = np.ptp(samples.q, axis=0).max()
    if turned >= _LEAST_MOVED_RAD:  # equal states of a moving arm are repeated reports
        new = np.any([(np.diff(each, axis=0) != 0.0).any(axis=1) for each in samples.numbers()], axis=0)
        samples = chosen(samples, np.append(True, new), "repeat the one before them")
    rate = 1.0 / float(np.median(np.diff(samples.stamp)))
    if rate < _LOWEST_HZ:
        raise CalibrationError(
            f"The samples come at {rate:.3g} Hz, and the output of an observer changes within 20 ms: record at"
            f" {_LOWEST_HZ:g} Hz or more."
        )
    every = int(np.ceil(rate / _HIGHEST_HZ - 0.05))  # stamps are not exact
    samples = chosen(samples, np.arange(len(samples.stamp)) % every == 0, f"are more than {_HIGHEST_HZ:g} a second")
    period = float(np.median(np.diff(samples.stamp)))
    breaks = np.flatnonzero(np.diff(samples.stamp) > max(_GAP_PERIODS * period, _BRIDGED_S)) + 1
    edges = [(a, b) for a, b in pairwise([0, *breaks.tolist(), len(samples.stamp)])]
    edges = [(a, b) for a, b in edges if (b - a) * period >= _LEAST_STRETCH_S]
    seconds = sum(b - a for a, b in edges) * period
    if len(breaks):
        notes.append(f"There are {len(breaks)} gaps; each stretch of {_LEAST_STRETCH_S:g} s or more is used by itself.")
    if seconds < LEAST_S:
        raise CalibrationError(
            f"There are {seconds:.1f} s without a gap: record {LEAST_S:g} s or more of free motion, two minutes for"
            " good numbers."
        )
    if turned < _LEAST_MOVED_RAD:
        raise CalibrationError(
            f"The arm stands: no joint turns by more than {turned:.2g} rad. Friction, masses and ripple show only in"
            f" motion: record an arm whose joints turn by {_LEAST_MOVED_RAD:g} rad or more."
        )
    ends = np.cumsum([0, *(b - a for a, b in edges)]).tolist()
    samples = samples.at(np.concatenate([np.arange(a, b) for a, b in edges]))
    return Usable(samples, tuple(slice(a, b) for a, b in pairwise(ends)), tuple(notes))


def joint_scale(left: FloatArray) -> FloatArray:
    """Robust standard deviation (n,) of samples (N, n)."""
    return np.asarray(1.4826 * np.median(np.abs(left - np.median(left, axis=0)), axis=0)) + 1e-6
