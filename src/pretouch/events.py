"""What a step saw that may change the mode, each with the detail its sentence needs."""

import numpy as np

from pretouch.contact import reaction
from pretouch.contact.clamp import ClampState
from pretouch.contact.detect import Detection
from pretouch.contact.place import given_up
from pretouch.contact.response import Doing, ResponseState, moves, presses_on, waits
from pretouch.modes import Event, ModeState
from pretouch.params import Profile
from pretouch.types import Mode


def doing(mode: ModeState, armed: bool, params: Profile) -> Doing:
    """What the arm does in a mode, as far as contacts matter."""
    if mode.mode is Mode.REACT:
        return "react"
    if mode.mode is Mode.TRACK:
        return "task"
    return "learn" if not armed else "soft" if mode.soft and params.reaction.soft_hold else "still"


def events_of(
    unfit: str, silent: str, lost: str, felt: Detection, samples: int, answer: ResponseState, near: bool, before: Doing,
    blocked: float, p: Profile,
) -> dict[Event, str]:  # fmt: skip
    """Name what was seen, heard and felt in one step.

    `before` is what the arm has done up to it, `blocked` for how long the path has been so [s].
    """
    events: dict[Event, str] = {}
    if felt.contact is not None and (p.reaction.method == "decay" or moves(answer, before, p.reaction)):
        events[Event.CONTACT] = f"{np.linalg.norm(felt.contact.force):.1f} N"
    if p.reaction.method == "admittance":
        events |= _of_yielding(answer, near, felt.lasting, before, p)
    elif reaction.active(answer.decay, p.reaction):
        left = (p.reaction.decay_cycles - answer.decay.cycle) * p.task.control_period_s
        events[Event.REACTING] = f"{left:.2f} s"
    if unfit and p.perception.enabled:
        events[Event.SKIN_UNFIT] = unfit
    if silent:
        events[Event.SKIN_SILENT] = silent
    if lost:
        events[Event.POINTS_LOST] = lost
    if not felt.armed and p.detection.method != "thresholds" and bool(np.isnan(felt.residual).any()):
        events.setdefault(Event.NO_FORCE, f"up to {p.failure.force_timeout_s:g} s")
    elif not felt.armed:
        events[Event.WINDOW_FILLING] = f"{samples} of {p.threshold.window_samples} samples"
    if p.task.blocked_after_s is not None and blocked >= p.task.blocked_after_s:
        events[Event.PATH_BLOCKED] = f"{blocked:.1f} s"
    return events


def _caught(clamp: ClampState) -> str:
    """Say what the arm is caught between, or how that shows."""
    if clamp.between:
        return f"{clamp.between}, pushed apart with {clamp.force:.0f} N"
    return f"{clamp.torque:.1f} Nm against the way it yielded"


def _of_yielding(answer: ResponseState, near: bool, lasting: bool, before: Doing, p: Profile) -> dict[Event, str]:
    """Name what the admittance is at, and what it gave up."""
    events: dict[Event, str] = {}
    r, clamp, place = p.reaction, answer.clamp, answer.place
    if clamp.torque:
        events[Event.CLAMPED if clamp.open else Event.OPENING] = _caught(clamp)
    elif before == "react" and waits(answer, near, lasting, r):
        clear = ", once nothing is seen near it" if near and not given_up(place, r) else ""
        events[Event.YIELDING] = f"{r.quiet_s:g} s after the last push{clear}"
    elif before in ("react", "soft") and presses_on(answer, r):
        torque = np.abs(answer.yielding.steady[1])
        events[Event.PRESSED] = f"{r.patience_s:g} s, about {torque.max():.0f} Nm at joint {torque.argmax() + 1}"
    if given_up(place, r):
        x, y, z = place.point
        when = f"nothing is seen within {r.near_m:g} m of it" if place.seen else f"{r.retry_s:g} s have passed"
        events[Event.GIVEN_UP] = (
            f"{place.contacts} contacts at one place of the path, ({x:.2f}, {y:.2f}, {z:.2f}) m: clear it; the arm"
            f" tries again when {when}, or on resume"
        )
    return events
