"""Requests of the one client: what the robot does, and what it answers."""

from collections.abc import Callable

from pretouch_fci.arm import ServedArm
from pretouch_fci.commands import Status, set_or_get, wanted_motion
from pretouch_fci.connections import Connection, Disconnected, Request
from pretouch_fci.model_library import library_answer
from pretouch_fci.motion import Ending
from pretouch_fci.state import StateDatagram
from pretouch_fci.urdf import urdf_of
from pretouch_fci.wire import OF_END_EFFECTOR, Protocol, RobotMode


class RequestHandler:
    """Serves the requests of one client. Raises Disconnected when the client has disconnected."""

    def __init__(
        self, client: Connection, protocol: Protocol, arm: ServedArm, state: StateDatagram,
        settle: Callable[[], None], begins: Callable[[], None], say: Callable[[str], None],
    ) -> None:  # fmt: skip
        """Serve a client.

        `settle` is called where the arm is to come to rest before it goes on, and `begins` before a motion begins.
        """
        self._client, self._protocol, self._arm, self._state = client, protocol, arm, state
        self._settle, self._begins, self._say = settle, begins, say
        self._move: int | None = None
        self._at_rest: list[tuple[str, int]] = []

    def serve(self, requests: list[Request]) -> None:
        """Serve requests in their order."""
        for request in requests:
            self._serve(request)

    def motion_ended(self, ending: Ending) -> None:
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
            self._answer(name, identifier, bytes([Status.SUCCESS]))

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
                    self._answer(name, identifier, bytes([Status.NOT_POSSIBLE]))
                else:
                    self._when_at_rest(name, identifier)
            case "LoadModelLibrary":
                self._answer(name, identifier, library_answer(arm.model, request.body, self._say))
            case "GetRobotModel":
                self._answer(name, identifier, bytes([Status.SUCCESS]) + urdf_of(arm.model).encode())
            case _:
                answer = set_or_get(arm, name, request.body)
                self._settle()
                self._answer(name, identifier, answer)
                self._state.frames_changed()

    def _begin(self, request: Request) -> None:
        arm, wanted = self._arm, wanted_motion(self._protocol, request.body)
        self._settle()
        if wanted is None:
            self._say("Refused: this motion is not served.")
        if arm.mode is not RobotMode.IDLE or not arm.at_rest or wanted is None:
            self._answer("Move", request.identifier, self._status("not possible"))
            return
        if wanted.generator in OF_END_EFFECTOR and arm.singular:
            self._answer("Move", request.identifier, self._status("singular"))
            return
        self._begins()
        arm.begin(*wanted)
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
