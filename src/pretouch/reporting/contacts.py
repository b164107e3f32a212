"""Detected contacts beside the true touches of a simulation."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pretouch.recording.run_record import MODES, TrueForces
from pretouch.reporting.html import MOST_ROWS, NOTHING, Html, Row, Text, bad, element, joined, number, table, vector
from pretouch.reporting.record import RunCourse
from pretouch.sim.plant import TOUCH_N
from pretouch.traces import mean_over, spans
from pretouch.types import Contact, FloatArray, Mode

BOUNCE_S = 0.1
"""Touches with less than this between them are one [s]."""
TRANSIENT_S = 0.5
"""From this long after its beginning a contact counts as quasi-static [s] (ISO/TS 15066)."""
MEAN_S = 0.02
"""Length of the mean that peaks are also given of [s]."""
GRACE_S = 0.2
"""A detection this long after a touch still answers it [s]: the estimate lags, and the value of eq. 8 more."""
AXES = "xyz"
_LISTED = 40
"""Detections without a touch that the sentence about them names."""
_FORCE = {
    True: "Force: norm of the estimate above the window's mean",
    False: "Force: at the end-effector, as the joint torques beyond those of free motion tell it; the contact may be"
    " elsewhere. Axes: where that passes the band of one sample, or is nearest to it",
}
"""Meaning of a contact's force, by whether the paper's thresholds detect it."""


@dataclass(frozen=True)
class TrueTouch:
    """One true touch: from the true force passing 1 N until it is below for good."""

    start: float
    """[s]"""
    end: float
    """[s]"""
    peak: float
    """Largest true force [N]."""
    peak_20ms: float
    """Largest 20 ms mean of the true force [N]."""
    lasting: float
    """Largest 20 ms mean that begins 0.5 s after the touch or later [N], NaN if it was over by then."""
    link: str
    """Link that touched first, '' where that is not known."""
    velocity: FloatArray
    """(3,) velocity of the touching point before the contact [m/s], NaN where that is not known."""


@dataclass(frozen=True)
class FeltContact:
    """One detected contact and the reaction to it. Base frame."""

    step: int
    """Index of the control step that detected it."""
    time: float
    """Time of the detection [s]."""
    contact: Contact
    """Force of eq. 12: the reading above the window's mean, or what explains the torques best; and the axes whose
    threshold or band was crossed, or came nearest to it."""
    peak: FloatArray
    """(3,) on each axis the estimate that was farthest from zero during the contact [N]."""
    peak_norm: float
    """Largest norm of the estimate during the contact [N]."""
    lasting: float
    """Largest norm of the estimate later than 0.5 s into the contact [N]."""
    reaction_speed: float
    """At its beginning [m/s]."""
    reaction_s: float
    """Duration of the reaction [s]."""
    moved_s: float
    """Time that the arm moved in it [s]; 0 of a contact too weak to move the arm, which held still."""
    touch: int | None
    """Index of the true touch it answers."""
    delay: float | None
    """Time since that touch began [s], None if an earlier detection answered it."""


@dataclass(frozen=True)
class ContactMeasures:
    """Detections and true touches in order."""

    truth_known: bool
    detections: tuple[FeltContact, ...]
    touches: tuple[TrueTouch, ...]
    unanswered: dict[int, Mode | None]
    """Touches without a detection, by index: what the arm was doing when each began."""

    @property
    def missed(self) -> tuple[TrueTouch, ...]:
        """True touches that were never answered, those aside that came while the arm was yielding already."""
        return tuple(self.touches[i] for i, mode in self.unanswered.items() if mode is not Mode.REACT)

    @property
    def without_touch(self) -> tuple[FeltContact, ...]:
        """Detections without a true touch; none where the truth is not known."""
        return tuple(d for d in self.detections if d.touch is None) if self.truth_known else ()

    @property
    def delays(self) -> tuple[float, ...]:
        """Time from each touch that was answered to its first detection [s]."""
        return tuple(d.delay for d in self.detections if d.delay is not None)

    @property
    def peak(self) -> float | None:
        """Largest true force [N], or where it is not known the largest estimate during a contact."""
        if self.truth_known:
            return max((touch.peak for touch in self.touches), default=0.0)
        return _largest([d.peak_norm for d in self.detections])

    @property
    def lasting(self) -> float | None:
        """Largest force later than 0.5 s into a contact [N], from the same source as the peak; None if none lasted."""
        lasting = self.touches if self.truth_known else self.detections
        return _largest([one.lasting for one in lasting])


def contacts_in(course: RunCourse) -> ContactMeasures:
    """Find what touched in a recording and what was detected of it."""
    touches = touches_of(course.truth)
    detections = _detections(course, touches)
    answered = {detection.touch for detection in detections}
    at = np.searchsorted(course.time, [touch.start for touch in touches], side="right") - 1  # the steps in force then
    modes = [MODES[course.mode[step]] if step >= 0 else None for step in at.tolist()]
    unanswered = {i: mode for i, mode in enumerate(modes) if i not in answered}
    return ContactMeasures(course.truth is not None, tuple(detections), tuple(touches), unanswered)


def touches_of(truth: TrueForces | None) -> list[TrueTouch]:
    """All true touches in order; none where nothing is known, or what is said to be known cannot be."""
    if truth is None or len(truth.time) < 2 or not np.all(np.isfinite(truth.time)):
        return []
    time, force = truth.time, np.linalg.norm(truth.force, axis=1)
    samples = max(1, round(MEAN_S / max(float(np.median(np.diff(time))), 1e-9)))
    mean, touches, begun = mean_over(force, samples), list[TrueTouch](), list(truth.touches)
    joined_spans = list[list[int]]()
    for first, past in spans(force > TOUCH_N):
        if joined_spans and time[first] - time[joined_spans[-1][1] - 1] < BOUNCE_S:
            joined_spans[-1][1] = past
        else:
            joined_spans.append([first, past])
    for first, past in joined_spans:
        start, end, link, velocity = float(time[first]), float(time[past - 1]), "", np.full(3, np.nan)
        late = int(np.searchsorted(time, start + TRANSIENT_S))
        before = touches[-1].end if touches else -np.inf
        while begun and begun[0][0] <= start + 1e-9:  # the last contact that began after the touch before, and by now
            instant, name, of_point = begun.pop(0)
            if instant > before:
                link, velocity = name, of_point
        peak, peak_20ms = force[first:past].max(), mean[max(first - samples + 1, 0) : past].max(initial=0.0)
        lasting = float(mean[late:past].max(initial=0.0)) if late < past else float("nan")
        touches.append(TrueTouch(start, end, float(peak), float(peak_20ms), lasting, link, velocity))
    return touches


def _detections(course: RunCourse, touches: Sequence[TrueTouch]) -> list[FeltContact]:
    """All detected contacts in order, each with the touch it answers if there is one."""
    detections, answered = list[FeltContact](), set[int | None]()
    lasted, steps = course.lasted, [i for i, _, _ in course.contacts]
    for (i, contact, speed), following in zip(course.contacts, [*steps[1:], len(course)], strict=False):
        other = np.flatnonzero(course.mode[i:] != MODES.index(Mode.REACT))
        time, end = float(course.time[i]), max(i + int(other[0]), i + 1) if len(other) else len(course)
        touch = max((k for k, one in enumerate(touches) if one.start <= time <= one.end + GRACE_S), default=None)
        begun = time if touch is None or touch in answered else touches[touch].start
        over = time if touch is None else touches[touch].end + GRACE_S
        during = slice(
            int(np.searchsorted(course.time, begun)),
            min(max(end, int(np.searchsorted(course.time, over, side="right"))), following),
        )
        force, late = course.force[during], course.time[during] >= begun + TRANSIENT_S
        finite = force[np.isfinite(force).all(axis=1)]
        farthest = finite[np.abs(finite).argmax(axis=0), np.arange(3)] if len(finite) else np.full(3, np.nan)
        size = np.linalg.norm(np.where(np.isfinite(force), force, np.nan), axis=1)
        detections.append(
            FeltContact(
                step=i,
                time=time,
                contact=contact,
                peak=farthest,
                peak_norm=float(np.fmax.reduce(size, initial=np.nan)),
                lasting=float(np.fmax.reduce(size[late], initial=np.nan)),
                reaction_speed=speed,
                reaction_s=float(lasted[i:end].sum()),
                moved_s=float(lasted[i:end][course.answering[i:end]].sum()),
                touch=touch,
                delay=None if touch is None or touch in answered else time - begun,
            )
        )
        answered.add(touch)
    return detections


def _largest(values: list[float]) -> float | None:
    return max((value for value in values if np.isfinite(value)), default=None)


def contact_section(course: RunCourse, contacts: ContactMeasures) -> Html:
    """Detected contacts and, where it is known, what truly touched and what was missed."""
    parts = [_detected(course, contacts.detections)]
    if contacts.truth_known:
        parts += [_touched(contacts), _false(contacts.detections)]
    else:
        unknown = "True touches are not known: delays, missed touches and false detections cannot be counted."
        parts.append(element("p", unknown, "note"))
    return joined(parts)


def _detected(course: RunCourse, detections: Sequence[FeltContact]) -> Html:
    if not detections:
        return element("p", "No contact was detected.")
    rows: list[Row] = [
        {
            "no.": str(order),
            "axes": " ".join(axis for axis, hit in zip(AXES, d.contact.axes, strict=True) if hit),
            "time [s]": number(d.time, 2),
            "force [N]": number(float(np.linalg.norm(d.contact.force)), 1),
            "force x y z [N]": vector(d.contact.force, 1),
            "filtered x y z [N]": vector(course.filtered_force[d.step], 1),
            "raw x y z [N]": vector(course.force[d.step], 1),
            "peak x y z [N]": vector(d.peak, 1),
            "reaction [m/s]": number(d.reaction_speed, 3),
            "lasted [s]": number(d.reaction_s, 2),
            "moved [s]": number(d.moved_s, 2) if d.moved_s else "held still",
            **({"profile": course.runs[course.run[d.step]].profile.name} if len(course.runs) > 1 else {}),
        }
        for order, d in enumerate(detections, 1)
    ]
    note = (
        f"{_FORCE[course.by_thresholds]}; on the arm, base frame. Filtered: value of eq. 8. Raw: the estimate. Peak: on"
        " each axis the estimate farthest from zero during the contact. Held still: the contact was below what moves"
        " the arm."
    )
    return table(rows, note, 2, "Detected contacts")


def _touched(contacts: ContactMeasures) -> Html:
    if not contacts.touches:
        return element("p", "Nothing truly touched the arm.")
    answers = {d.touch: (f"contact {i}", d.delay) for i, d in reversed(list(enumerate(contacts.detections, 1)))}
    why: dict[Mode | None, Text] = {Mode.REACT: "none: the arm was yielding already", Mode.HOLD: bad("missed in HOLD")}
    rows: list[Row] = []
    many = len(contacts.touches) > MOST_ROWS  # then those without an answer come first
    for i, touch in sorted(enumerate(contacts.touches), key=lambda one: many and one[0] in answers):
        missed = contacts.unanswered.get(i)
        answer, delay = answers[i] if i in answers else (why.get(missed, bad("missed")), None)
        rows.append(
            {
                "no.": str(i + 1),
                "first link": touch.link or NOTHING,
                "answered by": answer,
                "time [s]": number(touch.start, 3),
                "duration [s]": number(touch.end - touch.start, 3),
                "delay [ms]": number(delay, 0, 1000.0),
                "speed [m/s]": number(float(np.linalg.norm(touch.velocity)), 3),
                "true peak [N]": number(touch.peak, 1),
                "true 20 ms [N]": number(touch.peak_20ms, 1),
                f"held {TRANSIENT_S:g} s [N]": number(touch.lasting, 1),
            }
        )
    note = (
        "A touch begins as the true force passes 1 N; the delay runs from there to the detection. Interruptions of less"
        f" than {BOUNCE_S:g} s are bounces of one touch. Speed: of the point of the arm that touched first."
    )
    return table(rows, note, 3, "True touches (simulation)")


def _false(detections: Sequence[FeltContact]) -> Html:
    """Say which detections no touch explains."""
    false = [f"contact {i} at {d.time:.2f} s" for i, d in enumerate(detections, 1) if d.touch is None]
    if not false:
        return element("p", "Every detection answers a true touch.") if detections else Html("")
    listed = ", ".join(false[:_LISTED]) + (" ..." if len(false) > _LISTED else "")
    return element(
        "p", bad(f"Detections without a touch under way or over for less than {GRACE_S:g} s: {len(false)} ({listed}).")
    )
