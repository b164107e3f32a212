"""The server by raw bytes: what no well-behaved client sends, and what a killed one leaves behind."""

import itertools
import socket
import struct
from typing import Any

import numpy as np
import pytest
from fci.tests.conftest import errors_of

from pretouch_fci.wire import ERRORS, HEADER, PROTOCOLS

_REFLEX, _IDLE, _MOVE = 4, 1, 2
_STILL = np.zeros(7)


def _sped_up(client: Any, speed: float) -> np.void:
    """Begin a motion and bring joint 7 to a speed [rad/s] within all limits; return the newest state."""
    state, qd = client.begun(), _STILL.copy()
    while qd[6] < speed:
        qd[6] += 2e-3
        state = client.turn(state, qd)
    return state


def test_the_layouts_have_the_sizes_the_vendors_have():
    sizes = {kind: (p.version, p.state.itemsize, p.command.itemsize, p.sizes["Move"]) for kind, p in PROTOCOLS.items()}
    assert sizes == {"panda": (5, 2373, 370, 56), "fr3": (10, 1377, 371, 113)}
    assert len(ERRORS) == 41


def test_another_version_is_told_ours_and_let_go(serve, raw, kind):
    served = serve(kind)
    client = raw(served, version=77)
    assert client.connected == b"\1" + struct.pack("<H", served.protocol.version)
    assert client.tcp.recv(1) == b""
    assert raw(served).connected == b"\0" + struct.pack("<H", served.protocol.version)


def test_a_bare_connection_does_no_harm(serve, raw):
    served = serve()
    for _ in range(40):
        socket.create_connection(served.server.address).close()
    held = [socket.create_connection(served.server.address) for _ in range(20)]
    assert raw(served).connected[0] == 0
    for one in held:
        one.close()


def test_what_a_client_sets_does_not_outlive_it(serve, raw):
    served = serve("fr3")
    first = raw(served)
    delivered = first.state()
    load = np.array([0.5, 0.0, 0.0, 0.1, *(1e-3 * np.eye(3)).ravel()])
    assert first.request("SetLoad", load.tobytes()) == b"\0"
    assert first.request("SetNEToEE", np.diag([-1.0, -1.0, 1.0, 1.0]).ravel().tobytes()) == b"\0"
    changed = first.state_where(lambda state: state["F_T_EE"].tolist() != delivered["F_T_EE"].tolist())
    assert changed["m_load"] == 0.5
    assert first.request("SetCollisionBehavior", np.zeros(52).tobytes()) == b"\0"
    assert _REFLEX in _modes(first)
    first.close()
    second = raw(served)
    found = second.state()
    assert [found[name].tolist() for name in ("m_load", "F_T_EE")] == [0.0, delivered["F_T_EE"].tolist()]
    assert second.request("AutomaticErrorRecovery") == b"\0"
    assert set(_modes(second)) == {_MOVE}


def _modes(client: Any) -> list[int]:
    """Modes of the robot while a client stands still in a motion for twenty states, or until they end."""
    states = [client.begun()]
    while len(states) < 20 and states[-1]["robot_mode"] == _MOVE:
        states.append(client.turn(states[-1], _STILL))
    return [int(state["robot_mode"]) for state in states]


def test_a_second_client_is_turned_away_while_the_first_is_served(serve, raw):
    served = serve()
    first = raw(served)
    second = socket.create_connection(served.server.address, timeout=5.0)
    assert second.recv(1) == b""
    second.close()
    assert first.begin() == "started"


def test_states_flow_at_a_thousand_a_second_with_rising_numbers(serve, raw, kind):
    client = raw(serve(kind, lockstep=False))
    numbers = [int(client.state()["message_id"]) for _ in range(200)]
    assert np.all(np.diff(numbers) == 1)


def test_a_client_killed_in_a_motion_leaves_an_arm_that_brakes(serve, raw, kind):
    served = serve(kind)
    client = raw(served)
    _sped_up(client, 0.5)
    client.tcp.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    client.close()
    after = raw(served)
    assert after.state_where(lambda s: not np.any(s["dq_d"]))["robot_mode"] == _IDLE
    fastest = np.abs(np.diff(np.array(served.truth)[:, 4:], axis=0)).max(axis=0) / 1e-3
    assert 0.4 < fastest[6] < 0.55
    assert after.begin() == "started"


def test_stop_preempts_the_motion_and_is_answered_at_rest(serve, raw, kind):
    client = raw(serve(kind))
    _sped_up(client, 0.3)
    client.send_request("StopMove")
    assert client.ended() == "preempted"
    assert client.answer()[2] == b"\0"
    assert not np.any(client.state_where(lambda s: s["robot_mode"] == _IDLE and not np.any(s["dq_d"]))["dq_d"])
    assert client.begin() == "started"


@pytest.mark.parametrize(
    ("generator", "error", "bad"),
    [
        (0, "joint_motion_generator_position_limits_violation", (np.nan, np.inf, 1e308)),
        (1, "joint_motion_generator_velocity_limits_violation", (np.nan, np.inf, -np.inf, 1e308)),
        (2, "cartesian_position_motion_generator_invalid_frame", (np.nan, 0.0, 2 * np.eye(4).ravel(), 1e300)),
        (3, "cartesian_motion_generator_velocity_limits_violation", (np.nan, np.inf, 1e308)),
    ],
)
def test_numbers_that_are_none_end_the_motion(serve, raw, generator, error, bad):
    client = raw(serve())
    for values in bad:
        state = client.begun(generator)
        state = client.moved(state, state["q_d"]) if generator == 0 else state
        state = client.turn(state, values)
        assert client.ended() in ("input error", "reflex")
        assert error in errors_of(state)
        assert np.all(np.isfinite(state["q_d"]))
        assert np.all(np.isfinite(state["dq_d"]))
        assert client.begin() == "not possible"
        assert client.request("AutomaticErrorRecovery") == b"\0"


@pytest.mark.parametrize(("generator", "axis", "prefix"), [(1, 6, "joint"), (3, 2, "cartesian")])
def test_a_motion_may_not_end_while_it_moves(serve, raw, generator, axis, prefix):
    client = raw(serve())
    state, velocity = client.begun(generator), np.zeros(7 if generator == 1 else 6)
    for _ in range(100):
        velocity[axis] += 1e-3
        state = client.moved(state, velocity)
    state = client.turn(state, velocity, finished=True)
    assert client.ended() == "reflex"
    error = [f"{prefix}_motion_generator_velocity_discontinuity"]
    assert errors_of(state) == errors_of(state, "reflex_reason") == error


def test_commands_of_other_states_sizes_and_senders_are_no_commands(serve, raw, kind):
    client = raw(serve(kind))
    state = client.turn(client.begun(), _STILL)
    number, wrong = int(state["message_id"]), np.full(7, 2.0)
    for other in (0, number - 1, number + 1, 2**64 - 1):
        client.command(other, wrong)
    good = np.zeros((), client.protocol.command)
    good["message_id"], good["dq_c"] = number, wrong
    for size in (0, 1, good.itemsize - 1, good.itemsize + 1, 60_000):
        client.udp.sendto((good.tobytes() + bytes(60_000))[:size], client.robot_udp)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        stranger.sendto(good.tobytes(), client.robot_udp)
    after = client.turn(state, _STILL)
    assert after["message_id"] == number + 1
    assert after["robot_mode"] == _MOVE
    assert not np.any(after["dq_d"])


def test_twenty_lost_commands_in_a_row_end_the_motion(serve, raw):
    # the very first command is never lost: so nineteen, and from the sixtieth millisecond on twenty
    client = raw(serve(drop="20/60"))
    state, rates = client.begun(), []
    while state["robot_mode"] == _MOVE:
        state = client.turn(state, _STILL)
        rates.append(float(state["control_command_success_rate"]))
    assert client.ended() == "reflex"
    assert errors_of(state) == ["communication_constraints_violation"]
    assert len(rates) == 80
    assert rates[0] == 1.0
    assert rates[19] == pytest.approx(1 / 20)
    assert rates[59] == pytest.approx(41 / 60)


def test_a_motion_without_commands_ends_in_real_time(serve, raw):
    client = raw(serve(lockstep=False))
    begun = client.begun()["message_id"]
    state = client.state_where(lambda s: s["robot_mode"] != _MOVE)
    assert client.ended() == "reflex"
    assert errors_of(state) == ["communication_constraints_violation"]
    assert 400 < state["message_id"] - begun <= 501


def test_each_motion_in_lockstep_begins_at_the_next_thousand_seconds(serve, raw):
    client = raw(serve())
    idle = client.state(), client.state()
    assert idle[0]["message_id"] < idle[1]["message_id"] < 1_000_000
    np.testing.assert_array_equal(idle[0]["tau_J"], idle[1]["tau_J"])
    for number in (1, 2):
        state = client.begun()
        assert state["message_id"] == number * 1_000_000
        state = client.turn(client.turn(state, _STILL), _STILL, finished=True)
        assert client.ended() == "success"
        assert state["robot_mode"] == _IDLE
        assert state["control_command_success_rate"] == 0.0


@pytest.mark.parametrize("wrong", [0.3, np.nan])
def test_in_lockstep_states_after_a_motion_differ_in_time_alone(serve, raw, wrong):
    client = raw(serve())
    state = _sped_up(client, 0.3)
    state = client.turn(state, np.full(7, wrong))
    told = [state, *(client.state() for _ in range(20))]
    assert all(one["robot_mode"] == _REFLEX for one in told)
    assert not np.any(state["dq_d"])
    time = client.protocol.state["message_id"].itemsize
    assert len({one.tobytes()[time:] for one in told}) == 1


def test_unknown_motions_are_not_possible_and_all_known_ones_are(serve, raw, kind):
    client = raw(serve(kind))
    for controller, generator in ((3, 1), (7, 1), (0, 4), (1, 4), (0, 2**32 - 1)):
        assert client.begin(controller, generator) == "not possible"
    for controller, generator in itertools.product((0, 1, 2), (0, 1, 2, 3)):
        state = client.begun(generator, controller)
        assert (state["controller_mode"], state["motion_generator_mode"]) == (controller, generator + 1)
        client.send_request("StopMove")
        assert client.ended() == "preempted"
        client.answer()


def test_while_it_moves_only_the_collision_behaviour_is_set(serve, raw, kind):
    client = raw(serve(kind))
    client.begin()
    assert client.request("SetJointImpedance", np.full(7, 100.0).tobytes()) == b"\1"
    assert client.request("AutomaticErrorRecovery") == b"\1"
    assert client.begin() == "not possible"
    assert client.request("SetCollisionBehavior", np.full(52, 50.0).tobytes()) == b"\0"


def test_all_other_requests_of_protocol_5_are_answered(serve, raw):
    client = raw(serve())
    assert len(client.request("GetCartesianLimit", struct.pack("<I", 3))) == 1 + 8 * 19 + 1
    assert client.request("SetFilters", np.full(5, 100.0).tobytes()) == b"\0"
    assert client.request("SetFilters", np.zeros(5).tobytes()) == b"\2"
    assert client.request("LoadModelLibrary", bytes([0, 1])) == b"\1"  # for Windows
    assert client.request("SetEEToK", np.full(16, 2.0).tobytes()) == b"\2"
    assert client.request("SetLoad", np.full(13, np.nan).tobytes()) == b"\2"
    assert client.request("SetCollisionBehavior", np.full(52, -1.0).tobytes()) == b"\2"


_MALFORMED = [
    HEADER.pack(99, 1, 12),
    HEADER.pack(1, 1, 0),
    HEADER.pack(1, 1, 2**32 - 1),
    HEADER.pack(1, 1, 13) + b"x",
    HEADER.pack(0, 1, 16) + bytes(4),
    b"GET / HTTP/1.1\r\n\r\n",
]


@pytest.mark.parametrize("message", _MALFORMED)
def test_a_client_that_sends_what_is_no_request_is_let_go(serve, raw, message):
    served = serve()
    client = raw(served)
    client.begin()
    client.tcp.sendall(message)
    client.tcp.recv(64)
    assert client.tcp.recv(64) == b""
    assert raw(served).connected[0] == 0


def test_requests_in_pieces_and_in_one_go_are_understood(serve, raw):
    client = raw(serve())
    one = client.protocol.reply("SetJointImpedance", 5, np.full(7, 100.0).tobytes())
    for byte in one:
        client.tcp.sendall(bytes([byte]))
    client.tcp.sendall(3 * one)
    assert [client.answer() for _ in range(4)] == 4 * [("SetJointImpedance", 5, b"\0")]


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_nothing_that_is_sent_kills_the_server(serve, raw, kind, seed):
    served, rng = serve(kind, patience=0.02), np.random.default_rng([seed, 8])
    for _ in range(12):
        client = raw(served)
        if rng.random() < 0.7:
            client.begin(int(rng.integers(3)), int(rng.integers(4)))
        robot = client.state() is not None and client.robot_udp
        for _ in range(int(rng.integers(1, 12))):
            size = int(rng.choice([0, 3, client.protocol.command.itemsize, 2000]))
            client.udp.sendto(rng.bytes(size), robot)
            command = np.frombuffer(rng.bytes(client.protocol.command.itemsize), client.protocol.command).copy()
            client.udp.settimeout(0.1)
            try:
                command["message_id"] = int(client.state()["message_id"])
                client.udp.sendto(command.tobytes(), robot)
                client.tcp.sendall(_some_request(client.protocol, rng))
            except OSError:  # let go: states have ended
                break
            frames = served.arm.frames
            assert np.all(np.isfinite([*frames.F_T_EE.ravel(), *frames.load.inertia.ravel()]))
        client.close()
    assert raw(served).connected[0] == 0


def _some_request(protocol: Any, rng: np.random.Generator) -> bytes:
    """A request with the right size and any content, or any bytes."""
    if rng.random() < 0.2:
        return rng.bytes(int(rng.integers(1, 200)))
    name = str(rng.choice([name for name in protocol.requests if name != "Connect"]))
    values = rng.choice([0.0, 1.0, -1.0, np.nan, np.inf, 1e300, 5e-324], protocol.sizes[name] // 8 + 1)
    return protocol.reply(name, int(rng.integers(2**32)), values.tobytes()[: protocol.sizes[name]])


def test_a_client_that_does_not_read_its_answers_is_let_go(serve, raw):
    served = serve("fr3")
    client = raw(served)
    client.tcp.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    asked = 1_000_000 * client.protocol.reply("GetRobotModel", 1, b"")
    with pytest.raises(OSError):  # noqa: PT011 - reset or broken: which is the system's affair
        client.tcp.sendall(asked)
    assert raw(served).connected[0] == 0
