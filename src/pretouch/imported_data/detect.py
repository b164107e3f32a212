"""Detectors on a recorded force or recorded joint torques, cycle by cycle as in the controller, without a skin."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from pretouch.composition import changed
from pretouch.contact.detector import Body, Detection, Detector, Sample
from pretouch.contact.localisation import LocalisationState
from pretouch.contact.moving_thresholds import MovingThresholds
from pretouch.contact.reaction import DecayingVelocity
from pretouch.contact.window import Window, add_force, window_init
from pretouch.errors import RecordingError
from pretouch.imported_data.log import GAP_S, Note, gaps, pieces
from pretouch.imported_data.reading import ForceRecording
from pretouch.imported_data.results import (
    AROUND_S,
    NEAR_S,
    Course,
    DetectorResult,
    ThresholdSummary,
    TorqueCourse,
    free_cycles,
    joint_motion,
    over,
    result_of,
)
from pretouch.imported_data.torques import TorqueRecording
from pretouch.modes import Event, mode_init, next_mode
from pretouch.params import SequentialParams
from pretouch.profiles import Profile
from pretouch.recording.compare import Circumstances, Decision, Decisions, DetectedContact, decisions_of
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.sim.observer import wrench_from_torques
from pretouch.types import BoolArray, FloatArray, IntArray, Mode, RobotState, no_obstacles

_SLOWER = 0.95
"""Share of the detector's rate below which data count as slower."""
_DAMPING, _SINGULAR = 0.01, 0.02
"""Damping of the least squares by which an interface makes a wrench of torques, and least singular value of the
Jacobian at which it does."""
_LONG_S = 15.0
"""Time from which on a contact is doubted [s]."""
_ALIKE_NATS = np.log(10.0)
"""Log-likelihood below the best link's up to which the torques could be of another link [1]."""
_OF_CURRENTS = {"friction_prior_nm": 0.1, "offset_prior_nm": 0.03, "torque_prior_nm": 0.02}
"""Uncertainty of torques from currents, as shares of a joint's usual torque limit [1]; from the UR10e."""


def detect(recording: ForceRecording | TorqueRecording, profile: Profile) -> tuple[DetectorResult, Course]:
    """Let a profile's detector run over a recording at the profile's rate, the newest sample in each cycle.

    There are no obstacles. A detector of a force runs on the one that a robot's interface would make of torques.
    Raises RecordingError for a recording in which it detects nothing.
    """
    if isinstance(recording, ForceRecording):
        return _by_force(recording, profile)
    if not profile.detect.by_torques:
        return _by_force(_force_of(recording, profile.task.control_period_s), profile)
    return _by_torques(recording, profile)


def _by_force(r: ForceRecording, p: Profile) -> tuple[DetectorResult, Decisions]:
    """Hold a force against thresholds. A sample is held while no other comes; after `force_timeout_s` there is none."""
    if p.detect.by_torques:
        raise RecordingError(
            f"The profile {p.name} detects by joint torques, but {r.place} gives only a force: choose one with"
            " detect=thresholds."
        )
    timeout, gap, period = p.failure.force_timeout_s, float(np.median(np.diff(r.time))), p.task.control_period_s
    if gap > timeout:
        raise RecordingError(
            f"The force of {r.place} comes every {gap:.3g} s, but the detector needs it every {timeout:g} s: check the"
            " unit of the time."
        )
    # after a gap in which nothing can change any more the cycles begin anew
    decay = DecayingVelocity.of(p.react, period).decay_cycles + 2
    ticks, newest, _ = cycles(r.time, period, timeout + decay * period, hold=True)
    force = r.force[newest]
    usable = (ticks - r.time[newest] <= timeout) & (np.abs(force) < p.failure.force_max_n).all(axis=1)
    d = _decided(ticks, np.where(usable[:, None], force, np.nan), p)
    deaf = _deaf(r.place, "force", d, p)
    summary = _summary(d, free_cycles(d.judged & ~d.reacting, d), MovingThresholds.of_kind(p.detect).f_base_n)
    return result_of(p, d, summary, (*_slower(r.rate, p), *gaps(r.time, timeout), *deaf)), d


def cycles(time: FloatArray, period: float, gap_s: float, hold: bool) -> tuple[FloatArray, IntArray, BoolArray]:
    """Instants (S,) of cycles [s], the newest sample at each, and whether it is the first of all or after a gap.

    They lie in the middle between samples, so that jitter neither doubles nor skips one. With `hold` they go on for
    the length of a gap behind the last sample before one.
    """
    phase = 0.5 * min(period, float(np.median(np.diff(time))))
    stretches = pieces(time, gap_s)
    times, first = [], []
    for piece in stretches:
        lasting = gap_s if hold and piece is not stretches[-1] else 0.0
        count = int((time[piece.stop - 1] + lasting - time[piece.start]) / period + 1e-6) + 1
        times.append(time[piece.start] + phase + period * np.arange(count))
        first.append(np.arange(count) == 0)
    ticks = np.concatenate(times)
    return ticks, np.searchsorted(time, ticks, side="right") - 1, np.concatenate(first)


def _decided(ticks: FloatArray, force: FloatArray, profile: Profile) -> Decisions:
    """Detect without obstacles; as in the controller, nothing is a contact while a reaction would be under way."""
    p, decisions, nowhere, nothing = profile, list[Decision](), np.zeros(3), no_obstacles()
    answer, thresholds = DecayingVelocity.of(p.react, p.task.control_period_s), MovingThresholds.of_kind(p.detect)
    window, mode, react = window_init(p.window.samples), mode_init(), answer.init()
    for time, sample in zip(ticks.tolist(), force, strict=True):
        force_now = None if np.isnan(sample[0]) else sample
        armed, window = window.full, add_force(window, force_now, p.window)
        detection = thresholds.judge(window, force_now, armed, nowhere, nothing)
        events = {Event.WINDOW_FILLING: ""} if not detection.armed else {}
        if detection.contact is not None:
            events[Event.CONTACT] = ""
        if answer.active(react):
            events[Event.REACTING] = ""
        before, mode = mode, next_mode(mode, events, resume=False)
        reacting = mode.mode is Mode.REACT
        contact = detection.contact if reacting and before.mode is not Mode.REACT else None
        react = answer.begin(contact.force) if contact else react
        react = react.advanced() if reacting else answer.init()
        compared = window.newest if force_now is not None and thresholds.compare == "filtered" else sample
        decisions.append((time, sample, compared, detection.thresholds, detection.armed, reacting, contact))
    return decisions_of(p.name, decisions)


def _summary(d: Decisions, free: BoolArray, f_base: float) -> ThresholdSummary:
    beyond, widths = np.maximum(d.compared - d.upper, d.lower - d.compared).max(axis=1), d.upper - d.lower
    return ThresholdSummary(
        mean_n=over(free, np.mean, d.force),
        sigma_n=over(free, np.std, d.force),
        width_n=over(free, np.median, widths / 2),
        f_base_n=f_base,
        f_base_all_n=f_base + float(over(d.judged, np.max, beyond)),
    )


def _slower(rate: float, profile: Profile) -> list[Note]:
    """Say that data come at a rate [Hz] below the detector's."""
    own = 1.0 / profile.task.control_period_s
    return [Note("slower", {"profile": profile.name, "rate": rate, "own": own})] if rate < _SLOWER * own else []


def _deaf(place: Path, what: str, course: Course, profile: Profile) -> list[Note]:
    """Say when nothing could be detected, but for the window's length; RecordingError if that was always."""
    ready, end, period = course.time[course.judged], float(course.time[-1]), profile.task.control_period_s
    fills = profile.window.samples * period
    if not len(ready):
        raise RecordingError(
            f"{place} has {end:.2f} s, but not the {fills:g} s of usable {what} that fill the window of {profile.name}:"
            " give a longer recording, not all of it near a singularity."
        )
    pauses, deaf = np.diff(ready, prepend=0.0, append=end), end - period * len(ready)
    span = {"seconds": deaf, "of": end, "longest": float(pauses.max()), "time": [0.0, *ready][pauses.argmax()]}
    return [Note("deaf", span | {"profile": profile.name, "what": what})] if deaf > fills + NEAR_S else []


def _force_of(r: TorqueRecording, period: float) -> ForceRecording:
    """Return the force that a robot's interface would make of torques, at the detector's cycles."""
    time, newest, _ = cycles(r.time, period, GAP_S, hold=False)
    wrenches = [_wrench(r.model, r.q[i], r.tau_ext[i]) for i in newest]
    force = np.array([np.full(3, np.nan) if wrench is None else wrench[:3] for wrench in wrenches])
    return ForceRecording(r.place, r.model, False, r.first_s, time, (), "", False, force)


def _wrench(model: RobotModel, q: FloatArray, tau: FloatArray) -> FloatArray | None:
    """Wrench (6,) that a robot's interface would make of external torques, or None where it has none."""
    if np.isnan(tau).any():
        return None
    return wrench_from_torques(model.hinges, model.mechanism.arm, q.copy(), tau.copy(), _DAMPING, _SINGULAR)


def _by_torques(r: TorqueRecording, profile: Profile) -> tuple[DetectorResult, TorqueCourse]:
    profile, notes = _for_currents(r, profile)
    time, newest, first = cycles(r.time, profile.task.control_period_s, GAP_S, hold=False)
    course = _judged(r, profile, time, newest, first)
    name = profile.name
    notes += _deaf(r.place, "torques", course, profile)
    if getattr(profile.detect, "learn", "") == "watched":
        notes.append(Note("unwatched", {"profile": name}))
    notes += _slower(r.rate, profile)
    lengths = [((c.end_s or c.time_s) - c.time_s, c.time_s) for c in course.contacts]
    if lengths and max(lengths)[0] > _LONG_S:
        notes.append(Note("long", dict(zip(("seconds", "time"), max(lengths), strict=True)) | {"profile": name}))
    return result_of(profile, course, None, notes), course


def _for_currents(recording: TorqueRecording, profile: Profile) -> tuple[Profile, list[Note]]:
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


def _judged(r: TorqueRecording, profile: Profile, time: FloatArray, newest: IntArray, first: BoolArray) -> TorqueCourse:
    """Let a detector judge torques at cycles, see `cycles`."""
    body = Body(r.model, Skin((), r.model), profile.task.control_period_s)
    without = np.asarray(np.isnan(r.tau_ext[newest]).any(axis=1))
    contacts, detections = list[DetectedContact](), list[Detection]()
    state, window, waiting = None, window_init(profile.window.samples), True
    for cycle, i in enumerate(newest):
        sample = _sample(r, i, float(time[cycle]), window, profile)
        window, waiting = sample.window, waiting or bool(first[cycle])
        if state is None or (waiting and not without[cycle]):
            state, waiting = _begun(profile.detect, body, state, r.qd_commanded[i]), bool(without[cycle])
        detection, state = profile.detect.step(state, body, sample)
        _follow(contacts, sample.stamp, i, r, detection, state)
        detections.append(replace(detection, significant=None))
    names = ("residual", "evidence", "detectable_n", "armed")
    columns = {name: np.array([getattr(d, name) for d in detections]) for name in names}
    return TorqueCourse(time=time, tau_ext=r.tau_ext[newest], contacts=tuple(contacts), **columns)


def _sample(r: TorqueRecording, i: int, time: float, window: Window, profile: Profile) -> Sample:
    """Return a cycle's sample, with the force window after it."""
    kin, wrench = r.model.kinematics(r.q[i]), _wrench(r.model, r.q[i], r.tau_ext[i])
    robot = RobotState(time, r.q[i], r.qd[i], r.q[i], r.qd_commanded[i], r.tau_ext[i], wrench)
    after = add_force(window, profile.detect.counted(robot, window), profile.window)
    # watched: whoever gives the recording stands in for the skin that would tell when free motion can be learnt
    return Sample(time, kin, robot, after, window.full, no_obstacles(), watched=True)


def _begun(detector: Detector, body: Body, before: Any, speed: FloatArray) -> Any:
    """Return a detector's state at the first cycle with torques after a gap: what was learnt stays."""
    learnt = detector.learnt(detector.init(body) if before is None else before)
    none = np.zeros(1, np.int64)
    return detector.init(body, learnt and learnt._replace(speed=speed, filled=none, waiting=none))


def _follow(contacts: list[DetectedContact], time: float, i: int, r: TorqueRecording, d: Detection, state: Any) -> None:
    """Begin a contact at sample i, or go on with the last one while there is evidence of it."""
    last = contacts[-1] if contacts else None
    goes_on = last is not None and last.end_s is not None and time - last.end_s <= NEAR_S
    if d.contact is not None and not goes_on:
        look = _circumstances(r, i, d)
        last, goes_on = DetectedContact(time, d.contact.force, end_s=time, evidence=-1.0, circumstances=look), True
        contacts.append(last)
    if last is None or not goes_on or not d.armed or not d.evidence >= 1.0:
        return
    touched, best = d.touched, last.evidence or 0.0
    # the place gathers what all samples say: it is surest late, when the evidence may have passed its peak
    if len(touched.link) and touched.probability[0] > (last.probability or 0.0):
        inferred, sure = getattr(state, "localisation", None), float(touched.probability[0])
        links = alike(inferred, r.model) if inferred else (r.model.links[touched.link[0]],)
        place = {"links": links, "link": links[0] if len(links) == 1 else None, "point_m": touched.point[0]}
        last = replace(last, force_n=touched.force[0], probability=sure, **place)
    elif not last.links and d.contact is not None and d.evidence > best:
        last = replace(last, force_n=d.contact.force)
    contacts[-1] = replace(last, end_s=time, evidence=max(best, d.evidence))


def alike(contact: LocalisationState, model: RobotModel) -> tuple[str, ...]:
    """Return the links that the torques of a localised contact could be of, one a rigid body, the likeliest first.

    Their likelihoods alone count: that a link is large is no evidence of a touch there.
    """
    link, own = model.surface.link, int(contact.touched.link[0])
    best = {body: np.where(model.surface.body == body, contact.ln, -np.inf) for body in np.unique(model.surface.body)}
    near = [int(link[ln.argmax()]) for ln in best.values() if ln.max() > contact.ln.max() - _ALIKE_NATS]
    others = [other for other in near if model.rigid[other] != model.rigid[own]]
    return tuple(model.links[which] for which in (own, *others))


def _circumstances(r: TorqueRecording, i: int, d: Detection) -> Circumstances | None:
    """Return what an alarm at sample i looked like; None from a detector that does not average."""
    if d.significant is None:
        return None
    (residual, covariance), around = d.significant, np.abs(r.time - r.time[i]) <= AROUND_S
    sigma = np.sqrt(np.diag(covariance))
    doing = tuple(joint_motion(speeds) for speeds in r.qd_commanded[around].T)
    joint = r.model.joints[int(np.argmax(np.abs(residual) / sigma))]
    return Circumstances(joint, residual, sigma, r.tau_ext[i] - d.residual, r.qd_commanded[i], doing)
