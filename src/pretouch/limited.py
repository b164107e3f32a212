"""What keeps an arm from what is asked of it, read off a control step."""

from enum import Enum
from typing import TYPE_CHECKING

import numpy as np

from pretouch.modes import Mode
from pretouch.values import BoolArray, value

if TYPE_CHECKING:
    from pretouch.types import ControlStep

FULL = 0.95
"""Share of the speed asked for from which on the arm is not called slowed: what a joint velocity's noise leaves."""
ASKED_M_S = 0.005
"""Speed from which on a motion is asked for [m/s]."""
_PRESSED = 1e-9
"""Multiplier above which a limit is pressed against."""


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
    share, asked = step.speed_scale, float(np.linalg.norm(step.desired_velocity))
    if asked >= ASKED_M_S and (len(rows) or joint >= 0):
        share *= min(max(float(step.ee_velocity @ step.desired_velocity) / asked**2, 0.0), 1.0)
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
