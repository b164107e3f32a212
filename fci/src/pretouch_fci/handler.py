"""Requests of the one client: what the robot does, how it is set, and what it answers."""

from collections.abc import Callable
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from pretouch.types import FloatArray
from pretouch_fci.arm import ServedArm
from pretouch_fci.collision import CollisionThresholds
from pretouch_fci.connections import Connection, Disconnected, Request
from pretouch_fci.controllers import CARTESIAN_LEAST, CARTESIAN_STIFFNESS, JOINT_MOST_NM_RAD
from pretouch_fci.frames import Inertial, pose_of, urdf_of
from pretouch_fci.model_library import library_answer
from pretouch_fci.motion import MotionEnding
from pretouch_fci.state import StateDatagram
from pretouch_fci.wire import MOVE, OF_END_EFFECTOR, ControllerMode, Generator, Protocol, RobotMode, fastest_of

_EIGENVALUE_SLACK = 1e-9
_LARGEST = 1e9
"""No value that can be set is larger."""


class AnswerStatus(IntEnum):
    """Answers to most requests."""

    SUCCESS = 0
    NOT_POSSIBLE = 1
    INVALID = 2


_WHILE_MOVING = frozenset({"SetCollisionBehavior"})
"""Requests that are accepted while a motion runs."""
_CARTESIAN_LIMIT = bytes(8 * 3) + np.eye(4).tobytes() + b"\0"
"""A virtual wall: size, pose, and that it is not active."""


class WantedMotion(NamedTuple):
    """A motion that is served."""

    generator: Generator
    controller: ControllerMode
    fastest: FloatArray | None = None
    """(7,) largest velocities [rad/s] of a motion whose way the robot finds; None if commands say the way."""


def wanted_motion(protocol: Protocol, body: bytes) -> WantedMotion | None:
    """Read the request to move; None where the motion is not served."""
    controller, generator, *_ = MOVE.unpack_from(body)
    if generator not in protocol.generators or controller not in tuple(ControllerMode)[: ControllerMode.NONE]:
        return None
    if generator == Generator.NONE and controller != ControllerMode.EXTERNAL:
        return None
    fastest = fastest_of(body)
    if fastest is not None:  # the vendor has that for positions of joints alone
        if generator != Generator.JOINT_POSITION or controller == ControllerMode.EXTERNAL:
            return None
        if not np.all((fastest > 0) & np.isfinite(fastest)):
            return None
    return WantedMotion(Generator(generator), ControllerMode(controller), fastest)


def set_or_get(arm: ServedArm, name: str, body: bytes) -> bytes:
    """Do what a request asks, if the robot may and can; return the body of the answer."""
    if arm.moving and name not in _WHILE_MOVING:
        return bytes([AnswerStatus.NOT_POSSIBLE])
    if name == "GetCartesianLimit":
        return bytes([AnswerStatus.SUCCESS]) + _CARTESIAN_LIMIT
    if name == "SetGuidingMode":
        arm.guiding_axes = np.frombuffer(body, "u1") != 0
        return bytes([AnswerStatus.SUCCESS])
    values = np.frombuffer(body, "<f8").copy()
    if not np.all(np.abs(values) <= _LARGEST):
        return bytes([AnswerStatus.INVALID])
    return bytes([AnswerStatus.SUCCESS if _set(arm, name, values) else AnswerStatus.INVALID])


def _set(arm: ServedArm, name: str, values: FloatArray) -> bool:
    """Set it, and return whether the values can be set."""
    sound = True
    match name:
        case "SetCollisionBehavior":
            behavior = CollisionThresholds.of(values)
            arm.contacts.behavior, sound = behavior or arm.contacts.behavior, behavior is not None
        case "SetEEToK" | "SetNEToEE":
            T = pose_of(values)
            if T is None:
                return False
            setattr(arm.frames, {"SetEEToK": "EE_T_K", "SetNEToEE": "NE_T_EE"}[name], T)
        case "SetLoad":
            load = Inertial(float(values[0]), values[1:4], values[4:13].reshape(3, 3).T)
            sound = load.mass >= 0 and np.allclose(load.inertia, load.inertia.T)
            sound = sound and bool(np.linalg.eigvalsh(load.inertia)[0] >= -_EIGENVALUE_SLACK)
            if sound:
                arm.announce(load)
        case "SetJointImpedance":
            sound = _within(values, 0.0, JOINT_MOST_NM_RAD)
            if sound:
                arm.plant.set_stiffness(values)
        case "SetCartesianImpedance":
            sound = _within(values, CARTESIAN_LEAST, CARTESIAN_STIFFNESS)
            arm.cartesian_stiffness = values if sound else arm.cartesian_stiffness
        case _:  # filters: taken, and the simulated ones stay what they are
            sound = bool(np.all(values >= 0) and np.any(values > 0))
    return sound


def _within(values: FloatArray, least: FloatArray | float, most: FloatArray | float) -> bool:
    return bool(np.all((values >= least) & (values <= most)))


class RequestHandler:
    """Serves the requests of one client. Raises Disconnected when the client has disconnected."""

    def __init__(
        self,
        client: Connection,
        protocol: Protocol,
        arm: ServedArm,
        state: StateDatagram,
        settle: Callable[[], None],
        begins: Callable[[], None],
        say: Callable[[str], None],
    ) -> None:
        """Serve a client; `settle` is called where the arm must come to rest first, `begins` before each motion."""
        self._client, self._protocol, self._arm, self._state = client, protocol, arm, state
        self._settle, self._begins, self._say = settle, begins, say
        self._move: int | None = None
        self._at_rest: list[tuple[str, int]] = []

    def serve(self, requests: list[Request]) -> None:
        """Serve requests in their order."""
        for request in requests:
            self._serve(request)

    def motion_ended(self, ending: MotionEnding) -> None:
        """Tell how the motion ended."""
        if ending.errors:
            self._say(f"Motion ended: {', '.join(ending.errors)}.")
        self._answer_move(ending.status)

    def at_rest(self) -> None:
        """Answer what had to wait for the arm to be at rest."""
        waiting, self._at_rest = self._at_rest, []
        for name, identifier in waiting:
            if name == "AutomaticErrorRecovery":
                self._arm.recover()
            self._answer(name, identifier, bytes([AnswerStatus.SUCCESS]))

    def _serve(self, request: Request) -> None:
        arm, name, identifier = self._arm, request.name, request.identifier
        match name:
            case "Connect":
                raise Disconnected("asks to connect once more")
            case "Move":
                self._begin(request)
            case "StopMove":
                if arm.moving:
                    arm.stop()
                    self._answer_move("preempted")
                self._when_at_rest(name, identifier)
            case "AutomaticErrorRecovery":
                if arm.moving:
                    self._answer(name, identifier, bytes([AnswerStatus.NOT_POSSIBLE]))
                else:
                    self._when_at_rest(name, identifier)
            case "LoadModelLibrary":
                self._answer(name, identifier, library_answer(arm.model, request.body, self._say))
            case "GetRobotModel":
                self._answer(name, identifier, bytes([AnswerStatus.SUCCESS]) + urdf_of(arm.model).encode())
            case _:
                answer = set_or_get(arm, name, request.body)
                self._settle()
                self._answer(name, identifier, answer)
                self._state.frames_changed()

    def _begin(self, request: Request) -> None:
        arm, motion = self._arm, wanted_motion(self._protocol, request.body)
        self._settle()
        if motion is None:
            self._say("Refused: this motion is not served.")
        if arm.mode is not RobotMode.IDLE or not arm.at_rest or motion is None:
            self._answer("Move", request.identifier, self._status("not possible"))
            return
        if motion.generator in OF_END_EFFECTOR and arm.singular:
            self._answer("Move", request.identifier, self._status("singular"))
            return
        self._begins()
        arm.begin(*motion)
        self._move = request.identifier
        self._answer("Move", request.identifier, self._status("started"))

    def _answer_move(self, status: str) -> None:
        if self._move is not None:
            identifier, self._move = self._move, None
            self._answer("Move", identifier, self._status(status))

    def _when_at_rest(self, name: str, identifier: int) -> None:
        self._settle()
        self._at_rest.append((name, identifier))
        if self._arm.at_rest:
            self.at_rest()

    def _status(self, name: str) -> bytes:
        return bytes([self._protocol.move.index(name)])

    def _answer(self, name: str, identifier: int, body: bytes) -> None:
        self._client.send(self._protocol.reply(name, identifier, body))
