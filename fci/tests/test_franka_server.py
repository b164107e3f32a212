"""The fixture `franka_server`, as a project that has installed pretouch-fci uses it."""

import re
import socket
import subprocess
import sys
import tomllib
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from fci.tests.conftest import RawClient
from fci.tests.test_gripper import GripperClient
from tests.needs import skip_for

from pretouch.errors import ParameterError, RobotError
from pretouch_fci import testing
from pretouch_fci.wire import ERRORS, GRIPPER_PORT, PORT, PROTOCOLS

pytest_plugins = ["pytester", "pretouch_fci.pytest_plugin"]

ROOT = Path(__file__).parents[1]
_MOVE, _REFLEX = 2, 4
_STILL = np.zeros(7)


@pytest.fixture
def connected(raw):
    """Connect clients that speak bytes."""
    return lambda server, kind: raw(SimpleNamespace(protocol=PROTOCOLS[kind], address=(server.host, PORT)))


def _motion(client: RawClient, seconds: float, qd: Any = _STILL) -> np.void:
    """Speed up to velocities (7,) [rad/s] within a second, keep them, and stop; return the last state of the motion."""
    state, milliseconds = client.begun(), round(1000 * seconds)
    for k in range(milliseconds):
        share = min(1.0, k / 1000, (milliseconds - k) / 1000)
        state = client.turn(state, share * np.asarray(qd))
        if state["robot_mode"] != _MOVE:
            return state
    state = client.turn(state, _STILL, finished=True)
    assert client.ended() == "success"
    return state


@pytest.mark.slow
@pytest.mark.parametrize("kind", sorted(PROTOCOLS))
def test_pushes_come_when_they_are_wanted_and_all_is_the_same_each_time(franka_server, connected, kind):
    truths, states = [], []
    for _ in range(2):
        server = franka_server(robot=kind)
        server.push((0, 15, -4), seconds=0.2, at=0.3)
        client = connected(server, kind)
        states += [_motion(client, 0.7)]
        server.push((5, 0, 0), seconds=0.1)
        states += [_motion(client, 0.3)]
        truths.append(server.truth)
    truth = truths[0]
    # each motion is followed by the half second in which the arm comes to rest
    assert len(truth.time) == 700 + 500 + 300 + 500
    np.testing.assert_allclose(truth.time[[0, 700 + 500]], [1000.001, 2000.001])
    pushed = truth.time[truth.force[:, 1] == 15.0]
    np.testing.assert_allclose(pushed[[0, -1]], [1000.301, 1000.5])
    assert len(pushed) == 200
    assert truth.time[truth.force[:, 0] == 5.0][0] == 2000.001
    for name in ("time", "force", "q"):
        np.testing.assert_array_equal(getattr(truths[0], name), getattr(truths[1], name))
    assert [state.tobytes() for state in states[:2]] == [state.tobytes() for state in states[2:]]


@pytest.mark.slow
def test_a_box_is_run_into_and_the_server_says_why_the_motion_ended(franka_server, connected):
    server = franka_server(robot="fr3", box=("0.35,0.3,0.5:0.6,0.1,0.6",))
    state = _motion(connected(server, "fr3"), 4.0, [0.4, 0, 0, 0, 0, 0, 0])
    assert state["robot_mode"] == _REFLEX
    assert state["reflex_reason"][ERRORS.index("cartesian_reflex")]
    truth = server.truth
    assert np.linalg.norm(truth.force, axis=1).max() > 20.0
    assert truth.q[-1, 0] > 0.05
    assert any("cartesian_reflex" in line for line in server.said)


@pytest.mark.slow
def test_a_person_comes_and_pushes(franka_server, connected):
    server = franka_server(scene="dynamic", seed=1)
    client = connected(server, "panda")
    assert client.request("SetCollisionBehavior", np.full(52, 90.0).tobytes()) == b"\0"
    _motion(client, 8.0)
    sizes = np.linalg.norm(server.truth.force, axis=1)
    assert 10.0 < sizes.max() < 60.0
    assert not sizes[:4000].any()


@pytest.mark.slow
def test_an_object_is_grasped_and_loads_the_arm_the_same_each_time(franka_server, connected):
    truths = []
    for _ in range(2):
        server = franka_server(object="0.04:0.8")
        client, gripper = connected(server, "panda"), GripperClient((server.host, GRIPPER_PORT))
        gripper.connect()
        _motion(client, 0.2)
        assert gripper.request(2, 0.04, 0.005, 0.005, 0.1, 20.0) == 0
        _motion(client, 0.2)
        gripper.close()
        truths.append(server.truth)
    # the arm comes to rest after each motion, and with what it has grasped
    assert len(truths[0].time) == 200 + 500 + 500 + 200 + 500
    sagged = truths[0].q[200 + 500 + 500 - 1] - truths[0].q[200 + 500 - 1]
    assert 1e-4 < np.abs(sagged).max() < 0.05
    np.testing.assert_array_equal(truths[0].q, truths[1].q)


_START = -0.1, -0.5, 0.1, -2.0, 0.0, 1.6, 0.7


@pytest.fixture(scope="module")
def standing():
    """A server whose arm stands at `_START`."""
    with testing.FrankaServer(start=",".join(map(str, _START))) as server:
        yield server


def test_it_stands_where_the_test_wants_it_to(standing, connected):
    np.testing.assert_allclose(connected(standing, "panda").state()["q"], _START, atol=2e-2)


def test_in_a_motion_the_truth_is_not_told_and_the_user_stop_ends_it(franka_server, connected, monkeypatch):
    server = franka_server()
    client = connected(server, "panda")
    state = client.turn(client.begun(), _STILL)
    monkeypatch.setattr(testing, "_ANSWERS_S", 0.2)
    with pytest.raises(RobotError, match=r"does not answer within 0\.2 s: is it in a motion\?"):
        _ = server.truth
    server.press_stop()
    state = client.turn(state, _STILL)  # the command that was due is followed
    assert client.turn(state, _STILL)["robot_mode"] == 5
    assert client.ended() == "emergency"
    server.press_stop(pressed=False)
    client.state_where(lambda s: s["robot_mode"] == 1)


def test_each_option_of_the_command_is_one_of_the_fixture_and_a_server_that_has_gone_is_said(franka_server):
    server = franka_server(lockstep=False, push=["0:0,5,0", "1:0,5,0"], start="path", patience=3)
    assert server.said == (f"Listening at {server.host}:{PORT} (FCI 5, real time), gripper at port 1338.",)
    server.close()
    with pytest.raises(RobotError, match="has ended"):
        server.push((0, 1, 0))


def test_what_cannot_be_served_is_an_error_that_says_why(franka_server):
    with pytest.raises(RobotError, match=r"(?s)The simulated robot has ended: .*--scenes.*--scene "):
        franka_server(scenes="static")


def test_what_is_no_push_is_said(standing):
    for wrong in ((0, np.nan, 0), (0, 2000, 0), (0, 1)):
        with pytest.raises(ParameterError, match="The push is "):
            standing.push(wrong)


_INNER = """
import struct, socket
from pathlib import Path
from pretouch_fci.wire import CONNECT, PANDA

def test_fails_in_a_motion(franka_server):
    server = franka_server()
    Path("host").write_text(server.host)
    tcp = socket.create_connection((server.host, 1337))
    udp = socket.socket(type=socket.SOCK_DGRAM)
    udp.bind(("127.0.0.1", 0))
    tcp.sendall(PANDA.reply("Connect", 1, CONNECT.pack(5, udp.getsockname()[1])))
    tcp.sendall(PANDA.reply("Move", 2, struct.pack("<II", 0, 1) + bytes(48)))
    Path("held").touch()
    hold.append((tcp, udp))
    assert False, "on purpose"

hold = []

def test_of_something_else():
    for tcp, udp in hold:
        tcp.close()
        udp.close()
"""


def test_whatever_a_test_does_its_server_ends_and_what_it_said_is_reported(pytester):
    pytester.makepyfile(_INNER)
    done = pytester.runpytest_subprocess("-p", "pretouch_fci.pytest_plugin", "-W", "error")
    done.assert_outcomes(failed=1, passed=1)
    host = (pytester.path / "host").read_text()
    done.stdout.fnmatch_lines([f"{host}:", f"*Listening at {host}:1337 (FCI 5, lockstep)*", "*Client 127.* connected."])
    with socket.socket() as nobody, pytest.raises(ConnectionRefusedError):
        nobody.connect((host, PORT))


def test_a_killed_test_run_leaves_no_server_behind(tmp_path):
    program = (
        "import os, sys\nfrom pretouch_fci.testing import FrankaServer\nserver = FrankaServer()\n"
        "print(server.host, flush=True)\nsys.stdin.read()"
    )
    with (
        subprocess.Popen(
            [sys.executable, "-c", program], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, cwd=tmp_path
        ) as run,
        socket.create_connection((run.stdout.readline().strip(), PORT), timeout=20.0) as tcp,
    ):
        run.kill()
        with suppress(ConnectionResetError):  # closed or reset, as it happens
            assert tcp.recv(1) == b""


def test_a_run_that_does_not_use_it_loads_nothing_and_warns_of_nothing(pytester):
    pytester.makepyfile(
        "import sys\ndef test_nothing():\n"
        "    assert not {'numpy', 'mujoco', 'numba', 'pretouch_fci.testing', 'pretouch.errors'} & set(sys.modules)"
    )
    done = pytester.runpytest_subprocess("-p", "pretouch_fci.pytest_plugin", "-W", "error")
    done.assert_outcomes(passed=1, warnings=0)


def test_pytest_finds_it_and_nothing_else_of_the_distribution_needs_pytest():
    points = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["entry-points"]["pytest11"]
    assert points == {"pretouch_fci.pytest_plugin": "pretouch_fci.pytest_plugin"}
    source = ROOT / "src"
    need = [
        path.name for path in source.rglob("*.py") if re.search(r"^\s*(import|from) pytest", path.read_text(), re.M)
    ]
    assert need == ["pytest_plugin.py"]


@pytest.mark.slow
def test_the_example_of_the_readme_passes_and_finds_a_program_that_goes_on(pytester):
    """In one process with the vendor's library, which holds the interpreter while it waits for a state."""
    if find_spec("pylibfranka") is None:
        skip_for("make franka")
    text = (ROOT / "README.md").read_text()
    (example,) = re.findall(r"^```python\n([^`]*franka_server[^`]*)^```$", text, re.MULTILINE)
    pytester.makepyfile(example)
    pytester.runpytest_subprocess("-p", "pretouch_fci.pytest_plugin", "-W", "error").assert_outcomes(passed=1)
    pytester.makepyfile(example.replace("> 10", "> 1000"))
    pytester.runpytest_subprocess("-p", "pretouch_fci.pytest_plugin", "-W", "error").assert_outcomes(failed=1)


def test_guided_by_hand_the_arm_goes_where_it_is_pushed(standing):
    standing.guide()
    standing.push((0, 15, 0), seconds=0.3)
    standing.guide(pressed=False)
    truth = standing.truth
    assert truth.force[:, 1].max() == 15
    assert truth.q[-1, 0] - truth.q[0, 0] > 0.05
    # let go, it brakes
    assert np.abs(truth.q[-1] - truth.q[-50]).max() < 5e-3
