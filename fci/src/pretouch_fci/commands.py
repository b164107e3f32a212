"""What the robot answers to requests that change how it is set, and to those for what is not served."""

from enum import IntEnum
from typing import NamedTuple

import numpy as np

from pretouch.types import FloatArray
from pretouch_fci.arm import ServedArm
from pretouch_fci.collision import CollisionBehavior
from pretouch_fci.controllers import CARTESIAN_LEAST, CARTESIAN_STIFFNESS, JOINT_MOST_NM_RAD
from pretouch_fci.frames import Inertial, pose_of
from pretouch_fci.wire import MOVE, Controller, Generator, Protocol, fastest_of

_EIGENVALUE_SLACK = 1e-9
_LARGEST = 1e9
"""No value that can be set is larger."""


class Status(IntEnum):
    """Answers to most requests."""

    SUCCESS = 0
    NOT_POSSIBLE = 1
    INVALID = 2


_WHILE_MOVING = frozenset({"SetCollisionBehavior"})
"""What can be set while a motion runs."""
_CARTESIAN_LIMIT = bytes(8 * 3) + np.eye(4).tobytes() + b"\0"
"""A virtual wall: size, pose, and that it is not active."""


class WantedMotion(NamedTuple):
    """A motion that is served."""

    generator: Generator
    controller: Controller
    fastest: FloatArray | None = None
    """(7,) largest velocities [rad/s] of a motion whose way the robot finds; None if commands say the way."""


def wanted_motion(protocol: Protocol, body: bytes) -> WantedMotion | None:
    """Read the request to move; None where the motion is not served."""
    controller, generator, *_ = MOVE.unpack_from(body)
    if generator not in protocol.generators or controller not in tuple(Controller)[: Controller.NONE]:
        return None
    if generator == Generator.NONE and controller != Controller.EXTERNAL:
        return None
    fastest = fastest_of(body)
    if fastest is not None:  # the vendor has that for positions of joints alone
        if generator != Generator.JOINT_POSITION or controller == Controller.EXTERNAL:
            return None
        if not np.all((fastest > 0) & np.isfinite(fastest)):
            return None
    return WantedMotion(Generator(generator), Controller(controller), fastest)


def set_or_get(arm: ServedArm, name: str, body: bytes) -> bytes:
    """Do what a request asks, if the robot may and can; return the body of the answer."""
    if arm.moving and name not in _WHILE_MOVING:
        return bytes([Status.NOT_POSSIBLE])
    if name == "GetCartesianLimit":
        return bytes([Status.SUCCESS]) + _CARTESIAN_LIMIT
    if name == "SetGuidingMode":
        arm.guiding_axes = np.frombuffer(body, "u1") != 0
        return bytes([Status.SUCCESS])
    values = np.frombuffer(body, "<f8").copy()
    if not np.all(np.abs(values) <= _LARGEST):
        return bytes([Status.INVALID])
    return bytes([Status.SUCCESS if _set(arm, name, values) else Status.INVALID])


def _set(arm: ServedArm, name: str, values: FloatArray) -> bool:
    """Set it, and return whether the values can be set."""
    if name == "SetCollisionBehavior":
        behavior = CollisionBehavior.of(values)
        arm.contacts.behavior = behavior or arm.contacts.behavior
        return behavior is not None
    if name in ("SetEEToK", "SetNEToEE"):
        return _set_frame(arm, name, values)
    if name == "SetLoad":
        return _set_load(arm, values)
    if name == "SetJointImpedance":
        sound = _within(values, 0.0, JOINT_MOST_NM_RAD)
        if sound:
            arm.plant.set_stiffness(values)
        return sound
    if name == "SetCartesianImpedance":
        sound = _within(values, CARTESIAN_LEAST, CARTESIAN_STIFFNESS)
        arm.cartesian_stiffness = values if sound else arm.cartesian_stiffness
        return sound
    # filters: taken, and the simulated ones stay what they are
    return bool(np.all(values >= 0) and np.any(values > 0))


def _within(values: FloatArray, least: FloatArray | float, most: FloatArray | float) -> bool:
    return bool(np.all((values >= least) & (values <= most)))


def _set_frame(arm: ServedArm, name: str, values: FloatArray) -> bool:
    T = pose_of(values)
    if T is None:
        return False
    if name == "SetEEToK":
        arm.frames.EE_T_K = T
    else:
        arm.frames.NE_T_EE = T
    return True


def _set_load(arm: ServedArm, values: FloatArray) -> bool:
    mass, com, inertia = float(values[0]), values[1:4], values[4:13].reshape(3, 3).T
    if mass < 0 or not np.allclose(inertia, inertia.T) or np.linalg.eigvalsh(inertia)[0] < -_EIGENVALUE_SLACK:
        return False
    arm.announce(Inertial(mass, com, inertia))
    return True
