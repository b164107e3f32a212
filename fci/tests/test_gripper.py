"""The gripper: its fingers as values, its port by raw bytes, and the vendor's own clients."""

import math
import socket
import struct
from contextlib import ExitStack, closing
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pytest
from fci.tests.conftest import Client, arm_of

from pretouch.errors import ParameterError, RobotError
from pretouch_fci.gripper import HOMING, Course, Gripper, GripperObject, Outcome, grasp_of, move_of, object_of
from pretouch_fci.server import FciOptions, FciServer

_CUBE = GripperObject(0.04, 0.5)
_CONNECT, _HOMING, _GRASP, _MOVE, _STOP = range(5)
_SUCCESS, _FAIL, _UNSUCCESSFUL, _ABORTED = range(4)


class State(NamedTuple):
    """A datagram of the gripper."""

    message_id: int
    width: float
    max_width: float
    is_grasped: bool
    temperature: int


class GripperClient(Client):
    """A client that speaks bytes; the layouts are written down once more, as the vendor publishes them."""

    def send(self, command: int, identifier: int, body: bytes = b"") -> None:
        self.tcp.sendall(struct.pack("<HII", command, identifier, 10 + len(body)) + body)

    def answer(self) -> tuple[int, int, int]:
        """Command, identifier and status of the next answer."""
        data = self.tcp.recv(12, socket.MSG_WAITALL)
        assert len(data) == 12
        command, identifier, size, status = struct.unpack("<HIIH", data)
        assert size == 12
        return command, identifier, status

    def request(self, command: int, *values: float) -> int:
        self.send(command, 77, struct.pack(f"<{len(values)}d", *values))
        answered = self.answer()
        assert answered[:2] == (command, 77)
        return answered[2]

    def connect(self, version: int = 3) -> tuple[int, ...]:
        self.send(_CONNECT, 5, struct.pack("<HH", version, self.udp.getsockname()[1]))
        return struct.unpack("<HIIHH", self.tcp.recv(14, socket.MSG_WAITALL))

    def state(self) -> State:
        data = self.udp.recv(4096)
        assert len(data) == 23
        return State(*struct.unpack("<IddBH", data))


@pytest.fixture
def client():
    """Make clients of the gripper of a server, connected unless it is said otherwise."""
    with ExitStack() as made:

        def make(served: Any, connected: bool = True) -> GripperClient:
            one = made.enter_context(closing(GripperClient(served.server.gripper_address)))
            assert not connected or one.connect() == (_CONNECT, 5, 14, _SUCCESS, 3)
            return one

        yield make


def _done(gripper: Gripper, course: Course) -> tuple[Gripper, Outcome, float]:
    """The gripper when a command has ended, what became of it, and how long it took [s]."""
    gripper, outcome, steps = replace(gripper, course=course), None, 0
    while outcome is None:
        gripper, outcome = gripper.step(0.001)
        steps += 1
    assert gripper.course is None
    return gripper, outcome, 0.001 * steps


# the fingers


def test_fingers_move_at_the_speed_that_is_asked_for_and_at_most_as_fast_as_the_vendor_says():
    moved, outcome, seconds = _done(Gripper(), move_of(0.03, 0.05))
    assert (moved.width, outcome) == (0.03, Outcome.SUCCESS)
    assert seconds == pytest.approx(1.0, abs=2e-3)
    assert _done(Gripper(), move_of(0.03, 7.0))[2] == pytest.approx(0.5, abs=2e-3)
    homed, outcome, seconds = _done(moved, HOMING)
    assert (homed.width, outcome) == (0.08, Outcome.SUCCESS)
    assert seconds == pytest.approx(0.3 + 0.8, abs=3e-3)


@pytest.mark.parametrize(
    ("width", "inner", "outer", "grasped"),
    [
        (0.04, 0.005, 0.005, True), (0.036, 0.005, 0.005, True), (0.034, 0.005, 0.005, False),
        (0.044, 0.005, 0.005, True), (0.046, 0.005, 0.005, False), (0.0, 0.0, 0.08, True), (0.04, 0.0, 0.0, False),
    ],
)  # fmt: skip
def test_an_object_is_grasped_if_its_width_is_within_the_tolerances(width, inner, outer, grasped):
    gripper, outcome, _ = _done(Gripper(_CUBE), grasp_of(width, inner, outer, 0.1, 20.0))
    assert gripper.width == _CUBE.width
    assert gripper.grasped is grasped
    assert outcome is (Outcome.SUCCESS if grasped else Outcome.UNSUCCESSFUL)
    assert gripper.load_kg == (_CUBE.mass if grasped else 0.0)


def test_a_grasp_of_nothing_is_unsuccessful_and_carries_nothing():
    gripper, outcome, _ = _done(Gripper(), grasp_of(0.04, 0.005, 0.005, 0.1, 20.0))
    assert (gripper.width, gripper.grasped, outcome) == (0.0, False, Outcome.UNSUCCESSFUL)
    # by the vendor's words the distance decides: closed fingers are within these tolerances
    gripper, outcome, _ = _done(Gripper(), grasp_of(0.0, 0.005, 0.005, 0.1, 20.0))
    assert (gripper.grasped, gripper.load_kg, outcome) == (True, 0.0, Outcome.SUCCESS)


def test_an_object_is_held_until_the_fingers_open():
    held = _done(Gripper(_CUBE), grasp_of(0.04, 0.005, 0.005, 0.1, 20.0))[0]
    closer, outcome, _ = _done(held, move_of(0.01, 0.1))
    assert (closer.width, closer.grasped, outcome) == (0.04, True, Outcome.UNSUCCESSFUL)
    opening, _ = replace(closer, course=move_of(0.08, 0.1)).step(0.001)
    assert not opening.grasped
    assert opening.load_kg == 0.0


@pytest.mark.parametrize("bad", [-1.0, math.nan, math.inf])
@pytest.mark.parametrize("which", range(5))
def test_widths_tolerances_speeds_and_forces_that_it_does_not_have_are_no_command(which, bad):
    values = [0.04, 0.01, 0.01, 0.1, 20.0]
    assert grasp_of(*values) is not None
    values[which] = bad
    assert grasp_of(*values) is None
    assert move_of(values[0], values[3]) is None or which in (1, 2, 4)


def test_an_object_is_written_with_width_and_mass():
    assert object_of("0.04:0.5") == _CUBE
    for text in ("0.04", "0.08:1", "0:1", "0.04:0", "0.04:4", "nan:1", "0.04:1:2", "wide:1"):
        with pytest.raises(ParameterError, match=r"give width and mass, such as 0\.04:0\.5"):
            object_of(text)


# its port


def test_states_say_width_grasp_and_a_time_that_rises(serve, client):
    gripper = client(serve(lockstep=False))
    first, second = gripper.state(), gripper.state()
    assert first[1:] == second[1:] == (0.08, 0.08, False, 30)
    assert second.message_id - first.message_id == 10


def test_a_move_takes_its_time_in_real_time(serve, client):
    gripper = client(serve(lockstep=False))
    before = gripper.state()
    gripper.send(_MOVE, 1, struct.pack("<dd", 0.06, 0.1))
    widths = [before.width]
    while widths[-1] > 0.06:
        after = gripper.state()
        widths.append(after.width)
    assert gripper.answer() == (_MOVE, 1, _SUCCESS)
    assert after.message_id - before.message_id >= 200
    assert np.diff(widths).min() == pytest.approx(-0.001)


@pytest.mark.parametrize(("command", "body"), [(_STOP, b""), (_MOVE, struct.pack("<dd", 0.08, 0.1)), (_HOMING, b"")])
def test_a_command_ends_the_one_before_which_is_aborted(serve, client, command, body):
    served = serve(lockstep=False)
    gripper = client(served)
    gripper.send(_MOVE, 1, struct.pack("<dd", 0.0, 0.01))
    gripper.state_where(lambda state: state.width < 0.08)
    gripper.send(command, 2, body)
    assert gripper.answer() == (_MOVE, 1, _ABORTED)
    assert gripper.answer() == (command, 2, _SUCCESS)
    if command == _STOP:
        stopped = served.arm.gripper.width
        gripper.state_where(lambda state: state.width == stopped)
        assert gripper.state().width == stopped > 0.0


def test_in_lockstep_a_command_takes_its_way_at_once(serve, client):
    gripper = client(serve(setup={"object": _CUBE}))
    assert gripper.request(_HOMING) == _SUCCESS
    assert gripper.request(_GRASP, 0.04, 0.005, 0.005, 5e-324, 20.0) == _SUCCESS
    assert gripper.state_where(lambda state: state.width < 0.08)[1:] == (0.04, 0.08, True, 30)
    assert gripper.request(_MOVE, 0.02, 0.001) == _UNSUCCESSFUL
    assert gripper.request(_MOVE, 0.2, 0.1) == _FAIL
    assert gripper.request(_GRASP, 0.04, -1.0, 0.005, 0.1, 20.0) == _FAIL
    assert gripper.request(_STOP) == _SUCCESS


def test_the_arm_carries_what_is_grasped_until_the_fingers_open(serve, raw, client, kind):
    served = serve(kind, setup={"object": _CUBE})
    arm, gripper = raw(served), client(served)
    payload = served.arm.plant.mj_model.body("payload").mass
    alone, torques = float(payload[0]), arm.state()["tau_J"]
    assert gripper.request(_GRASP, 0.04, 0.005, 0.005, 0.1, 20.0) == _SUCCESS
    assert payload[0] == pytest.approx(alone + 0.5)
    arm.state_where(lambda state: bool(np.any(state["tau_J"] != torques)))
    assert served.arm.settled
    assert gripper.request(_MOVE, 0.08, 0.1) == _SUCCESS
    assert payload[0] == alone
    assert not any("ended" in line for line in served.said)


def test_in_a_motion_in_lockstep_it_is_served_while_the_arm_waits_for_its_command(serve, raw, client):
    served = serve(setup={"object": _CUBE})
    arm, gripper = raw(served), client(served)
    state = arm.turn(arm.begun(), np.zeros(7))
    first = gripper.state()
    assert gripper.state().message_id > first.message_id
    assert gripper.request(_GRASP, 0.04, 0.005, 0.005, 0.1, 20.0) == _SUCCESS
    assert arm.turn(state, np.zeros(7))["message_id"] == state["message_id"] + 1


def test_a_second_client_is_turned_away_and_the_next_finds_what_the_first_left(serve, client):
    served = serve(setup={"object": _CUBE})
    first = client(served)
    assert first.request(_GRASP, 0.04, 0.005, 0.005, 0.1, 20.0) == _SUCCESS
    assert client(served, connected=False).tcp.recv(1) == b""
    assert first.request(_STOP) == _SUCCESS
    first.close()
    assert client(served).state().is_grasped


def test_without_its_port_the_arm_is_not_served_either(host):
    arm = arm_of()
    with socket.create_server((host, 1338)), pytest.raises(RobotError, match=f"Listening on {host}:1338 failed"):
        FciServer(arm, FciOptions(host))
    FciServer(arm, FciOptions(host)).close()


@pytest.mark.parametrize("message", [struct.pack("<HIIHH", _CONNECT, 1, 14, 3, 9), b"GET / HTTP/1.1\r\n\r\n"])
def test_a_client_that_sends_what_is_no_request_is_let_go_and_the_fingers_stop(serve, client, message):
    served = serve(lockstep=False)
    first = client(served)
    first.send(_MOVE, 1, struct.pack("<dd", 0.0, 0.01))
    first.state_where(lambda state: state.width < 0.08)
    first.tcp.sendall(message)
    assert first.tcp.recv(64) == b""
    second = client(served)
    assert second.state().width == second.state().width > 0.0


# the vendor's clients


def test_the_vendors_client_grasps_and_lets_go(serve, kind):
    done = serve(kind, setup={"object": _CUBE}).ask("gripper")
    assert done["first"] == [0.08, 0.08, False, 30]
    assert done["results"] == [True, True, False, True, False, True]
    assert done["widths"] == [0.08, 0.04, 0.04, 0.08, 0.04, 0.04]
    assert done["grasped"] == [False, True, True, False, False, False]
    assert done["failed"] == "libfranka gripper: Command failed!"
    assert done["second"] == "libfranka: TCP connection got interrupted."
