"""Recordings of any arm's joint torques: read, checked, and brought to external torques on the robot."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from pretouch.errors import RecordingError
from pretouch.imported_data.joint_source import JointSource, read_joint_table
from pretouch.imported_data.observed import observed
from pretouch.imported_data.samples import check_exists, is_table
from pretouch.imported_data.source import Choice, Series, check_reach, in_order
from pretouch.imported_data.torque_checks import check_positions, check_torques, check_velocities
from pretouch.imported_data.velocities import GAP_S, smoothed, velocities
from pretouch.params import SequentialParams
from pretouch.robot.model import RobotModel
from pretouch.robot.named import robot_named
from pretouch.types import FloatArray, IntArray
from pretouch.values import value

_LEAST_HZ = 40.0
"""Rate below which nothing is detected [Hz]."""
_WHAT = {
    "tau_ext": "external torques", "tau": "measured torques, less the model's by an observer of ours",
    "current": "motor currents times their gains, less the model's torques by an observer of ours",
}  # fmt: skip


@value
class TorqueRecording:
    """An arm's motion and the external torques on it. N samples of n joints, in the order of time."""

    place: Path
    said: str
    """What was read, and what was assumed of it, as a sentence."""
    model: RobotModel
    first_s: float
    """Instant of the first sample on the recording's clock [s]."""
    time: FloatArray
    """(N,) since then [s]."""
    q: FloatArray
    """(N, n) [rad]."""
    qd: FloatArray
    """(N, n) [rad/s]."""
    qd_commanded: FloatArray
    """(N, n) [rad/s]; where the recording has none, the measured ones smoothed."""
    tau_ext: FloatArray
    """(N, n) on the robot by its environment [Nm], NaN where there is none."""
    of_currents: bool
    """Whether motor currents were measured, with the friction of the gears in them."""
    notes: tuple[str, ...]
    """What was found on the way and a person should know, a sentence each."""

    @property
    def rate(self) -> float:
        """Median rate of the samples [Hz]."""
        return float(1.0 / np.median(np.diff(self.time)))


def read_torques(place: Path, choice: Choice) -> TorqueRecording:
    """Read a recording of joint positions and torques. RecordingError for what cannot be used, with the way out."""
    check_exists(place)
    if is_table(place):
        source = read_joint_table(place, choice)
    else:
        from pretouch.imported_data.joint_bag import read_joint_bag

        source = read_joint_bag(place, choice)
    arm = source.arm if choice.arm == "auto" else choice.arm
    model = RobotModel(robot_named("panda" if arm == "auto" else arm))
    ordered = source.ordered(model.joints)
    if ordered.names and ordered.names != model.joints:
        note = f"The joints are named otherwise than the arm's, and taken in the order {', '.join(ordered.names)}."
        ordered = replace(ordered, notes=(*ordered.notes, note))
    return torque_recording(place, ordered, model, choice)


def torque_recording(place: Path, source: JointSource, model: RobotModel, choice: Choice) -> TorqueRecording:
    """Check what was read against an arm's model, and make external torques on the robot of it."""
    kind, n = source.torque, source.joints["q"].shape[1]
    if n != model.n:
        raise RecordingError(
            f"{place} has {n} joints, and {model.description.name} has {model.n}: choose another --arm, a name or the"
            " folder that `pretouch robot import` wrote."
        )
    if kind == "current" and len(choice.gains) != n:
        raise RecordingError(
            f"{place} has currents of {n} motors and {len(choice.gains)} gains: give --gains, {n} torques by current in"
            " Nm/A, separated by commas."
        )
    if choice.gains and kind != "current":
        raise RecordingError(f"{place} has torques, and --gains is for motor currents (current1_A ...): leave it out.")
    time, parts, notes = _usable(place, source)
    q, stamp = parts["q"], (time - time[0]) / 1e9
    check_positions(place, q, model)
    check_reach(place, q, model)
    qd = parts.get("dq", velocities(stamp, q))
    notes += check_velocities(place, stamp, q, qd) if "dq" in parts else ("Velocities are those of positions.",)
    sign = -1.0 if choice.sign == "by-robot" or (choice.sign == "auto" and source.by_robot) else 1.0
    torque = sign * parts[kind] * (np.array(choice.gains) if kind == "current" else 1.0)
    check_torques(place, q, qd, torque, model, kind != "tau_ext", choice.payload_kg)
    if kind != "tau_ext":
        torque = observed(model, stamp, q, qd, torque, SequentialParams().observer_gain_1_s, choice.payload_kg)
    elif choice.payload_kg:
        raise RecordingError(f"{place} has external torques, which --payload does not change: tell the robot its load.")
    if "dq_d" not in parts:
        notes += ("There are no commanded velocities (dq_d1_rad_s ...): the measured ones, smoothed, stand in.",)
    qd_commanded = parts.get("dq_d", smoothed(stamp, qd))
    said = (
        f"{_WHAT[kind].capitalize()}, from {source.said}, {_whose(kind, sign)} The arm is assumed to be"
        f" {model.description.name} (--arm)."
    )
    return TorqueRecording(
        place, said, model, time[0] / 1e9, stamp, q, qd, qd_commanded, torque, kind == "current", source.notes + notes
    )


def _whose(kind: str, sign: float) -> str:
    if kind != "tau_ext":
        return f"assumed to {'drive' if sign > 0 else 'brake'} the joints (otherwise --sign)."
    whose, other = ("on", "by-robot") if sign > 0 else ("by", "on-robot")
    return f"assumed to be {whose} the robot (otherwise --sign {other})."


def _usable(place: Path, source: JointSource) -> tuple[IntArray, dict[str, FloatArray], tuple[str, ...]]:
    """Instants [ns] in order, and what was measured then; samples that are not numbers are left out."""
    kinds = [*source.joints]
    whole = Series(source.time, np.hstack([source.joints[kind] for kind in kinds]))
    finite = np.isfinite(whole.values).all(axis=1)
    without = int(np.count_nonzero(~finite))
    said = "1 sample is" if without == 1 else f"{without} samples are"
    notes = (f"{said} not finite numbers and left out.",) if without else ()
    series, more = in_order(Series(whole.time[finite], whole.values[finite]), "Joints")
    if len(series) < 2:
        raise RecordingError(f"{place} has {len(series)} samples of all joints: give a longer recording.")
    rate = 1e9 / float(np.median(np.diff(series.time)))
    if rate < _LEAST_HZ:
        raise RecordingError(
            f"The samples of {place} come at {rate:.3g} Hz: record at {_LEAST_HZ:g} Hz or more, or check the unit of"
            " the time."
        )
    long = np.diff(series.time) / 1e9
    if (gaps := long[long > GAP_S]).size:
        many = "A gap" if len(gaps) == 1 else f"{len(gaps)} gaps"
        more += (f"{many} of more than {GAP_S:g} s, {gaps.sum():.2f} s in all: what comes after begins anew.",)
    parts = np.split(series.values, len(kinds), axis=1)
    return series.time, dict(zip(kinds, parts, strict=True)), notes + more
