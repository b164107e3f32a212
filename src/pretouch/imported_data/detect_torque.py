"""Detectors on recorded joint torques, cycle by cycle as in the controller, on an arm without a skin."""

from dataclasses import replace
from typing import Any

import numpy as np

from pretouch.composition import changed
from pretouch.contact.detector import Body, Detection, Detector, Sample
from pretouch.contact.window import Window, add_force, window_init
from pretouch.errors import RecordingError
from pretouch.imported_data.detect_force import ForceResult, cycles, detect_force, slow
from pretouch.imported_data.forces import ForceRecording
from pretouch.imported_data.log import Note
from pretouch.imported_data.torques import GAP_S, TorqueRecording
from pretouch.params import SequentialParams
from pretouch.profiles import Profile
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.sim.observer import wrench_from_torques
from pretouch.types import BoolArray, FloatArray, RobotState, no_obstacles
from pretouch.values import value

MOVING_RAD_S = 0.02
"""Speed of any joint from which the arm moves [rad/s]."""
_DAMPING, _SINGULAR = 0.01, 0.02
"""Of the least squares by which a robot's interface makes a wrench of torques, and the smallest singular value of the
Jacobian at which it does."""
_OVER_S = 0.5
"""Time without evidence of a contact after which it is over [s]."""
_LONG_S = 15.0
"""Time from which on a contact is doubted [s]."""
_OF_CURRENTS = {"friction_prior_nm": 0.1, "offset_prior_nm": 0.03, "torque_prior_nm": 0.02}
"""What is not known of torques by currents, as parts of the usual torque limit of a joint [1]; by the UR10e's."""


@value
class ContactEvent:
    """A contact that a detector found, where its place was surest."""

    time: float
    """At which it was detected [s]."""
    end: float
    """Of the last evidence of it [s]."""
    link: str
    """The link that is touched; '' where the profile does not say."""
    point: FloatArray
    """(3,) where on its surface, base frame [m]; NaN likewise."""
    force: FloatArray
    """(3,) on the robot, base frame [N]: there, or else at the end-effector."""
    probability: float
    """That it is this link's rigid body; NaN likewise."""
    evidence: float
    """Largest of the contact."""


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
    def judged(self) -> BoolArray:
        """(S,) whether a contact could be detected."""
        return self.armed & np.isfinite(self.residual).all(axis=1)

    @property
    def free(self) -> BoolArray:
        """(S,) whether that is so outside contacts and what is near them in time."""
        free = self.judged
        for contact in self.contacts:
            free &= (self.time < contact.time - 0.5) | (self.time > contact.end + 0.5)
        return free

    def in_free(self, values: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Mean and standard deviation (n,) of values (S, n) in free motion, NaN where there is none."""
        free, nothing = values[self.free], np.full(values.shape[1], np.nan)
        return (free.mean(axis=0), free.std(axis=0)) if len(free) else (nothing, nothing)

    @property
    def largest(self) -> float:
        """Largest evidence in free motion; NaN where there is none."""
        return float(self.evidence[self.free].max()) if self.free.any() else np.nan


@value
class ProfileResult:
    """What a profile finds in recorded torques: by the torques, or by the force that they amount to."""

    profile: Profile
    contacts: tuple[ContactEvent, ...]
    duration: float
    """Time in which it was armed [s]."""
    motion: float
    """Part of it in which the arm moved [s]."""
    in_motion: int
    """Contacts that began in motion."""
    detectable_n: float
    """Force at the end-effector that the detector itself says it finds: median outside contacts, or median distance of
    a threshold from its mean along the worst axis [N]; NaN if it does not say."""
    by_torques: TorqueDecisions | None
    by_force: ForceResult | None
    notes: tuple[Note, ...]

    @property
    def per_hour(self) -> float:
        """Contacts in an hour of motion: false alarms, if nobody touched the arm. NaN without motion."""
        return 3600.0 * self.in_motion / self.motion if self.motion else np.nan


def result_of(recording: TorqueRecording, profile: Profile) -> ProfileResult:
    """Let a profile's detector run over a recording; a profile that cannot run says why in its notes."""
    return _by_torques(recording, profile) if profile.detect.by_torques else _by_force(recording, profile)


def for_currents(recording: TorqueRecording, profile: Profile) -> tuple[Profile, list[Note]]:
    """Allow for what currents do not tell, as the friction of gears, where the profile leaves that as usual."""
    p, usual = profile.detect, SequentialParams()
    if not (recording.kind == "current" and isinstance(p, SequentialParams)):
        return profile, []
    large = float(np.median(recording.model.description.tau_max))
    wide = {name: share * large for name, share in _OF_CURRENTS.items()} | {"mass_prior": 0.3, "payload_prior_kg": 2.0}
    texts = {name: f"{number:.3g}" for name, number in wide.items() if getattr(p, name) == getattr(usual, name)}
    if not texts:
        return profile, []
    note = Note("for_currents", {"profile": profile.name, "allowed": ", ".join(f"{n} = {t}" for n, t in texts.items())})
    return changed(profile, {f"detect.{name}": text for name, text in texts.items()}), [note]


def _by_torques(recording: TorqueRecording, profile: Profile) -> ProfileResult:
    profile, notes = for_currents(recording, profile)
    d, name, period = detect_torques(recording, profile), profile.name, profile.task.control_period_s
    if getattr(profile.detect, "learn", "") == "watched":
        notes.append(Note("unwatched", {"profile": name}))
    notes += slow(recording.rate, profile)
    if not d.armed.any():
        notes.append(Note("never_armed", {"profile": name}))
    longest = max(d.contacts, key=lambda c: c.end - c.time, default=None)
    if longest and longest.end - longest.time > _LONG_S:
        notes.append(Note("long", {"profile": name, "time": longest.time, "seconds": longest.end - longest.time}))
    begins = np.searchsorted(d.time, [c.time for c in d.contacts])
    return ProfileResult(
        profile, d.contacts, float(d.judged.sum() * period), float((d.judged & d.moving).sum() * period),
        int(d.moving[begins].sum()), float(np.median(d.detectable_n[d.free])) if d.free.any() else np.nan, d, None,
        tuple(notes),
    )  # fmt: skip


def _by_force(recording: TorqueRecording, profile: Profile) -> ProfileResult:
    """Let a detector of a force run on the one that a robot's interface would make of the torques."""
    r, period = recording, profile.task.control_period_s
    time, newest, _ = cycles(r.time, period, GAP_S, hold=False)
    wrenches = [_wrench(r.model, r.q[i], r.tau_ext[i]) for i in newest]
    force = np.array([np.full(3, np.nan) if wrench is None else wrench[:3] for wrench in wrenches])
    try:
        by_force = detect_force(ForceRecording(r.place, "", r.model, False, False, 0.0, time - time[0], force), profile)
    except RecordingError as error:
        note = Note("cannot_run", {"profile": profile.name, "why": str(error)})
        return ProfileResult(profile, (), 0.0, 0.0, 0, np.nan, None, None, (note,))
    d, nowhere = by_force.decisions, np.full(3, np.nan)
    contacts = tuple(
        ContactEvent(c.time + time[0], c.time + time[0], "", nowhere, c.force, np.nan, np.nan) for c in d.contacts
    )
    judged = d.armed & np.isfinite(d.compared).all(axis=1)
    begins = np.array([c.time for c in contacts])
    return ProfileResult(
        profile, contacts, by_force.duration, float((judged & _moving(r, d.time + time[0])).sum() * period),
        int(_moving(r, begins).sum()), float(by_force.width.max()), None, by_force, (),
    )  # fmt: skip


def _moving(recording: TorqueRecording, time: FloatArray) -> BoolArray:
    """Whether the arm moves at instants (S,) [s]."""
    newest = np.searchsorted(recording.time, time, side="right") - 1
    return np.abs(recording.qd_commanded[newest]).max(axis=1) > MOVING_RAD_S


def _wrench(model: RobotModel, q: FloatArray, tau: FloatArray) -> FloatArray | None:
    """Wrench (6,) that a robot's interface would make of external torques, or None where it has none."""
    if np.isnan(tau).any():
        return None
    return wrench_from_torques(model.ee_jacobian(model.kinematics(q)), tau, _DAMPING, _SINGULAR)


def detect_torques(recording: TorqueRecording, profile: Profile) -> TorqueDecisions:
    """Let a profile's detector run over a recording at the profile's rate, the newest sample in each cycle."""
    r, period = recording, profile.task.control_period_s
    body = Body(r.model, Skin((), r.model), period)
    detector: Detector = profile.detect.on(body)
    time, newest, first = cycles(r.time, period, GAP_S, hold=False)
    without = np.asarray(np.isnan(r.tau_ext[newest]).any(axis=1))
    if without.all():
        raise RecordingError(f"{r.place} has no usable torques: give a longer recording without gaps.")
    contacts = _Contacts(r.model)
    detections: list[Detection] = []
    state, window, waiting = None, window_init(profile.window.samples), True
    for cycle, i in enumerate(newest):
        sample = _sample(r, i, float(time[cycle]), window, profile)
        window, waiting = sample.window, waiting or bool(first[cycle])
        if state is None or (waiting and not without[cycle]):
            state, waiting = _begun(detector, body, state, r.qd_commanded[i]), bool(without[cycle])
        detection, state = detector.step(state, body, sample)
        contacts.add(float(time[cycle]), detection)
        detections.append(replace(detection, significant=None))
    return TorqueDecisions(
        name=profile.name, time=time, tau_ext=r.tau_ext[newest],
        residual=np.array([d.residual for d in detections]), evidence=np.array([d.evidence for d in detections]),
        detectable_n=np.array([d.detectable_n for d in detections]),
        armed=np.array([d.armed for d in detections]),
        moving=np.abs(r.qd_commanded[newest]).max(axis=1) > MOVING_RAD_S, contacts=contacts.all(),
    )  # fmt: skip


def _sample(recording: TorqueRecording, i: int, time: float, window: Window, profile: Profile) -> Sample:
    """Return a cycle's sample, with the force window after it."""
    r = recording
    kin, wrench = r.model.kinematics(r.q[i]), _wrench(r.model, r.q[i], r.tau_ext[i])
    robot = RobotState(time, r.q[i], r.qd[i], r.q[i], r.qd_commanded[i], r.tau_ext[i], wrench)
    after = add_force(window, None if wrench is None else wrench[:3], profile.window)
    # watched: whoever gives the recording stands in for the skin that would tell when free motion can be learnt
    return Sample(time, kin, robot, after, window.full, no_obstacles(), watched=True)


def _begun(detector: Detector, body: Body, before: Any, speed: FloatArray) -> Any:
    """Return a detector's state at the first cycle with torques after a gap: what was learnt stays."""
    learnt = detector.learnt(detector.init(body) if before is None else before)
    none = np.zeros(1, np.int64)
    return detector.init(body, learnt and learnt._replace(speed=speed, filled=none, waiting=none))


class _Contacts:
    """Gathers contacts from what a detector says cycle by cycle."""

    def __init__(self, model: RobotModel) -> None:
        self._model = model
        self._over: list[ContactEvent] = []
        self._now: ContactEvent | None = None

    def add(self, time: float, d: Detection) -> None:
        """Take in a cycle."""
        if self._now is not None and time - self._now.end > _OVER_S:
            self._over.append(self._now)
            self._now = None
        if d.contact is not None and self._now is None:
            self._now = ContactEvent(time, time, "", np.full(3, np.nan), d.contact.force, np.nan, -1.0)
        if self._now is None or not d.armed or not d.evidence >= 1.0:
            return
        now, touched = self._now, d.touched
        link, point, force, probability = now.link, now.point, now.force, now.probability
        # the place gathers what all samples say: it is surest late, when the evidence may have passed its peak
        if len(touched.link) and not probability >= touched.probability[0]:  # NaN: none is known yet
            link, point, force = self._model.links[touched.link[0]], touched.point[0], touched.force[0]
            probability = float(touched.probability[0])
        elif not link and d.contact is not None and d.evidence > now.evidence:
            force = d.contact.force
        self._now = ContactEvent(now.time, time, link, point, force, probability, max(now.evidence, d.evidence))

    def all(self) -> tuple[ContactEvent, ...]:
        """Return the contacts of all cycles."""
        return (*self._over, *([self._now] if self._now else []))
