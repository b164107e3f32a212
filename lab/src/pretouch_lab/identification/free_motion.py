"""Joint positions, velocities and torques of an arm in free motion, from a recording of ours or a table."""

from pathlib import Path
from typing import Literal

import numpy as np

from pretouch.errors import RecordingError
from pretouch.imported_data.log import PARQUET, TABLES, Choice, Log, check_reach
from pretouch.imported_data.reading import open_log
from pretouch.recording.reader import open_recording
from pretouch.robot.model import RobotModel
from pretouch.sim.observer import observe, observer_init
from pretouch.types import FloatArray
from pretouch_lab.identification.samples import ArmSamples

Sign = Literal["on-robot", "by-robot"]

_LEAST_OBSERVED_HZ = 400.0
"""Rate at which measured torques have to come for an observer to be run over them [Hz]."""


def read_free_motion(
    place: Path, model: RobotModel | None, sign: Sign = "on-robot", gain: float = 60.0
) -> tuple[ArmSamples, RobotModel, str]:
    """Read a recording; return samples, the arm, and what was taken from where as a sentence.

    Args:
        place: a recording of ours, or a CSV or Parquet file with time_s, q1_rad ..., perhaps dq1_rad_s ..., and
            tau_ext1_Nm ... (external torques) or tau1_Nm ... (measured torques, gravity in them).
        model: the arm; None: what the recording says, or a Panda.
        sign: whose torques those of a CSV file are.
        gain: of the observer that is run over measured torques [1/s].

    Raises:
        RecordingError: for what cannot be read, and for what is not clear, with the way out.
    """
    if place.suffix.lower() in (*TABLES, PARQUET):
        log = open_log(place, Choice(arm=model or "auto")).torques()
        arm = log.model
        samples, said = _of_table(log, -1.0 if sign == "by-robot" else 1.0, gain)
    else:
        recorded = open_recording(place)
        arm, robot_states = recorded.runs[0].model, [cycle.inputs.robot for cycle in recorded if cycle.inputs]
        if model is not None and model.description.name != arm.description.name:
            raise RecordingError(
                f"{place} is of {arm.description.name}, and --arm is {model.description.name}: leave out --arm."
            )
        if not robot_states:
            raise RecordingError(f"{place} holds no state of the robot: give another recording.")
        names = ("stamp", "q", "qd", "tau_ext")
        received = ArmSamples(*(np.array([getattr(state, name) for state in robot_states]) for name in names))
        samples = received.at(np.append(True, np.diff(received.stamp) > 0.0))  # a repeated state counts once
        said = f"{place}: states of {arm.description.name} as the controller had them"
    if samples.q.shape[1] == arm.n:  # `identify` says it otherwise
        check_reach(place, samples.q, arm)
    return samples, arm, said


def _of_table(log: Log, sign: float, gain: float) -> tuple[ArmSamples, str]:
    time, q, qd = log.time / 1e9, log.arrays["q"], log.arrays.get("dq")
    if "tau_ext" in log.arrays:
        said = f"{log.place}: external torques, taken as {_whose(sign)} (--sign)"
        return ArmSamples(time, q, qd, sign * log.arrays["tau_ext"]), said
    if "tau" not in log.arrays:
        raise RecordingError(f"{log.place} has motor currents: give torques, tau1_Nm and so on, in their place.")
    tau = _observed(log.place, log.model, time, q, qd, log.arrays["tau"], gain)
    return ArmSamples(time, q, qd, tau), f"{log.place}: an observer of {gain:g} 1/s over measured torques"


def _whose(sign: float) -> str:
    return "on the robot" if sign > 0 else "by the robot"


def _observed(
    place: Path, model: RobotModel, time: FloatArray, q: FloatArray, qd: FloatArray | None, tau: FloatArray, gain: float
) -> FloatArray:  # fmt: skip
    """External torques (N, n) [Nm] by a momentum observer over measured ones."""
    period = float(np.median(np.diff(time)))
    if qd is None or period > 1.0 / _LEAST_OBSERVED_HZ or not np.isfinite(np.hstack([q, qd, tau])).all():
        raise RecordingError(
            f"{place} has measured torques: an observer over them needs velocities as well, {_LEAST_OBSERVED_HZ:g} Hz"
            " or more, and numbers throughout. Give external torques (tau_ext1_Nm ...), or such a recording."
        )
    state = observer_init(model.mass_matrix(q[0]), qd[0])
    found = np.zeros_like(tau)
    for i in range(len(time)):
        mass, bias = model.mass_matrix_and_bias(q[i], qd[i], np.empty(model.n))
        state = observe(state, mass, bias, qd[i], tau[i], gain, period)
        found[i] = state.residual
    return found
