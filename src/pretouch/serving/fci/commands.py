"""What the robot answers to requests that change how it is set, and to those for what is not served."""

import struct
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from pretouch.serving.fci.arm import ServedArm
from pretouch.serving.fci.collision import CollisionBehavior
from pretouch.serving.fci.frames import pose_of
from pretouch.serving.fci.inertia import Inertial
from pretouch.serving.fci.wire import Generator, Impedance
from pretouch.types import FloatArray

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
    impedance: Impedance


def wanted_motion(body: bytes) -> WantedMotion | None:
    """Read the request to move; None where the motion is not served."""
    controller, generator = struct.unpack_from("<II", body)
    if generator not in list(Generator) or controller not in (Impedance.JOINT, Impedance.CARTESIAN):
        return None
    return WantedMotion(Generator(generator), Impedance(controller))


def set_or_get(arm: ServedArm, name: str, body: bytes) -> bytes:
    """Do what a request asks, if the robot may and can; return the body of the answer."""
    if arm.moving and name not in _WHILE_MOVING:
        return bytes([Status.NOT_POSSIBLE])
    if name == "GetCartesianLimit":
        return bytes([Status.SUCCESS]) + _CARTESIAN_LIMIT
    if name == "SetGuidingMode":
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
    # stiffnesses and filters: taken, and the simulated joints' own stay what they are
    return bool(np.all(values >= 0) and np.any(values > 0))


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
    arm.frames.load = Inertial(mass, com, inertia)
    return True
