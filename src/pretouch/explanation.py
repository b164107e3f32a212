"""What the arm does, what limits it and how far: as values, and as one word and one sentence of a control step."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum
from typing import TYPE_CHECKING

import numpy as np

from pretouch.modes import Event, Mode
from pretouch.values import BoolArray, FloatArray, value

if TYPE_CHECKING:
    from pretouch.types import ControlStep

FULL = 0.95
"""Share of the speed asked for from which on the arm is not called slowed: what a joint velocity's noise leaves."""
ASKED_M_S = 0.005
"""Speed from which on a motion is asked for [m/s]."""
_PRESSED = 1e-9
"""Multiplier above which a limit is pressed against."""
OFF_PATH_M = 0.01
"""Distance from the path at which the arm is off it [m]; following it takes less."""
_REST_M_S = 0.015
"""Speed of the end-effector below which it rests [m/s], of a measured velocity with its noise."""
_REST_RAD_S = 0.01
"""Largest commanded joint velocity of an arm that is held still [rad/s]: 5 mm/s at half a metre."""
_ANSWER_M_S = 1e-3
"""Speed of the end-effector from which on a reaction moves the arm [m/s]."""
LOUD_N = 15.0
"""Force that should be found; where it takes more, the arm is too loud [N]: a hand that touches lightly has less."""


class Limit(Enum):
    """What keeps the arm from what is asked."""

    NOTHING = "nothing"
    SLOWED = "slowed"
    """It is slower near what is seen (eqs. 3, 4), or where units or outside sources are silent."""
    APPROACH = "approach"
    """A link may come no faster towards what is seen (eqs. 5-7), or has to back away."""
    JOINTS = "joints"
    """A joint is at its limit of position, velocity or acceleration."""
    CONTACT = "contact"
    """It yields to a contact."""
    HOLD = "hold"
    """It brakes or stands, and `ControlStep.reason` says why."""


@value
class Limited:
    """What keeps the arm from what is asked, and what is left of it."""

    by: Limit
    share: float
    """Part of the end-effector's speed asked for that is left, along it: 1 all, 0 none or in contact and hold.

    By the measured velocity, with its noise; of an end-effector not asked to move the factor of eqs. 3 and 4."""
    obstacle: int = -1
    """Row of `ControlStep.obstacles` that limits; -1: none, or it has gone from view."""
    unit: int = -1
    """Index in the skin of the unit that sees it; from their number on an outside point, -1 as before."""
    link: int = -1
    """Index of the link that is near it, or that is touched; -1 unknown."""
    joint: int = -1
    """Index of the joint at its limit; -1 of none."""


def limited_by(step: "ControlStep") -> Limited:
    """Return what limits the motion of a step; a row that binds comes before eq. 3, and both before the joints."""
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
        # what is known to move there slows nothing, and is infinitely far for eq. 3
        slows = len(near.unit) > 0 and bool(np.isfinite(near.ee_distance.min()))
        by, cause = Limit.SLOWED, int(near.ee_distance.argmin()) if slows else -1
    share, speed = step.speed_scale, float(np.linalg.norm(step.desired_velocity))
    if speed >= ASKED_M_S and (len(rows) or joint >= 0):
        share *= min(max(float(step.ee_velocity @ step.desired_velocity) / speed**2, 0.0), 1.0)
    unit, link = (-1, -1) if cause < 0 else (int(near.unit[cause]), int(near.link[cause]))
    return Limited(by, share, cause, unit, link, joint)


def binding(step: "ControlStep") -> BoolArray:
    """Which of the restricted obstacles (K',) keep the arm from what it would do."""
    count, qp = len(step.restricted), step.qp
    bound = np.zeros(count, dtype=np.bool_)
    if count and len(qp.slack) == count:
        bound = (qp.multipliers[-count:] > _PRESSED) | (qp.slack > 1e-6)
        if qp.violated and not bound.any():
            # a row across a normal, which the solution leaves out: it is of what is nearest
            bound[step.obstacles.body_distance[step.restricted].argmin()] = True
    return bound


class Doing(Enum):
    """What the arm does, in one word for somebody who sees it for the first time."""

    MOVING = "moving"
    SLOWED = "slowed"
    AVOIDING = "keeping away"
    RETURNING = "returning"
    BLOCKED = "blocked"
    YIELDING = "yielding"
    TOUCHED = "touched"
    CAUGHT = "caught"
    WAITING = "waiting"
    STOPPED = "stopped"
    """It holds until a person resumes."""


@dataclass(frozen=True)
class Explanation:
    """What the arm does and why."""

    doing: Doing
    sentence: str


def explain(
    step: "ControlStep",
    units: Sequence[str],
    links: Sequence[str],
    velocities: tuple[FloatArray, FloatArray] | None = None,
) -> Explanation:
    """Say what the arm does in a step, who limits it, and how far.

    Args:
        step: of the controller.
        units: ids of the skin's units, in its order; () where the profile has no perception, as `blind`.
        links: names of the arm's links, in the order of the model.
        velocities: of the end-effector's origin (3,) [m/s], base frame: what a commander asks, and what is commanded.
    """
    if step.mode is Mode.HOLD:
        explanation = Explanation(Doing.STOPPED if resumable(step) else Doing.WAITING, step.reason)
    else:
        explanation = (_in_contact if step.mode is Mode.REACT else _on_the_way)(step, units, links)
    if velocities is None:
        return explanation
    return replace(explanation, sentence=f"{explanation.sentence} {_allowed(step, links, *velocities)}.")


def _allowed(step: "ControlStep", links: Sequence[str], velocity: FloatArray, allowed: FloatArray) -> str:
    """Say how much of a velocity is allowed, and what the sentence before does not say of who limits it."""
    speeds, limited, why = (float(np.linalg.norm(velocity)), float(np.linalg.norm(allowed))), step.limited, ""
    if max(speeds) < ASKED_M_S:
        return "No motion is asked"
    if step.mode is Mode.TRACK and float(allowed @ velocity) < FULL * speeds[0] ** 2:
        if limited.link >= 0:
            why = f" near {links[limited.link]}"
        elif limited.by is Limit.JOINTS:
            why = f": joint {limited.joint + 1} is at its limit"
        elif limited.by is Limit.NOTHING:  # as near a singularity: at the end of its reach
            why = ": this posture allows no more"
    return f"Asked {speeds[0]:.2f} m/s, allowed {speeds[1]:.2f} m/s{why}"


def finds(step: "ControlStep") -> str:
    """Say which push is found; '' where the detector does not say."""
    if np.isnan(step.detectable_n):
        return ""
    if step.detectable_n <= LOUD_N:
        return f"finds {step.detectable_n:.0f} N"
    loud = "no push is found" if np.isinf(step.detectable_n) else f"a push is found from {step.detectable_n:.0f} N on"
    return f"here, at this speed, {loud}"


def resumable(step: "ControlStep") -> bool:
    """Whether a person can end the hold of a step: one that latches, or that waits to try a location again."""
    return step.mode is Mode.HOLD and (step.latched or step.event is Event.GIVEN_UP)


def still(step: "ControlStep") -> bool:
    """Whether the arm is in contact and does not move."""
    return step.mode is Mode.REACT and float(np.abs(step.command).max(initial=0.0)) < _REST_RAD_S


def answers(step: "ControlStep") -> bool:
    """Whether the arm moves with a contact."""
    return not still(step) and float(np.linalg.norm(step.reaction_velocity)) >= _ANSWER_M_S


def _sees(step: "ControlStep", units: Sequence[str], obstacle: int) -> str:
    """Say who sees an obstacle, or that it is known, and how far from the arm."""
    distance = max(0.0, float(step.obstacles.body_distance[obstacle]))
    if np.isinf(step.obstacles.ee_distance[obstacle]):
        return f"a fixture that moves is {distance:.2f} m away"
    unit = int(step.obstacles.unit[obstacle])
    return f"{units[unit] if unit < len(units) else 'an outside source'} sees something at {distance:.2f} m"


def _on_the_way(step: "ControlStep", units: Sequence[str], links: Sequence[str]) -> Explanation:
    """Explain a step in which the arm does what is asked, as far as it can."""
    limited = step.limited
    off = float(np.linalg.norm(step.ee_position - step.path_position))
    speed = float(np.linalg.norm(step.ee_velocity))
    restricted = limited.by is Limit.APPROACH
    if not (restricted or limited.by is Limit.SLOWED):
        if off >= OFF_PATH_M:
            return Explanation(Doing.RETURNING, f"Returning to its path, {off:.2f} m away.")
        near = step.obstacles.body_distance
        nothing = "nothing near is seen" if len(units) else "no sensor unit is in use"
        seen = _sees(step, units, int(near.argmin())) if len(near) else nothing
        moves = np.linalg.norm(step.desired_velocity) >= ASKED_M_S
        return Explanation(Doing.MOVING, (f"Moving at {speed:.2f} m/s: " if moves else "In its place: ") + f"{seen}.")
    cause, share = limited.obstacle, limited.share if restricted else step.speed_scale
    gone = "what was seen has gone from view, a unit is late, or none looks where it goes"
    why = _sees(step, units, cause) if cause >= 0 else gone
    if restricted and off >= OFF_PATH_M:
        place = f"{off:.2f} m from its path: {why}."
        if speed < _REST_M_S:
            return Explanation(Doing.BLOCKED, f"At rest {place} It goes on when the way is clear.")
        return Explanation(Doing.AVOIDING, f"Kept {place}")
    if speed < _REST_M_S and share < 0.1:
        return Explanation(Doing.BLOCKED, f"At rest: {why}. It goes on when the way is clear.")
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
            return Explanation(Doing.YIELDING, f"Moving the way it was pushed: {step.detail} left.")
        then = f" The task goes on {step.detail}." if step.event is Event.YIELDING else ""
        return Explanation(Doing.WAITING if still(step) else Doing.YIELDING, f"The push has ended.{then}")
    if not still(step):
        speed = float(np.linalg.norm(step.ee_velocity))
        return Explanation(Doing.YIELDING, f"{pushed}: moving with the push at {speed:.2f} m/s.")
    limiting = step.restricted[binding(step)]
    if len(limiting) and float(np.linalg.norm(step.reaction_velocity)) >= ASKED_M_S:
        return Explanation(Doing.TOUCHED, f"{pushed}: held still, for {_sees(step, units, int(limiting[0]))}.")
    return Explanation(Doing.TOUCHED, f"{pushed}: held still, the push is below what moves the arm.")
