"""External torques of a set's runs: the product's observer, less what half of the runs says of load and friction."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.signal import lfilter

from pretouch.imported_data.log import Choice, Log
from pretouch.imported_data.torques import TorqueRecording, observed, torque_recording
from pretouch.params import SequentialParams
from pretouch.robot.description import robot_named
from pretouch.robot.model import RobotModel
from pretouch.types import BoolArray, FloatArray, IntArray
from pretouch.values import value
from pretouch_lab.benchmarks.real.sets import RealSet, Run

_APART_S = 1.0
"""Time laid between runs [s]: more than what the observer and a contact's end take."""
_COULOMB_RAD_S = 0.05
"""Width of a joint's turning, over which Coulomb friction changes its sign [rad/s]."""
_SHARED_NM = 1e-9
"""Below it a load shows in no torque [Nm^2]."""


@value
class Stream:
    """Runs one after the other as one recording. M samples of n joints."""

    recording: TorqueRecording
    label: IntArray
    """(M,) as of `Run`."""
    run: IntArray
    """(M,) which run a sample is of, as its number in the set."""
    load: FloatArray
    """(M, n) what a mass of 1 kg at the end-effector changes of the external torques [Nm]."""

    def only(self, runs: Sequence[int]) -> "Stream":
        """Return some runs, in this order."""
        parts = [np.flatnonzero(self.run == number) for number in runs]
        at = np.concatenate(parts)
        r, begin, time = self.recording, 0.0, []
        for part in parts:
            time.append(r.time[part] - r.time[part[0]] + begin)
            begin = float(time[-1][-1]) + _APART_S
        kept = replace(
            r, time=np.concatenate(time), q=r.q[at], qd=r.qd[at], qd_commanded=r.qd_commanded[at], tau_ext=r.tau_ext[at]
        )
        return Stream(kept, self.label[at], self.run[at], self.load[at])

    @property
    def free(self) -> BoolArray:
        """(M,) whether nobody touches the arm and its torques are known."""
        return np.asarray((self.label == 0) & np.isfinite(self.recording.tau_ext).all(axis=1))


def model_of(real: RealSet, folder: Path) -> RobotModel:
    """Return the arm of a set."""
    return RobotModel(robot_named(real.arm_of(folder)))


def stream_of(real: RealSet, runs: Sequence[Run], model: RobotModel) -> Stream:
    """Bring all runs of a set to external torques, as `pretouch detect` does."""
    begin, time = 0.0, []
    for run in runs:
        time.append(run.time - run.time[0] + begin)
        begin = float(time[-1][-1]) + _APART_S
    kind = "current" if real.of_currents else "tau"
    arrays = {"q": [r.q for r in runs], "dq": [r.qd for r in runs], kind: [r.torque for r in runs]}
    joints = {name: np.concatenate(parts) for name, parts in arrays.items()}
    stamps = np.round(np.concatenate(time) * 1e9).astype(np.int64)
    log = Log(Path(real.name), model, stamps, joints, dict.fromkeys(joints, real.name))
    gains = (1.0,) * model.n if real.of_currents else ()
    r = torque_recording(log, Choice(gains=gains))
    loaded = observed(model, r.time, r.q, r.qd, joints[kind], SequentialParams().observer_gain_1_s, 1.0)
    numbers = np.repeat(np.arange(len(runs)), [len(run.time) for run in runs])
    return Stream(r, np.concatenate([run.label for run in runs]), numbers, loaded - r.tau_ext)


def corrected(stream: Stream, learnt: Sequence[int]) -> Stream:
    """Take away what the free motion of some runs tells of load, offsets and friction.

    One mass at the end-effector, and for each joint an offset, viscous and Coulomb friction, by least squares. The
    observer delays friction, so what explains it is delayed alike.
    """
    r, gain = stream.recording, SequentialParams().observer_gain_1_s / stream.recording.rate
    keep, fitted = 1.0 / (1.0 + gain), stream.free & np.isin(stream.run, learnt)
    friction = np.stack([np.ones_like(r.qd), *(
        lfilter([1.0 - keep], [1.0, -keep], values, axis=0) for values in (r.qd, np.tanh(r.qd / _COULOMB_RAD_S))
    )], axis=2)  # fmt: skip
    x, y, load = friction[fitted], r.tau_ext[fitted], stream.load[fitted]
    inverse = [np.linalg.pinv(x[:, j]) for j in range(r.model.n)]
    apart = [np.stack([v[:, j] - x[:, j] @ (inverse[j] @ v[:, j]) for j in range(r.model.n)]) for v in (y, load)]
    # the mass first, by what friction does not explain of either; then friction by what is left
    mass = -float((apart[0] * apart[1]).sum() / max((apart[1] ** 2).sum(), _SHARED_NM))
    left = r.tau_ext + mass * stream.load
    told = np.stack([friction[:, j] @ (inverse[j] @ left[fitted, j]) for j in range(r.model.n)], axis=1)
    return replace(stream, recording=replace(r, tau_ext=left - told))
