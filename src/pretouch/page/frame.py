"""Data that a page shows: the static world, one instant in it, and the motion requested then."""

from dataclasses import dataclass, replace

import numpy as np

from pretouch.control.commander import reference_of
from pretouch.control.path import Path
from pretouch.desired import Desired, DesiredKind
from pretouch.perception.local_map import LocalMap
from pretouch.profiles import Profile
from pretouch.recording.simulation import KnownBox
from pretouch.robot.kinematics import Kinematics
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.sound import sound_desired
from pretouch.types import BoolArray, ControlStep, FloatArray, Inputs


@dataclass(frozen=True)
class World:
    """Data that stay the same from one frame to the next; a change by a person makes another `World`."""

    model: RobotModel
    skin: Skin
    path: Path
    profile: Profile
    boxes: tuple[KnownBox, ...]
    hand_radius: float | None
    """Radius of the person's hand [m], None without one."""
    floor_height: float
    """[m], base frame."""

    @property
    def units_in_use(self) -> tuple[str, ...]:
        """Ids of the units whose readings the controller uses, in the skin's order; () of a blind one."""
        return self.skin.ids if self.profile.perception else ()


@dataclass(frozen=True, slots=True)
class Frame:
    """One instant to be drawn."""

    step: ControlStep
    hand: FloatArray | None
    """(3,) centre of the person's hand [m], base frame."""
    hand_target: FloatArray | None
    """(3,) where the mouse asks the hand to be [m], base frame."""
    true_force: FloatArray | None
    """(3,) contact force on the arm by everything else [N], base frame; None where only the estimate is known."""
    true_point: FloatArray | None = None
    """(3,) where that force acts [m], base frame; None where it is not known."""
    age: FloatArray | None = None
    """(K,) time since the newest reading of each unit [s]; None where it is not known."""
    inputs: Inputs | None = None
    """Inputs of the step, with the motion that a commander requested; None where they are unknown."""
    places: LocalMap | None = None
    """Remembered places after the step; None where the controller remembers none, or they are unknown."""

    def late(self, limit: float) -> BoolArray:
        """Mask of the units (K,) without a reading for longer than a time [s]."""
        if self.age is None:
            return np.zeros(len(self.step.range_distance), dtype=np.bool_)
        return self.age > limit


@dataclass(frozen=True, slots=True)
class DrivenMotion:
    """Motion that a commander requested and motion that was commanded in one step. Base frame."""

    velocities: tuple[FloatArray, FloatArray]
    """(3,) of the end-effector's origin [m/s]: asked for, before anything limits it, and commanded."""
    goal: FloatArray | None
    """(4, 4) T_O_ee that was asked for; None: a velocity was."""


def driven_motion(frame: Frame, world: World, kin: Kinematics) -> DrivenMotion | None:
    """Return what a commander asked in a step; None where nobody did, or nothing that can be used.

    `kin` is of the measured joint positions of the step.
    """
    step, model = frame.step, world.model
    if frame.inputs is None or frame.inputs.desired is None:
        return None
    desired, _ = sound_desired(frame.inputs.desired, model.n, step.stamp)
    if desired is None:
        return None
    robot = replace(frame.inputs.robot, q_commanded=step.q_commanded)
    request = reference_of(desired, step.stamp, kin, robot, model, kin.rotation[model.ee], world.profile.task, 1.0)
    allowed = model.ee_jacobian(kin)[:3] @ step.command
    return DrivenMotion((request.velocity, allowed), _goal(desired, model))


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
