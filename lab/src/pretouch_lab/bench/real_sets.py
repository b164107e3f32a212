"""Public sets of recordings of real arms: source, columns and external torques of each.

The torques are those of the product's observer, less load and friction as estimated from half of the runs.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from hashlib import file_digest, sha256
from pathlib import Path
from typing import Literal
from zipfile import BadZipFile

import numpy as np
from scipy.signal import lfilter

from pretouch.errors import ExperimentError
from pretouch.imported_data.log import Choice, Log
from pretouch.imported_data.torques import TorqueRecording, observed, torque_recording
from pretouch.params import SequentialParams
from pretouch.robot import description
from pretouch.robot.description import robot_named
from pretouch.robot.model import RobotModel
from pretouch.types import BoolArray, FloatArray, IntArray
from pretouch.values import value

_APART_S = 1.0
"""Time between two runs of a stream [s]: longer than the observer's memory and the end of a contact."""
_COULOMB_RAD_S = 0.05
"""Range of joint velocity in which Coulomb friction changes its sign [rad/s]."""
_MADE_UP_S = 0.5
"""End of a filtered run [s]: 0.4 s before it velocities are still wrong by 0.1 rad/s, at the end by 0.6 to 1.4."""
_SHARED_NM = 1e-9
"""Least sum of squared torques of a load [Nm^2]."""


@value
class RealRun:
    """One recording: N samples of n joints, in the order of time."""

    time: FloatArray
    """(N,) [s]."""
    q: FloatArray
    """(N, n) [rad]."""
    qd: FloatArray
    """(N, n) [rad/s]."""
    torque: FloatArray
    """(N, n) torque that drives the joints, gravity included [Nm]."""
    label: IntArray
    """(N,) 1 in a contact, 0 in free motion, -1 if uncertain."""
    joints: tuple[int, ...] = ()
    """Numbers, from 1, of the last joint before the touched link, several if uncertain; () for an unnamed link."""

    def part(self, which: slice | BoolArray) -> "RealRun":
        """Return some of the samples."""
        time, label = self.time[which], self.label[which]
        return RealRun(time, self.q[which], self.qd[which], self.torque[which], label, self.joints)


@dataclass(frozen=True)
class RealSet:
    """A public set of recordings."""

    name: str
    arm: str
    """panda, or the name of a folder in `arms`."""
    place: str
    """Pattern of its files below the folder of all sets."""
    source: str
    read: Callable[[list[Path]], list[RealRun]]
    kind: Literal["tau", "current"] = "tau"
    """Torques, or motor currents, which contain the friction of the gears."""

    def files(self, folder: Path) -> list[Path]:
        """Return the set's files in a folder."""
        return sorted(folder.glob(self.place))

    def arm_of(self, folder: Path) -> str:
        """Return the arm's name for `robot_named`."""
        return self.arm if self.arm == "panda" else str(folder / "arms" / self.arm)


_BY_NAME = {"2link": (2,), "3link": (3,), "wrist": (4, 5, 6)}
"""Joints of the touched link by a part of a run's name, for the UR10e."""
_GLOVE = ("time", *(f"{name}{joint}" for name in ("q", "dq", "tau_J") for joint in range(7)), "label")
"""Columns to read; joints count from 0."""


def _of_arrays(files: list[Path]) -> list[RealRun]:
    """Read a file of NumPy arrays t, q, dq, tau and run; label, ok and run_name are optional."""
    try:
        with np.load(files[0], allow_pickle=False) as stored:
            data = {name: stored[name] for name in stored.files}
    except (ValueError, OSError, BadZipFile) as error:
        raise ExperimentError(f"{files[0]} is no file of NumPy arrays ({error}): get it again.") from error
    if missing := {"t", "q", "dq", "tau", "run"} - set(data):
        raise ExperimentError(f"{files[0]} has no {', '.join(sorted(missing))}: get it again, or remove it.")
    label, runs = data.get("label", np.zeros(len(data["t"]), np.int64)), []
    for number in np.unique(data["run"]):
        # samples that the logger missed are interpolated in the file: without them the observer steps over the gap
        own = (data["run"] == number) & data.get("ok", np.True_)
        name = str(data["run_name"][number]) if "run_name" in data else ""
        joints = next((joints for part, joints in _BY_NAME.items() if part in name), ())
        runs.append(_run([data[key][own] for key in ("t", "q", "dq", "tau")], label[own], joints))
    return runs


def _of_filtered(files: list[Path]) -> list[RealRun]:
    """Read such arrays that a filter without delay has smoothed: at a run's end it makes up velocities and torques."""
    return [run.part(run.time < run.time[-1] - _MADE_UP_S) for run in _of_arrays(files)]


def _of_glove(files: list[Path]) -> list[RealRun]:
    """Read tables of contactInterpretation, one for each contact place and motion, in a folder for each link.

    The measured torques `tau_J` go through our own observer. The external torques `tau_ext` of the files are not used:
    their sign is not documented. In two files they act from the robot on its environment.
    """
    runs = []
    for file in files:
        with file.open(encoding="utf-8") as lines:
            names = lines.readline().strip().split(",")
            if missing := [name for name in _GLOVE if name not in names]:
                raise ExperimentError(f"{file} has no column {missing[0]}: get it again, or remove it.")
            table = np.loadtxt(lines, delimiter=",", usecols=[names.index(name) for name in _GLOVE], ndmin=2)
        parts, link = np.split(table, (1, 8, 15, 22), axis=1), file.parent.name.removeprefix("link")
        joints = (int(link),) if link.isdecimal() else ()
        runs.append(_run([parts[0][:, 0], *parts[1:4]], table[:, -1], joints))
    return runs


def _run(parts: list[FloatArray], label: FloatArray, joints: tuple[int, ...]) -> RealRun:
    """Return a run without samples that are not finite or not later than those before."""
    time, q, qd, torque = (np.asarray(part, np.float64) for part in parts)
    finite = np.isfinite(np.column_stack([time, q, qd, torque])).all(axis=1)
    latest = np.maximum.accumulate(np.where(finite, time, -np.inf))
    usable = finite & np.append(np.True_, time[1:] > latest[:-1])
    return RealRun(time, q, qd, torque, label.astype(np.int64), joints).part(usable)


_GLOVE_SOURCE = "rezayati/contactInterpretation, the folders dataset/franka_main/labeled_data/link*"
SETS = (
    RealSet("franka_fast", "panda", "franka_fast.npz", "alisrour97/Franka_experiments", _of_arrays),
    RealSet("lwr4", "lwr4", "lwr4.npz", "kjyv/FloBaRoID", _of_filtered),
    RealSet(
        "rokae_yl", "xmate", "rokae_yl.npz", "YanjunLIU-ac/Dynamic_Parameter_Identification_for_Rokae_xMate", _of_arrays
    ),
    RealSet("ur10e_contact", "ur10e", "ur10e_contact.npz", "shamilmamedov/dynamic_calibration", _of_arrays, "current"),
    RealSet("ur3_joints", "ur3", "ur3_joints.npz", "PedroSaman/UR3-Modelation", _of_arrays, "current"),
    RealSet("contactInterpretation", "panda", "contactInterpretation/link*/*.csv", _GLOVE_SOURCE, _of_glove),
)
"""All sets. None is part of this package: their repositories on GitHub state no licence, or LGPL-3."""


def sets_in(folder: Path) -> tuple[list[RealSet], list[str]]:
    """Return the sets of a folder whose arms are there too, and a sentence for each set without its arm.

    Raises ExperimentError if no set is left.
    """
    there = [each for each in SETS if each.files(folder)]
    usable = [each for each in there if each.arm == "panda" or Path(each.arm_of(folder)).is_dir()]
    missing = [
        f"{each.name} is left out, for {each.arm_of(folder)} is missing: create it with `pretouch robot import`."
        for each in there
        if each not in usable
    ]
    if not usable:
        every = "; ".join(f"{each.place} (github.com/{each.source})" for each in SETS)
        raise ExperimentError(" ".join([f"{folder} has no set that can be played. The sets are {every}.", *missing]))
    return usable, missing


def files_digest(sets: Sequence[RealSet], folder: Path) -> str:
    """Return the SHA-256 of the files and arms of some sets."""
    whole = sha256()
    for each in sets:
        for file in each.files(folder):
            with file.open("rb") as data:
                whole.update(f"{file.relative_to(folder)} {file_digest(data, 'sha256').hexdigest()} ".encode())
        whole.update(description.files_digest(robot_named(each.arm_of(folder))).encode())
    return whole.hexdigest()


@value
class TorqueStream:
    """Runs in one recording, one after the other. M samples of n joints."""

    recording: TorqueRecording
    label: IntArray
    """(M,) labels, see `RealRun`."""
    run: IntArray
    """(M,) number in the set of each sample's run."""
    load: FloatArray
    """(M, n) change of the external torques by a mass of 1 kg at the end-effector [Nm]."""

    def only(self, runs: Sequence[int]) -> "TorqueStream":
        """Return a stream of some runs, in this order."""
        r, parts = self.recording, [np.flatnonzero(self.run == number) for number in runs]
        at, time = np.concatenate(parts), _laid([r.time[part] for part in parts])
        some = {name: getattr(r, name)[at] for name in ("q", "qd", "qd_commanded", "tau_ext")}
        return TorqueStream(replace(r, time=time, **some), self.label[at], self.run[at], self.load[at])


def _laid(times: Sequence[FloatArray]) -> FloatArray:
    """Return the instants of runs (N,) [s] shifted one after the other, `_APART_S` apart."""
    begin, laid = 0.0, []
    for time in times:
        laid.append(time - time[0] + begin)
        begin = float(laid[-1][-1]) + _APART_S
    return np.concatenate(laid)


def stream_of(real: RealSet, runs: Sequence[RealRun], model: RobotModel) -> TorqueStream:
    """Compute the external torques of all runs of a set, as `pretouch detect` does."""
    arrays = {"q": [r.q for r in runs], "dq": [r.qd for r in runs], real.kind: [r.torque for r in runs]}
    joints = {name: np.concatenate(parts) for name, parts in arrays.items()}
    stamps = np.round(_laid([run.time for run in runs]) * 1e9).astype(np.int64)
    rows, sources = np.arange(len(stamps)), dict.fromkeys(joints, real.name)
    log = Log(Path(real.name), model, stamps, rows, "row {}", joints, sources).in_order(*joints)
    r = torque_recording(log, Choice(gains=(1.0,) * model.n if real.kind == "current" else ()))
    loaded = observed(model, r.time, r.q, r.qd, log.arrays[real.kind], SequentialParams().observer_gain_1_s, 1.0)
    numbers = np.repeat(np.arange(len(runs)), [len(run.time) for run in runs])[log.rows]
    return TorqueStream(r, np.concatenate([run.label for run in runs])[log.rows], numbers, loaded - r.tau_ext)


def corrected(stream: TorqueStream, learnt: Sequence[int]) -> TorqueStream:
    """Subtract load, offsets and friction, estimated from the free motion of some runs.

    The model is one mass at the end-effector, and for each joint an offset, viscous and Coulomb friction. The fit is by
    least squares. The observer delays friction, so the fit uses delayed velocities.
    """
    r, gain = stream.recording, SequentialParams().observer_gain_1_s / stream.recording.rate
    keep, joints = 1.0 / (1.0 + gain), range(r.model.n)
    free = (stream.label == 0) & np.isfinite(r.tau_ext).all(axis=1) & np.isin(stream.run, learnt)
    turning = (r.qd, np.tanh(r.qd / _COULOMB_RAD_S))
    delayed = [lfilter([1.0 - keep], [1.0, -keep], values, axis=0) for values in turning]
    friction = np.stack([np.ones_like(r.qd), *delayed], axis=2)
    inverse = [np.linalg.pinv(friction[free, j]) for j in joints]

    def explained(torques: FloatArray) -> FloatArray:
        """Return the part of torques (M, n) [Nm] that friction explains, fitted in free motion."""
        return np.stack([friction[:, j] @ (inverse[j] @ torques[free, j]) for j in joints], axis=1)

    # first the mass, from what friction does not explain; then friction, from the rest
    torque, load = (whole[free] - explained(whole)[free] for whole in (r.tau_ext, stream.load))
    mass = -float((torque * load).sum() / max((load**2).sum(), _SHARED_NM))
    left = r.tau_ext + mass * stream.load
    return replace(stream, recording=replace(r, tau_ext=left - explained(left)))
