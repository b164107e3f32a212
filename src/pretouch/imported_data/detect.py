"""The detector on an imported recording, cycle by cycle as in the controller."""

import numpy as np

from pretouch.contact.decaying_velocity import DecayingVelocity, advanced
from pretouch.contact.moving_thresholds import thresholds_of
from pretouch.contact.window import add_force, window_init
from pretouch.control.path import line
from pretouch.controller import Controller
from pretouch.errors import RecordingError
from pretouch.imported_data.samples import POSTURE_GAP_S, ImportedData
from pretouch.imported_data.source import RangeTopic, Series, interpolated, newest
from pretouch.modes import Event, mode_init, next_mode
from pretouch.perception.scene_filter import no_fixtures
from pretouch.profiles import Profile
from pretouch.recording.compare import Decided, Decisions
from pretouch.sensing.skin import Skin
from pretouch.types import FloatArray, Inputs, IntArray, Mode, Obstacles, RangeReadings, RangeStatus, RobotState

_NOWHERE = np.zeros(3)
_NOTHING = Obstacles(
    unit=np.zeros(0, np.int64), point=np.zeros((0, 3)), ee_distance=np.zeros(0), body_point=np.zeros((0, 3)),
    link=np.zeros(0, np.int64), direction=np.zeros((0, 3)), body_distance=np.zeros(0),
    closing_speed=np.zeros(0),
)  # fmt: skip


def detect_imported(imported: ImportedData, profile: Profile, skin: Skin | None = None) -> Decisions:
    """Let a profile's detector run over an imported recording at the profile's rate, the newest sample in each cycle.

    A sample is held while no other comes; after `force_timeout_s` there is none. With a skin a whole controller is
    turned, so that what its units saw counts; without one there are no obstacles. Times count from the first sample.
    Raises RecordingError for a recording too short or too slow to detect anything.
    """
    if profile.detect.by_torques:
        raise RecordingError(
            f"The profile {profile.name} detects by joint torques, but {imported.place} gives only a force: choose one"
            " with detect=thresholds."
        )
    timeout, gap = profile.failure.force_timeout_s, float(np.median(np.diff(imported.force.time))) / 1e9
    if gap > timeout:
        raise RecordingError(
            f"The force of {imported.place} comes every {gap:.3g} s, but the detector needs it every {timeout:g} s:"
            " check the unit of the time."
        )
    ticks = _ticks(imported.force.time, profile)
    force = _forces(imported.force, ticks, profile)
    if skin is None:
        decisions = _force_alone(ticks, imported.force.time[0], force, profile)
    else:
        decisions = _whole_controller(imported, ticks, force, profile, skin)
    if not decisions.armed.any():
        period, usable = profile.task.control_period_s, int(np.isfinite(decisions.force[:, 0]).sum())
        raise RecordingError(
            f"{imported.place} has {usable * period:.2f} s of usable force, but the window of {profile.name} takes"
            f" {profile.window.samples * period:g} s to fill: give a longer recording."
        )
    return decisions


def _ticks(time: IntArray, profile: Profile) -> IntArray:
    """Instants of the cycles [ns], in the middle between samples, so that jitter neither doubles nor skips one.

    Gaps in which nothing can change any more are left out.
    """
    period = round(1e9 * profile.task.control_period_s)
    decay = (DecayingVelocity.of(profile.react, profile.task.control_period_s).decay_cycles + 2) * period
    lasting = round(1e9 * profile.failure.force_timeout_s) + decay
    phase = min(period, int(np.median(np.diff(time)))) // 2
    ends = np.flatnonzero(np.diff(time) > lasting)
    first = time[np.append(0, ends + 1)] - time[0]
    last = np.append(time[ends] + lasting, time[-1] + phase) - time[0] - phase
    pieces = [np.arange(-(-max(0, a - phase) // period), b // period + 1) for a, b in zip(first, last, strict=True)]
    return time[0] + phase + period * np.concatenate(pieces).astype(np.int64)


def _forces(force: Series, ticks: IntArray, profile: Profile) -> FloatArray:
    """Force (S, 3) [N] a robot would report in each cycle, NaN where it would have none."""
    at = newest(force.time, ticks)
    found = force.values[at]
    old = ticks - force.time[at] > 1e9 * profile.failure.force_timeout_s
    broken = ~np.all(np.abs(found) < profile.failure.force_max_n, axis=1)
    return np.where((old | broken)[:, None], np.nan, found)


def _force_alone(ticks: IntArray, begin: int, force: FloatArray, profile: Profile) -> Decisions:
    """Detect without obstacles; as in the controller, nothing is a contact while a reaction would be under way."""
    p, decided = profile, Decided(profile.name)
    answer, thresholds = DecayingVelocity.of(p.react, p.task.control_period_s), thresholds_of(p.detect)
    window, mode, react = window_init(p.window.samples), mode_init(), answer.rest()
    for time, sample in zip(((ticks - begin) / 1e9).tolist(), force, strict=True):
        force_now = None if np.isnan(sample[0]) else sample
        armed, window = window.full, add_force(window, force_now, p.window)
        detection = thresholds.judged(window, force_now, armed, _NOWHERE, _NOTHING)
        events = {Event.WINDOW_FILLING: ""} if not detection.armed else {}
        if detection.contact is not None:
            events[Event.CONTACT] = ""
        if answer.active(react):
            events[Event.REACTING] = ""
        before, mode = mode, next_mode(mode, events, resume=False)
        reacting = mode.mode is Mode.REACT
        begins = reacting and before.mode is not Mode.REACT
        contact = detection.contact if begins else None
        react = answer.begun(contact.force) if contact else react
        react = advanced(react) if reacting else answer.rest()
        compared = window.newest if force_now is not None and thresholds.compare == "filtered" else sample
        decided.add(time, sample, compared, detection.thresholds, detection.armed, reacting, contact)
    return decided.decisions()


def _whole_controller(
    imported: ImportedData, ticks: IntArray, force: FloatArray, profile: Profile, skin: Skin
) -> Decisions:
    """Turn a controller; its commands go nowhere, and a HOLD ends as soon as its cause does."""
    model, joints, begin = imported.model, imported.joints, imported.force.time[0]
    if model is None or joints is None:
        raise RecordingError(f"{imported.place} was read without joint positions: a skin needs them.")
    posture = interpolated(joints, ticks, POSTURE_GAP_S)
    known = np.flatnonzero(np.isfinite(posture).all(axis=1))
    if not len(known):
        raise RecordingError(
            f"The joint positions and forces of {imported.place} do not overlap in time: use those of one run."
        )
    x = model.kinematics(posture[known[0]]).position[model.ee]
    anywhere = line(tuple(x.tolist()), (float(x[0]), float(x[1]) + 0.1, float(x[2])))
    controller, decided = Controller(model, skin, no_fixtures(), anywhere, profile), Decided(profile.name)
    topics = units_topics(skin, imported.ranges)
    readings = [newest(topic.readings.time, ticks) if topic else np.full(len(ticks), -1) for topic in topics]
    still, state = np.zeros(model.n), None
    for i in range(known[0], len(ticks)):
        stamp, q = (ticks[i] - begin) / 1e9, posture[i]
        wrench = None if np.isnan(force[i, 0]) else np.concatenate([force[i], np.zeros(3)])
        robot = RobotState(stamp, q, still, q, still, still, wrench)
        seen = _readings(topics, [int(at[i]) for at in readings], begin)
        state = controller.init(robot) if state is None else state
        step, state = controller.step(state, Inputs(stamp, robot, seen, resume=True))
        decided.add_step(step, profile)
    return decided.decisions()


def units_topics(skin: Skin, ranges: tuple[RangeTopic, ...]) -> list[RangeTopic | None]:
    """Topic of each unit: the one whose frame_id is its id, or whose name has its id between slashes.

    Raises RecordingError if that is none for any unit.
    """
    found = [
        next(
            (r for r in ranges if r.frame.strip("/") == unit),
            next((r for r in ranges if unit in r.topic.split("/")), None),
        )
        for unit in skin.ids
    ]
    if not any(found):
        topics = ", ".join(f"{r.topic} (frame {r.frame!r})" for r in ranges)
        raise RecordingError(
            f"No unit of the skin ({', '.join(skin.ids)}) matches a topic of ranges ({topics}): rename the units."
        )
    return found


def _readings(topics: list[RangeTopic | None], at: list[int], begin: int) -> RangeReadings:
    """Newest reading of each unit; of one that was not heard yet, none."""
    count = len(topics)
    stamp, distance = np.full(count, -np.inf), np.zeros(count)
    status = np.full(count, int(RangeStatus.NONE), dtype=np.int64)
    for k, (topic, i) in enumerate(zip(topics, at, strict=True)):
        if topic is not None and i >= 0:
            stamp[k] = (topic.readings.time[i] - begin) / 1e9
            distance[k], status[k] = topic.readings.values[i]
    return RangeReadings(stamp, distance, status)
