"""A profile's detector on recorded joint torques, cycle by cycle as in the controller, on an arm without a skin."""

from dataclasses import replace
from typing import Any

import numpy as np

from pretouch.contact.detector import Body, Detection, Detector, Sample
from pretouch.contact.observer import wrench_from_torques
from pretouch.contact.window import WindowState, add_force, window_init
from pretouch.errors import RecordingError
from pretouch.imported_data.events import ContactEvent, Events
from pretouch.imported_data.torques import TorqueRecording
from pretouch.imported_data.velocities import pieces
from pretouch.perception.closest import no_obstacles
from pretouch.profiles import Profile
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.types import BoolArray, FloatArray, IntArray, RobotState
from pretouch.values import value

_NOTHING = no_obstacles()
MOVING_RAD_S = 0.02
"""Speed of any joint from which the arm moves [rad/s]."""
_DAMPING, _SINGULAR = 0.01, 0.02
"""Of the least squares by which a robot's interface makes a wrench of torques, and the smallest singular value of the
Jacobian at which it does."""


@value
class TorqueDecisions:
    """What a detector made of torques in S cycles."""

    name: str
    """The profile."""
    time: FloatArray
    """(S,) since the first sample [s]."""
    tau_ext: FloatArray
    """(S, n) external torques [Nm]."""
    residual: FloatArray
    """(S, n) what free motion does not explain of them [Nm], NaN without torques."""
    evidence: FloatArray
    """(S,) a contact from 1 on, while armed."""
    detectable_n: FloatArray
    """(S,) force at the end-effector that the detector says it finds, see `Detection.detectable_n` [N]."""
    armed: BoolArray
    moving: BoolArray
    """(S,) whether a joint turns."""
    contacts: tuple[ContactEvent, ...]

    @property
    def touched(self) -> BoolArray:
        """(S,) whether it is in a contact, or shortly before or after one."""
        found = np.zeros(len(self.time), np.bool_)
        for contact in self.contacts:
            found |= (self.time >= contact.time - 0.5) & (self.time <= contact.end + 0.5)
        return found


class Stream:
    """A recording as a profile's detector is given it."""

    def __init__(self, recording: TorqueRecording, profile: Profile) -> None:
        self.recording, self.profile, self.model = recording, profile, recording.model
        self.body = Body(self.model, Skin((), self.model), profile.task.control_period_s)
        self.detector: Detector = profile.detect.on(self.body)
        self.time, self.newest, self.first = _cycles(recording, self.body.period)
        if not np.isfinite(recording.tau_ext[self.newest]).all(axis=1).any():
            raise RecordingError(f"{recording.place} has no usable torques: give a longer recording without gaps.")

    def sample(self, cycle: int, window: WindowState) -> tuple[Sample, WindowState]:
        """Return a cycle's sample, and the force window with it."""
        r, i = self.recording, self.newest[cycle]
        kin, tau = self.model.kinematics(r.q[i]), r.tau_ext[i]
        J = self.model.ee_jacobian(kin)
        wrench = None if np.isnan(tau).any() else wrench_from_torques(J, tau, _DAMPING, _SINGULAR)
        robot = RobotState(self.time[cycle], r.q[i], r.qd[i], r.q[i], r.qd_commanded[i], tau, wrench)
        after = add_force(window, None if wrench is None else wrench[:3], self.profile.window)
        # watched: whoever gives the recording stands in for the skin that would tell when free motion can be learnt
        return Sample(robot.stamp, kin, robot, after, window.full, _NOTHING, watched=True), after

    def begun(self, before: Any, cycle: int) -> Any:
        """Return the detector's state at the first cycle with torques after a gap: what was learnt stays."""
        fresh = self.detector.init(self.body) if before is None else before
        learnt = self.detector.learnt(fresh)
        if learnt is None:
            return self.detector.init(self.body)
        speed = self.recording.qd_commanded[self.newest[cycle]]
        return self.detector.init(self.body, replace(learnt, speed=speed, filled=0, waiting=0))


def detect_torques(recording: TorqueRecording, profile: Profile) -> TorqueDecisions:
    """Let a profile's detector run over a recording at the profile's rate, the newest sample in each cycle."""
    stream = Stream(recording, profile)
    events = Events(recording.model, recording.place)
    found: list[Detection] = []
    state, window, waiting = None, window_init(profile.window.samples), True
    for cycle in range(len(stream.time)):
        sample, after = stream.sample(cycle, window)
        without = bool(np.isnan(sample.robot.tau_ext).any())
        waiting = waiting or bool(stream.first[cycle])
        if state is None or (waiting and not without):
            state, waiting = stream.begun(state, cycle), without
        window = after
        detection, state = stream.detector.step(state, stream.body, sample)
        events.add(float(stream.time[cycle]), detection)
        found.append(replace(detection, significant=None))
    qd = recording.qd_commanded[stream.newest]
    return TorqueDecisions(
        name=profile.name, time=stream.time, tau_ext=recording.tau_ext[stream.newest],
        residual=np.array([d.residual for d in found]), evidence=np.array([d.evidence for d in found]),
        detectable_n=np.array([d.detectable_n for d in found]),
        armed=np.array([d.armed for d in found]), moving=np.abs(qd).max(axis=1) > MOVING_RAD_S,
        contacts=events.all(),
    )  # fmt: skip


def forces(recording: TorqueRecording, period: float) -> tuple[FloatArray, FloatArray]:
    """Forces (S, 3) [N] that a robot's interface would make of the torques, NaN where it has none, at instants [s]."""
    time, newest, _ = _cycles(recording, period)
    found = np.full((len(time), 3), np.nan)
    for k, i in enumerate(newest):
        if not np.isnan(recording.tau_ext[i]).any():
            J = _ee_jacobian(recording.model, recording.q[i])
            wrench = wrench_from_torques(J, recording.tau_ext[i], _DAMPING, _SINGULAR)
            found[k] = np.nan if wrench is None else wrench[:3]
    return found, time


def _ee_jacobian(model: RobotModel, q: FloatArray) -> FloatArray:
    return model.ee_jacobian(model.kinematics(q))


def _cycles(recording: TorqueRecording, period: float) -> tuple[FloatArray, IntArray, BoolArray]:
    """Instants (S,) of the cycles [s], the newest sample at each, and whether it is the first after a gap.

    They lie in the middle between samples, so that jitter neither doubles nor skips one.
    """
    time = recording.time
    phase = 0.5 * min(period, float(np.median(np.diff(time))))
    times, first = [], []
    for piece in pieces(time):
        count = int((time[piece.stop - 1] - time[piece.start]) / period + 1e-6) + 1
        times.append(time[piece.start] + phase + period * np.arange(count))
        first.append(np.arange(count) == 0)
    ticks = np.concatenate(times)
    return ticks, np.searchsorted(time, ticks, side="right") - 1, np.concatenate(first)
