"""`pretouch serve-fci` as a command."""

import csv
import os
import signal
import subprocess
import sys

import numpy as np
import pytest
from fci.tests.conftest import RawClient, arm_of

from pretouch.cli import main
from pretouch.sensing.skin import skin_for
from pretouch.units.keys import Keys, save_keys
from pretouch.units.receiver import SkinReceiver
from pretouch_fci.motion import Setpoint
from pretouch_fci.typed import TypedPushes
from pretouch_fci.wire import PANDA, ControllerMode, Generator, RobotMode


def _served(*arguments: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "pretouch.cli", "serve-fci", "--port", "0", *arguments]
    return subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env={**os.environ, "PYTHONUNBUFFERED": ""})


def _address(server: subprocess.Popen[str]) -> tuple[str, int]:
    line = server.stdout.readline()
    assert line.startswith("Listening at 127.0.0.1:")
    return "127.0.0.1", int(line.split(":")[1].split()[0])


def test_it_says_where_it_listens_and_ends_in_order_on_sigterm(tmp_path):
    truth = tmp_path / "truth.csv"
    with _served("--truth", str(truth), "--scene", "static", "--start", "path", "--push", "0:0,10,0:60") as server:
        client = RawClient(PANDA, _address(server))
        client.connect(5)
        assert client.connected == b"\0\5\0"
        for _ in range(50):
            client.state()
        client.close()
        server.send_signal(signal.SIGTERM)
        assert server.wait(10.0) == 128 + signal.SIGTERM
    rows = list(csv.DictReader(truth.read_text().splitlines()))
    assert len(rows) >= 50
    assert float(rows[40]["force_y_N"]) == 10.0


def test_its_units_are_heard_in_real_time(tmp_path, fr3_model):
    network = skin_for(fr3_model).network
    keys = Keys().with_new(network.ids)
    save_keys(keys, tmp_path / "keys.toml")
    with SkinReceiver(network, keys) as receiver:
        units = f"127.0.0.1:{receiver.address[1]}"
        words = "--units", units, "--keys", str(tmp_path / "keys.toml"), "--loss", "0.1"
        with _served("--robot", "fr3", *words) as server:
            _address(server)
            while not all(unit.accepted for unit in receiver.units):
                receiver.receive(timeout=5.0)
            server.terminate()
            server.wait(10.0)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--host", "192.0.2.1"], "Listening on 192.0.2.1:1337 failed"),
        (["--drop", "3"], "as 3/50"),
        (["--push", "1:2"], "as 2.0:0,15,0:0.5"),
        (["--object", "0.1:1"], "--object is '0.1:1': give width and mass, such as 0.04:0.5"),
        (["--units", "7337"], "give address and port"),
        (["--units", "127.0.0.1:7337"], "needs --keys"),
        (["--hand", "--scene", "static"], "--hand needs --scene empty"),
        (["--start", "-0.1,0"], "--start is '-0.1,0': give ready, path, or 7 joint angles between commas"),
        (["--start", "0,0,0,0.5,0,1,0"], "-3.072 to -0.0698"),
        (["--scene", "static", "--box", "1,1,1:1,1,1"], "--box needs --scene empty"),
        (["--box", "1,1,1"], "give centre and edges, such as 0.5,0.3,0.4:0.3,0.04,0.24"),
        (["--box", "0,0,nan:1,1,1"], "--box is '0,0,nan:1,1,1'"),
        (["--box", "0.4,0,0.5:0.3,0.3,0.3"], "The arm touches something where it stands at first"),
        (["--truth", "/nowhere/truth.csv"], "The truth cannot be written"),
    ],
)
def test_what_cannot_be_served_is_said_in_a_sentence(arguments, words, capsys):
    assert main(["serve-fci", *arguments]) == 2
    assert words in capsys.readouterr().err


@pytest.mark.parametrize(
    ("option", "value", "words"),
    [
        ("--port", "70000", "port is 70000: it must be at most 65535"),
        ("--seed", "-1", "seed is -1: it must be at least 0"),
        ("--stiffness", "0", "stiffness is 0.0: it must be greater than 0"),
        ("--stiffness", "nan", "stiffness is nan: it must be finite"),
    ],
)
def test_a_number_out_of_its_range_is_said(option, value, words, capsys):
    with pytest.raises(SystemExit, match="2"):
        main(["serve-fci", option, value])
    assert words in capsys.readouterr().err


@pytest.fixture
def arm():
    return arm_of()


@pytest.fixture
def pipe():
    """Where what a program types is read, and where it is written."""
    ours, theirs = os.pipe()
    with os.fdopen(ours) as read, os.fdopen(theirs, "wb", buffering=0) as written:
        yield read, written


def test_a_person_types_pushes(arm):
    ours, theirs = os.openpty()
    with os.fdopen(theirs) as terminal:
        typed = TypedPushes(arm, terminal)
        assert typed.possible
        assert not typed.take()
        os.write(ours, b"-y\n0,0,4:0.5\n0.1:3,0,0\n0,1")
        for _ in range(3):  # a terminal gives a line at a time
            assert not typed.take()
        arm.step(None)
        np.testing.assert_array_equal(arm.true_force, [0.0, -15.0, 4.0])
        os.write(ours, b",0:0.5\n")
        typed.take()
        arm.step(None)
        np.testing.assert_array_equal(arm.true_force, [0.0, -14.0, 4.0])
        for _ in range(100):  # a tenth of a second from when it was typed
            arm.step(None)
        np.testing.assert_array_equal(arm.true_force, [3.0, -14.0, 4.0])
    os.close(ours)


def test_a_program_types_in_place_of_a_person_and_ends_the_server_by_ending_whatever_lasts(tmp_path):
    command = [sys.executable, "-m", "pretouch.cli", "serve-fci", "--port", "0", "--lockstep", "--stdin"]
    typed = "time\nharder\nguide\n0,1,0:1e6\n"
    done = subprocess.run(command, input=typed, capture_output=True, text=True, timeout=60.0, cwd=tmp_path)
    assert done.returncode == 0
    listening, time, refused = done.stdout.splitlines()
    assert listening.startswith("Listening at")
    assert time == "The arm's time is 0.000 s."
    assert refused.startswith("'harder' is not a push")


def test_all_that_was_typed_before_the_end_of_a_pipe_is_done_once_the_arm_has_come_to_rest(arm, pipe, capsys):
    arm.begin(Generator.JOINT_VELOCITY, ControllerMode.JOINT_IMPEDANCE)
    arm.step(Setpoint(np.zeros(7)))
    arm.step(Setpoint(np.zeros(7), finished=True))
    typed = TypedPushes(arm, pipe[0], program=True)
    pipe[1].write(b"time\nharder\n\n0,15,0")  # the last without an end
    pipe[1].close()
    while not arm.settled:
        assert not typed.take()
        arm.step(None)
        assert not arm.true_force.any()
    while not typed.take():
        arm.step(None)
    assert typed.take()
    time, refused = capsys.readouterr().out.splitlines()
    assert time.startswith("The arm's time is")
    assert refused.startswith("'harder' is not a push")
    arm.step(None)
    np.testing.assert_array_equal(arm.true_force, [0.0, 15.0, 0.0])


@pytest.mark.parametrize("lockstep", [False, True])
def test_an_arm_that_is_led_by_hand_hears_what_is_typed_but_in_lockstep(arm, pipe, lockstep):
    typed = TypedPushes(arm, pipe[0], program=True, lockstep=lockstep)
    pipe[1].write(b"guide\n0,5,0:0.3\n")
    typed.take()
    arm.step(None)
    pipe[1].write(b"let go\n")
    for _ in range(100):
        assert not typed.take()
        arm.step(None)
    assert (arm.mode is RobotMode.GUIDING) is lockstep
    while not arm.settled:
        arm.step(None)
    typed.take()
    assert arm.mode is RobotMode.IDLE


def test_nobody_types_where_there_is_no_terminal(arm, tmp_path):
    (tmp_path / "typed").write_text("+y\n")
    with (tmp_path / "typed").open() as file:
        typed = TypedPushes(arm, file)
        assert not typed.possible
        typed.take()
    arm.step(None)
    assert not arm.true_force.any()
