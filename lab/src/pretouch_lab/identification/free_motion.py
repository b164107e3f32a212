"""Joint positions, velocities and torques of an arm in free motion, from a recording of ours or a CSV file."""

import re
from pathlib import Path
from typing import Literal

import numpy as np

from pretouch.contact.observer import observe, observer_init
from pretouch.errors import RecordingError
from pretouch.imported_data.csv import read_header, read_table
from pretouch.imported_data.renaming import listed
from pretouch.imported_data.samples import TABLES
from pretouch.imported_data.source import check_reach
from pretouch.recording.reader import open_recording
from pretouch.robot.description import panda
from pretouch.robot.model import RobotModel
from pretouch.types import FloatArray
from pretouch_lab.identification.samples import ArmSamples

Sign = Literal["on-robot", "by-robot"]

_COLUMN = re.compile(r"(q|qd|tau_ext|tau)(\d{1,2})_(rad|rad_s|deg|deg_s|nm)")
_UNITS = {"q": {"rad": 1.0, "deg": np.pi / 180}, "qd": {"rad_s": 1.0, "deg_s": np.pi / 180}}
_TIMES = {"time_s": 1.0, "time_ms": 1e-3, "time_us": 1e-6, "time_ns": 1e-9}
_LEAST_OBSERVED_HZ = 400.0
"""Rate at which measured torques have to come for an observer to be run over them [Hz]."""


def read_free_motion(
    place: Path, model: RobotModel | None, sign: Sign = "on-robot", gain: float = 60.0
) -> tuple[ArmSamples, RobotModel, str]:
    """Read a recording; return samples, the arm, and what was taken from where as a sentence.

    Args:
        place: a recording of ours, or a CSV file with time_s, q1_rad ..., perhaps qd1_rad_s ..., and tau_ext1_Nm ...
            (external torques) or tau1_Nm ... (measured torques, gravity in them).
        model: the arm; None: what the recording says, or a Panda.
        sign: whose torques those of a CSV file are.
        gain: of the observer that is run over measured torques [1/s].

    Raises:
        RecordingError: for what cannot be read, and for what is not clear, with the way out.
    """
    if place.suffix.lower() in TABLES:
        arm = model or RobotModel(panda())
        samples, said = _of_csv(place, arm, -1.0 if sign == "by-robot" else 1.0, gain)
    else:
        recorded = open_recording(place)
        arm, kept = recorded.runs[0].model, list(recorded.robot_states())
        if model is not None and model.description.name != arm.description.name:
            raise RecordingError(
                f"{place} is of {arm.description.name}, and --arm is {model.description.name}: leave out --arm."
            )
        if not kept:
            raise RecordingError(f"{place} holds no state of the robot: give another recording.")
        states = ([r.stamp for r in kept], [r.q for r in kept], [r.qd for r in kept], [r.tau_ext for r in kept])
        received = ArmSamples(*(np.array(column) for column in states))
        samples = received.at(np.append(True, np.diff(received.stamp) > 0.0))  # a repeated state counts once
        said = f"{place}: states of {arm.description.name} as the controller had them"
    if samples.q.shape[1] == arm.n:  # `identify` says it otherwise
        check_reach(place, samples.q, arm)
    return samples, arm, said


def _of_csv(place: Path, model: RobotModel, sign: float, gain: float) -> tuple[ArmSamples, str]:
    rows, names = read_header(place, "time_s,q1_rad,tau_ext1_Nm and so on")
    lower = [name.lower() for name in names]
    times = [i for i, name in enumerate(lower) if name in _TIMES]
    if len(times) != 1:
        raise RecordingError(f"{place} has {len(times)} columns of time (it has {listed(names)}): give one, as time_s.")
    at: dict[str, dict[int, tuple[int, float]]] = {}
    for i, name in enumerate(lower):
        found = _COLUMN.fullmatch(name)
        if found and found[3] in _UNITS.get(found[1], {"nm": 1.0}):
            at.setdefault(found[1], {})[int(found[2])] = (i, _UNITS.get(found[1], {"nm": 1.0})[found[3]])
    torque = "tau_ext" if "tau_ext" in at else "tau"
    for what, unit in (("q", "rad"), (torque, "Nm")):
        if set(at.get(what, {})) != set(range(1, model.n + 1)):
            raise RecordingError(
                f"{place} has {len(at.get(what, {}))} columns of {what} (it has {listed(names)}), and"
                f" {model.description.name} has {model.n} joints: give {what}1_{unit} to {what}{model.n}_{unit}, or"
                " another --arm."
            )
    if "qd" in at and set(at["qd"]) != set(at["q"]):
        raise RecordingError(
            f"{place} has velocities of {len(at['qd'])} joints only: give qd1_rad_s to qd{model.n}_rad_s."
        )
    places = [(times[0], _TIMES[lower[times[0]]])]
    for what in ("q", torque, *(["qd"] if "qd" in at else [])):
        places += [at[what][j] for j in range(1, model.n + 1)]
    table, _, _ = read_table(place, rows, names, dict(places))
    n = model.n
    q, tau, qd = table[:, 1 : 1 + n], table[:, 1 + n : 1 + 2 * n], table[:, 1 + 2 * n :]
    speeds = qd if "qd" in at else None
    if torque == "tau":
        tau = _observed(place, model, table[:, 0], q, speeds, tau, gain)
        return ArmSamples(table[:, 0], q, speeds, tau), f"{place}: an observer of {gain:g} 1/s over measured torques"
    said = f"{place}: external torques, taken as {_whose(sign)} (--sign)"
    return ArmSamples(table[:, 0], q, speeds, sign * tau), said


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
