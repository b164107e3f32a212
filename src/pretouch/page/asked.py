"""What a commander asked of the arm at an instant, what was allowed of it, and why."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pretouch.control.commander import asked_by
from pretouch.desired import Desired, DesiredKind
from pretouch.explanation import ASKED_M_S, FULL, Explanation, Limit, explain
from pretouch.page.frame import Frame, World
from pretouch.robot.kinematics import Kinematics
from pretouch.robot.model import RobotModel
from pretouch.sound import sound_desired
from pretouch.types import ControlStep, FloatArray


@dataclass(frozen=True, slots=True)
class Asked:
    """What was asked and what was commanded in one step. Base frame."""

    velocity: FloatArray
    """(3,) of the end-effector origin that was asked for, before anything limits it [m/s]."""
    allowed: FloatArray
    """(3,) that was commanded [m/s]."""
    goal: FloatArray | None
    """(4, 4) T_O_ee that was asked for; None: a velocity was."""


def asked_in(frame: Frame, world: World, kin: Kinematics) -> Asked | None:
    """Return what a commander asked in a step; None where nobody did, or nothing that can be used.

    `kin` is of the measured joint positions of the step.
    """
    step, model = frame.step, world.model
    given = None if frame.inputs is None else frame.inputs.desired
    if frame.inputs is None or given is None:
        return None
    desired, _ = sound_desired(given, model.n, step.stamp)
    if desired is None:
        return None
    robot = replace(frame.inputs.robot, q_commanded=step.q_commanded)
    asked = asked_by(desired, step.stamp, kin, robot, model, kin.rotation[model.ee], world.profile.task, 1.0)
    return Asked(asked.velocity, model.ee_jacobian(kin)[:3] @ step.command, _goal(desired, model))


def _goal(desired: Desired, model: RobotModel) -> FloatArray | None:
    """Pose (4, 4) that a motion ends at; None of velocities."""
    last, T = desired.number[-1], np.eye(4)
    if desired.kind is DesiredKind.POSE:
        T[:3, 3], T[:3, :3] = last[:3], last[3:].reshape(3, 3)
    elif desired.kind is DesiredKind.JOINT_POSITIONS:
        kin = model.kinematics(last)
        T[:3, 3], T[:3, :3] = kin.position[model.ee], kin.rotation[model.ee]
    else:
        return None
    return T


def told(asked: Asked | None, step: ControlStep, units: Sequence[str], links: Sequence[str]) -> Explanation:
    """Explain a step as `explain` does, with what was asked, what was allowed, and by whom it was limited."""
    found = explain(step, units, links)
    if asked is None:
        return found
    wanted, left = float(np.linalg.norm(asked.velocity)), float(np.linalg.norm(asked.allowed))
    if max(wanted, left) < ASKED_M_S:
        return replace(found, sentence=f"{found.sentence} No motion is asked.")
    why = _why(step, units, links) if float(asked.allowed @ asked.velocity) < FULL * wanted**2 else ""
    return replace(found, sentence=f"{found.sentence} Asked {wanted:.2f} m/s, allowed {left:.2f} m/s{why}.")


def _why(step: ControlStep, units: Sequence[str], links: Sequence[str]) -> str:
    limited = step.limited
    near = f" near {links[limited.link]}" if limited.link >= 0 else ""
    seen = units[limited.unit] if 0 <= limited.unit < len(units) else "an outside source"
    match limited.by:
        case Limit.SLOWED:
            return f": slowed by what {seen} sees{near}" if limited.unit >= 0 else ": slowed"
        case Limit.APPROACH:
            return f": held back by what {seen} sees{near}"
        case Limit.JOINTS:
            return f": joint {limited.joint + 1} is at its limit"
        case Limit.CONTACT:
            return ": it yields to a contact"
        case Limit.HOLD:
            return ": it holds"
        case Limit.NOTHING:  # as near a singularity: at the end of its reach
            return ": this posture allows no more"
