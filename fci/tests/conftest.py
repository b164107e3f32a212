"""A served arm in a thread, a client that speaks bytes, and the vendor's clients, each in a process of its own.

Of the product's tests these use two modules that know nothing of any distribution: `tests.needs` (what is skipped is
said in one way) and `tests.ports`.
"""

import itertools
import json
import socket
import struct
import subprocess
import sys
import threading
from collections.abc import Callable
from contextlib import ExitStack, closing
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.needs import skip_for
from tests.ports import loopback

from pretouch.robot.description import robot_named
from pretouch.robot.model import RobotModel
from pretouch.sim.scene import SceneSpec
from pretouch_fci.arm import ServedArm, ServedSetup
from pretouch_fci.server import FciOptions, FciServer
from pretouch_fci.wire import CONNECT, ERRORS, HEADER, PROTOCOLS, Protocol, RobotKind

_VENDOR = Path(__file__).with_name("vendor_client.py")
_PATIENCE_S = 10.0
_FIELDS = {0: "q_c", 1: "dq_c", 2: "O_T_EE_c", 3: "O_dP_EE_c"}
"""What is commanded, by motion generator."""


def smooth(k: int, of: int) -> float:
    """Share of its way of a motion from rest to rest after so many of its milliseconds."""
    return k / of - np.sin(2 * np.pi * k / of) / (2 * np.pi)


def arm_of(kind: RobotKind = "panda", **setup: Any) -> ServedArm:
    """An arm that stands at its usual posture, in an empty scene."""
    model = RobotModel(robot_named(kind))
    usual = {"model": model, "kind": kind, "q": model.description.q_ready.copy(), "scene": SceneSpec()}
    return ServedArm(ServedSetup(**usual | setup))


@pytest.fixture
def host():
    """An address of this machine that no other test has: the vendor's clients know one port only."""
    return loopback()


class Served:
    """A server in a thread."""

    def __init__(self, arm: ServedArm, options: FciOptions) -> None:
        self.arm, self.host, self.said, self._ending = arm, options.host, list[str](), threading.Event()
        self.truth: list[list[float]] = []
        """Time [s], true force [N] and joint positions [rad] of each millisecond of the plant."""
        self.server = FciServer(arm, options, self._watch, self.said.append)
        self.protocol, self.address = self.server.protocol, self.server.address
        self._thread = threading.Thread(target=self.server.serve, args=(self._ending.is_set,))
        self._thread.start()

    def _watch(self, time: float, arm: ServedArm) -> None:
        self.truth.append([time, *arm.true_force.tolist(), *arm.plant.mj_data.qpos[:7].tolist()])

    def stop(self) -> None:
        """End it, and give its address back."""
        self._ending.set()
        self._thread.join(_PATIENCE_S)
        assert not self._thread.is_alive()
        self.server.close()
        self.arm.__exit__()

    def ask(self, what: str, *values: float, kind: str = "") -> dict[str, Any]:
        """Have a vendor's client do something (see `vendor_client.py`)."""
        name = "pylibfranka" if (kind or self.arm.kind) == "fr3" else "panda_py"
        if find_spec(name) is None:
            skip_for("make franka")
        command = [sys.executable, str(_VENDOR), kind or self.arm.kind, self.host, what, *map(str, values)]
        done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
        assert done.returncode == 0, (done.stderr, self.said)
        return json.loads(done.stdout)


@pytest.fixture
def serve(host):
    """Serve an arm until the test ends."""
    with ExitStack() as running:

        def start(kind: RobotKind = "panda", setup: dict[str, Any] | None = None, **options: Any) -> Served:
            given = FciOptions(**{"host": host, "lockstep": True, "patience": 5.0, **options})
            served = Served(arm_of(kind, **(setup or {})), given)
            running.callback(served.stop)
            return served

        yield start


class Client:
    """Sockets of a client that speaks bytes."""

    def __init__(self, address: tuple[str, int]) -> None:
        self.udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.udp.bind(("127.0.0.1", 0))
        self.udp.settimeout(_PATIENCE_S)
        self.tcp = socket.create_connection(address, timeout=_PATIENCE_S)

    def state(self) -> Any:
        raise NotImplementedError

    def state_where(self, holds: Callable[[Any], bool]) -> Any:
        return next(state for state in iter(self.state, None) if holds(state))

    def close(self) -> None:
        self.tcp.close()
        self.udp.close()


class RawClient(Client):
    """A client of the arm."""

    def __init__(self, protocol: Protocol, address: tuple[str, int]) -> None:
        super().__init__(address)
        self.protocol, self.field = protocol, "q_c"
        self._identifiers = itertools.count(1)
        self.robot_udp: Any = None
        self.connected = b""

    def connect(self, version: int) -> None:
        self.connected = self.request("Connect", CONNECT.pack(version, self.udp.getsockname()[1]))

    def send_request(self, name: str, body: bytes = b"") -> int:
        identifier = next(self._identifiers)
        self.tcp.sendall(self.protocol.reply(name, identifier, body))
        return identifier

    def answer(self) -> tuple[str, int, bytes]:
        number, identifier, size = HEADER.unpack(self._read(HEADER.size))
        return self.protocol.requests[number], identifier, self._read(size - HEADER.size)

    def request(self, name: str, body: bytes = b"") -> bytes:
        identifier = self.send_request(name, body)
        answered = self.answer()
        assert answered[:2] == (name, identifier)
        return answered[2]

    def begin(self, controller: int = 0, generator: int = 1) -> str:
        body = struct.pack("<II", controller, generator)
        status = self.request("Move", body + bytes(self.protocol.sizes["Move"] - len(body)))
        self.field = _FIELDS.get(generator, self.field)
        return self.protocol.move[status[0]]

    def begun(self, generator: int = 1, controller: int = 0) -> np.void:
        """Begin a motion and return its first state."""
        assert self.begin(controller, generator) == "started"
        return self.first_of_motion()

    def ended(self) -> str:
        name, _, body = self.answer()
        assert name == "Move"
        return self.protocol.move[body[0]]

    def state(self) -> np.void:
        data, self.robot_udp = self.udp.recvfrom(4096)
        assert len(data) == self.protocol.state.itemsize
        return np.frombuffer(data, self.protocol.state)[0]

    def first_of_motion(self) -> np.void:
        return self.state_where(lambda state: state["robot_mode"] == 2)

    def command(self, message_id: int, values: Any, finished: bool = False, **fields: Any) -> None:
        """Command values of the motion's generator, and other fields."""
        command = np.zeros((), self.protocol.command)
        fields |= {"message_id": message_id, self.field: values, "motion_generation_finished": finished}
        for name, value in fields.items():
            command[name] = value
        self.udp.sendto(command.tobytes(), self.robot_udp)

    def turn(self, state: np.void, values: Any, finished: bool = False, **fields: Any) -> np.void:
        """Answer a state and return the next."""
        self.command(int(state["message_id"]), values, finished, **fields)
        return self.state_where(lambda new: new["message_id"] > state["message_id"])

    def moved(self, state: np.void, values: Any, **fields: Any) -> np.void:
        """Answer a state and return the next, of the motion that goes on."""
        state = self.turn(state, values, **fields)
        assert state["robot_mode"] == 2, errors_of(state)
        return state

    def _read(self, size: int) -> bytes:
        data = b""
        while len(data) < size:
            part = self.tcp.recv(size - len(data))
            if not part:
                raise ConnectionError("closed")
            data += part
        return data


def errors_of(state: np.void, field: str = "errors") -> list[str]:
    """Names of the errors that a state tells."""
    return [name for name, flag in zip(ERRORS, state[field], strict=True) if flag]


@pytest.fixture
def raw():
    """Make clients that speak bytes."""
    with ExitStack() as made:

        def make(served: Served, version: int | None = None) -> RawClient:
            client = made.enter_context(closing(RawClient(served.protocol, served.address)))
            client.connect(version or served.protocol.version)
            return client

        yield make


@pytest.fixture(params=sorted(PROTOCOLS))
def kind(request):
    return request.param
