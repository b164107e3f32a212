"""Explanation of a control step: the limit and its share as values, and the motion in one word and one sentence."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum
from typing import TYPE_CHECKING

import numpy as np

from pretouch.modes import Event, Mode
from pretouch.values import BoolArray, FloatArray, value

if TYPE_CHECKING:
    from pretouch.types import ControlStep

SEEN_NOW_S = 0.3
"""Age of a look up to which its obstacle counts as seen now [s]: as long as a unit may be silent."""
FULL = 0.95
"""Share of the desired speed from which the arm is not called slowed: less is the noise of the joint velocities."""
ASKED_M_S = 0.005
"""Speed from which a motion is desired [m/s]."""
_PRESSED = 1e-9
"""Multiplier above which a limit is active."""
_TOWARDS = 0.25
"""Least cosine between the desired velocity and the way back for an arm that returns to its path."""
OFF_PATH_M = 0.01
"""Distance from the path at which the arm is off it [m]; an arm that follows the path stays closer."""
_REST_M_S = 0.02
"""Measured speed of the end-effector below which it is at rest [m/s]; the rest is noise."""
_REST_RAD_S = 0.01
"""Largest commanded joint velocity of an arm that is held still [rad/s]: 5 mm/s at half a metre."""
_ANSWER_M_S = 1e-3
"""Speed of the end-effector from which on a reaction moves the arm [m/s]."""
LOUD_N = 15.0
"""Force that a detector should find [N]: where it needs more, the torques are too noisy for light touches."""


class Limit(Enum):
    """Limit that keeps the arm from the desired motion."""

    NOTHING = "nothing"
    SLOWED = "slowed"
    """The arm is slower near an obstacle (eqs. 3, 4), or because units or outside sources are silent."""
    APPROACH = "approach"
    """A link may approach an obstacle no faster (eqs. 5-7), or has to retreat."""
    JOINTS = "joints"
    """A joint is at its limit of position, velocity or acceleration."""
    CONTACT = "contact"
    """The arm yields to a contact."""
    HOLD = "hold"
    """The arm brakes or stands; `ControlStep.reason` names the cause."""


@value
class Limited:
    """The limit on the desired motion, and the share of the motion that remains."""

    by: Limit
    share: float
    """Part of the desired end-effector speed that remains, along it: 1 all of it, 0 none, or a contact or hold.

    It follows from the measured velocity, with its noise; without a desired motion it is the factor of eqs. 3 and 4."""
    obstacle: int = -1
    """Index in `ControlStep.obstacles` of the limiting one; -1: none, or it is out of view."""
    unit: int = -1
    """Index in the skin of the unit that saw the obstacle last; indices after those are outside points; -1: none."""
    link: int = -1
    """Index of the link closest to the obstacle, or of the touched link; -1: unknown."""
    joint: int = -1
    """Index of the joint at its limit; -1: none."""


def limited_by(step: "ControlStep") -> Limited:
    """Return the limit on the motion of a step; an active row comes before eq. 3, and both before the joints."""
    if step.mode is not Mode.TRACK:
        link = int(step.touched.link[0]) if len(step.touched.link) else -1
        return Limited(Limit.HOLD if step.mode is Mode.HOLD else Limit.CONTACT, 0.0, link=link)
    near, rows = step.obstacles, step.restricted[binding(step)]
    pressed = np.abs(step.qp.multipliers[: len(step.q)])
    joint = int(pressed.argmax()) if len(pressed) and pressed.max() > _PRESSED else -1
    by, cause = Limit.NOTHING if joint < 0 else Limit.JOINTS, -1
    if len(rows):
        by, cause = Limit.APPROACH, int(rows[near.body_distance[rows].argmin()])
    elif step.speed_scale < FULL:
        # a moving fixture slows nothing: it is infinitely far for eq. 3
        slows = len(near.unit) > 0 and bool(np.isfinite(near.ee_distance.min()))
        by, cause = Limit.SLOWED, int(near.ee_distance.argmin()) if slows else -1
    share, speed = step.speed_scale, float(np.linalg.norm(step.desired_velocity))
    if speed >= ASKED_M_S and (len(rows) or joint >= 0):
        share *= min(max(float(step.ee_velocity @ step.desired_velocity) / speed**2, 0.0), 1.0)
    unit, link = (-1, -1) if cause < 0 else (int(near.unit[cause]), int(near.link[cause]))
    return Limited(by, share, cause, unit, link, joint)


def binding(step: "ControlStep") -> BoolArray:
    """Flags (K',) of the restricted obstacles whose rows limit the motion."""
    count, qp = len(step.restricted), step.qp
    bound = np.zeros(count, dtype=np.bool_)
    if count and len(qp.slack) == count:
        bound = (qp.multipliers[-count:] > _PRESSED) | (qp.slack > 1e-6)
        if qp.violated and not bound.any():
            # a row across a normal, which the solution omits: it belongs to the nearest obstacle
            bound[step.obstacles.body_distance[step.restricted].argmin()] = True
    return bound


class Doing(Enum):
    """Motion of the arm in one word, for a first-time observer."""

    MOVING = "moving"
    SLOWED = "slowed"
    AVOIDING = "keeping away"
    RETURNING = "returning"
    YIELDING = "yielding"
    TOUCHED = "touched"
    CAUGHT = "caught"
    WAITING = "waiting"
    STOPPED = "stopped"
    """The arm holds until a person resumes."""


@dataclass(frozen=True)
class Explanation:
    """Motion of the arm and its cause."""

    doing: Doing
    sentence: str


def explain(
    step: "ControlStep",
    units: Sequence[str],
    links: Sequence[str],
    velocities: tuple[FloatArray, FloatArray] | None = None,
) -> Explanation:
    """Explain the motion of a step, its limit, and how far that limits it.

    Args:
        step: of the controller.
        units: ids of the skin's units, in its order; () where the profile has no perception, as `blind`.
        links: names of the arm's links, in the order of the model.
        velocities: of the end-effector's origin (3,) [m/s], base frame: by the commander, and as commanded to the arm.
    """
    if step.mode is Mode.HOLD:
        explanation = Explanation(Doing.STOPPED if resumable(step) else Doing.WAITING, step.reason)
    else:
        explanation = (_in_contact if step.mode is Mode.REACT else _on_the_way)(step, units, links)
    if velocities is None:
        return explanation
    return replace(explanation, sentence=f"{explanation.sentence} {_allowed(step, links, *velocities)}.")


def _allowed(step: "ControlStep", links: Sequence[str], velocity: FloatArray, allowed: FloatArray) -> str:
    """Say how much of a velocity is allowed, and which limit the sentence before does not name."""
    speeds, limited, why = (float(np.linalg.norm(velocity)), float(np.linalg.norm(allowed))), step.limited, ""
    if max(speeds) < ASKED_M_S:
        return "No motion is requested"
    if step.mode is Mode.TRACK and float(allowed @ velocity) < FULL * speeds[0] ** 2:
        if limited.link >= 0:
            why = f" near {links[limited.link]}"
        elif limited.by is Limit.JOINTS:
            why = f": joint {limited.joint + 1} is at its limit"
        elif limited.by is Limit.NOTHING:  # as near a singularity: at the end of its reach
            why = ": this posture allows no more"
    return f"Requested {speeds[0]:.2f} m/s, allowed {speeds[1]:.2f} m/s{why}"


def finds(step: "ControlStep") -> str:
    """Say which push the detector detects; '' where it does not tell."""
    if np.isnan(step.detectable_n):
        return ""
    if step.detectable_n <= LOUD_N:
        return f"detects pushes of {step.detectable_n:.0f} N or more"
    loud = "no push" if np.isinf(step.detectable_n) else f"only pushes of {step.detectable_n:.0f} N or more"
    return f"now detects {loud}"


def resumable(step: "ControlStep") -> bool:
    """Return whether a person can end the hold of a step: it latches, or waits to try a location again."""
    return step.mode is Mode.HOLD and (step.latched or step.event is Event.GIVEN_UP)


def still(step: "ControlStep") -> bool:
    """Return whether the arm is in contact and does not move."""
    return step.mode is Mode.REACT and float(np.abs(step.command).max(initial=0.0)) < _REST_RAD_S


def answers(step: "ControlStep") -> bool:
    """Return whether the arm moves with a contact."""
    return not still(step) and float(np.linalg.norm(step.reaction_velocity)) >= _ANSWER_M_S


def _sees(step: "ControlStep", units: Sequence[str], obstacle: int) -> str:
    """Say which unit sees an obstacle, or saw what is remembered, or that it is a moving fixture, and how far it is."""
    near = step.obstacles
    distance, age, unit = max(0.0, float(near.body_distance[obstacle])), near.age[obstacle], int(near.unit[obstacle])
    if np.isinf(near.ee_distance[obstacle]):
        return f"a fixture that moves is {distance:.2f} m away"
    source = units[unit] if unit < len(units) else "an outside source"
    if age > SEEN_NOW_S:
        return f"the arm remembers something at {distance:.2f} m, seen {age:.2g} s ago by {source}"
    return f"{source} sees something at {distance:.2f} m"


def _on_the_way(step: "ControlStep", units: Sequence[str], links: Sequence[str]) -> Explanation:
    """Explain a step in which the arm makes the desired motion, as far as it can."""
    limited = step.limited
    off = float(np.linalg.norm(step.ee_position - step.path_position))
    speed = float(np.linalg.norm(step.ee_velocity))
    restricted = limited.by is Limit.APPROACH
    if not (restricted or limited.by is Limit.SLOWED):
        # an arm that lags behind as it follows its path moves along it, not towards it
        least = _TOWARDS * off * max(float(np.linalg.norm(step.desired_velocity)), ASKED_M_S)
        if off >= OFF_PATH_M and (step.path_position - step.ee_position) @ step.desired_velocity >= least:
            return Explanation(Doing.RETURNING, f"Returning to its path, {off:.2f} m away.")
        near = step.obstacles.body_distance
        nothing = "nothing near is seen" if len(units) else "no sensor unit is in use"
        nearest = _sees(step, units, int(near.argmin())) if len(near) else nothing
        moves = np.linalg.norm(step.desired_velocity) >= ASKED_M_S
        return Explanation(Doing.MOVING, (f"Moving at {speed:.2f} m/s: " if moves else "In position: ") + f"{nearest}.")
    cause, share = limited.obstacle, limited.share if restricted else step.speed_scale
    no_cause = "an obstacle is out of view, or a unit or an outside source is late"
    why = _sees(step, units, cause) if cause >= 0 else no_cause
    aside = f" {off:.2f} m from its path" if restricted and off >= OFF_PATH_M else ""
    if speed < _REST_M_S and (aside or share < 0.1):
        return Explanation(Doing.WAITING, f"Waiting{aside}: {why}. It continues when the way is clear.")
    if aside:
        return Explanation(Doing.AVOIDING, f"Kept{aside}: {why}.")
    back = "" if off < OFF_PATH_M else f" on its way back to the path, {off:.2f} m away"
    if share < FULL:
        return Explanation(Doing.SLOWED, f"Slowed to {100 * share:.0f} %{back}: {why}.")
    limit = float(step.approach_limit[np.flatnonzero(step.restricted == cause)[0]])
    may = f"may near it at {limit:.2f} m/s at most" if limit >= 0 else "has to back away from it"
    return Explanation(Doing.MOVING, f"Moving, but {why}, and {links[limited.link]} {may}.")


def _in_contact(step: "ControlStep", units: Sequence[str], links: Sequence[str]) -> Explanation:
    """Explain a step in which the arm reacts to a contact."""
    if step.event is Event.OPENING:
        return Explanation(Doing.CAUGHT, step.reason)
    place, force = "", step.force - step.thresholds.mean if step.contact is None else step.contact.force
    if len(step.touched.link):  # the surest place comes first
        place, force = f" at {links[int(step.touched.link[0])]}", step.touched.force[0]
    pushed = f"Touched{place}" + (f" with {np.linalg.norm(force):.0f} N" if np.isfinite(force).all() else "")
    if step.contact is not None:  # it has not moved with it yet
        return Explanation(Doing.TOUCHED, f"{pushed}.")
    if not (len(step.touched.link) or step.evidence >= 1.0):
        if step.event is Event.REACTING:  # eq. 12 goes on whatever is measured
            return Explanation(Doing.YIELDING, f"Moving in the direction of the push for another {step.detail}.")
        then = f" The task continues {step.detail}." if step.event is Event.YIELDING else ""
        return Explanation(Doing.WAITING if still(step) else Doing.YIELDING, f"The push has ended.{then}")
    if not still(step):
        speed = float(np.linalg.norm(step.ee_velocity))
        return Explanation(Doing.YIELDING, f"{pushed}: moving with the push at {speed:.2f} m/s.")
    limiting = step.restricted[binding(step)]
    if len(limiting) and float(np.linalg.norm(step.reaction_velocity)) >= ASKED_M_S:
        return Explanation(Doing.TOUCHED, f"{pushed}: held still, because {_sees(step, units, int(limiting[0]))}.")
    return Explanation(Doing.TOUCHED, f"{pushed}: held still, the push is below what moves the arm.")
