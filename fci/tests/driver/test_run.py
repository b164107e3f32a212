"""`pretouch run franka` through the vendor's own libraries, against simulated arms that speak its protocol."""

import os
import re
import signal
import time
from contextlib import ExitStack

import numpy as np
import pytest
from fci.tests.soak.programs import program

from pretouch.arms.franka import identity
from pretouch.recording.reader import open_recording
from pretouch.session.memory import ConfirmedRobots

pytestmark = [pytest.mark.slow, pytest.mark.alone]
_FOLLOWING = "--no-skin", "--profile", "blind", "--floor", "-0.2", "--yes", "--seconds", "25"


@pytest.fixture
def running(tmp_path):
    """Start `pretouch run`, with a memory of its own, until it says something."""
    with ExitStack() as opened:

        def start(server, *words, until=""):
            name = f"run-{len(list(tmp_path.glob('run-*')))}"
            where = "--arm", server.kind, "--ip", server.address
            run = opened.enter_context(program(tmp_path, name, "run", "franka", *where, *words))
            assert not until or run.said_within(f"({until})"), run.said()
            return run

        yield start


@pytest.fixture
def known(serve, tmp_path):
    """Serve an arm on the paper's circle whose force sign was confirmed."""

    def start(kind="panda"):
        server = serve(kind, "--start", "path")
        ConfirmedRobots(tmp_path / "state" / "pretouch").add(identity(kind, server.address))
        return server

    return start


def test_pushes_confirm_the_sign_once_and_the_run_begins_and_ends_at_rest(serve, running, tmp_path):
    server = serve("panda", "--start", "path")
    run = running(server, *_FOLLOWING[:-1], "2", "--record", "a.mcap")
    for axis in ("+y", "+x", "+z"):
        assert run.said_within(f"(towards {re.escape(axis)})")
        server.type(axis)
    code, out = run.left()
    assert code == 0, out
    assert "The force sign is confirmed" in out
    assert "The arm is at rest." in out
    assert re.search(r"\d{4} states answered", out)
    assert "reflex" not in server.said()
    steps = [kept.step for kept in open_recording(tmp_path / "a.mcap")]
    assert np.abs(steps[0].command).max() < 0.02
    assert np.linalg.norm(steps[-1].ee_velocity) > 0.1
    assert ConfirmedRobots(tmp_path / "state" / "pretouch").is_confirmed(identity("panda", server.address))


def test_pushes_felt_the_other_way_round_refuse_before_anything_moves(serve, running, tmp_path):
    server = serve("panda", "--start", "path")
    run = running(server, *_FOLLOWING[:-1], "2")
    for axis in "yxz":
        assert run.said_within(rf"(towards \+{axis})")
        server.type(f"-{axis}")
    code, out = run.left()
    assert code == 2, out
    assert "opposite to the pushes" in out
    assert "Motion" not in server.said()
    assert not ConfirmedRobots(tmp_path / "state" / "pretouch").is_confirmed(identity("panda", server.address))


@pytest.mark.parametrize("kind", ["panda", "fr3"])
def test_the_arm_yields_to_a_push_and_sigterm_brings_it_to_rest_without_a_reflex(known, running, tmp_path, kind):
    server = known(kind)
    run = running(server, *_FOLLOWING, "--record", "a.mcap", until="TRACK")
    server.type("0,25,0:0.3")
    assert run.said_within("(REACT)")
    time.sleep(1.0)
    run.process.send_signal(signal.SIGTERM)
    code, out = run.left()
    assert code == 143, out
    assert "The arm is at rest." in out
    assert "reflex" not in server.said()
    recorded = open_recording(tmp_path / "a.mcap")
    assert recorded.complete
    steps = [kept.step for kept in recorded]
    felt = next(i for i, step in enumerate(steps) if step.contact is not None)
    assert steps[felt].contact.force[1] > 5.0
    assert steps[felt + 20].ee_velocity[1] > 0.0


@pytest.mark.parametrize(("who", "sign", "said"), [
    ("process", signal.SIGKILL, "The run ended early: The process that moves the arm"),
    ("process", signal.SIGSTOP, ""), ("server", signal.SIGKILL, ""), ("server", signal.SIGSTOP, ""),
])  # fmt: skip
def test_an_arm_that_is_not_heard_any_more_ends_the_run_and_is_not_said_to_stand(known, running, who, sign, said):
    """A pulled cable leaves the connection open; so does a process that stands still."""
    server = known()
    run = running(server, *_FOLLOWING, until="TRACK")
    for process in [server.process.pid] if who == "server" else run.family()[1:]:
        os.kill(process, sign)
    code, out = run.left(8.0 if sign == signal.SIGSTOP else 60.0)
    assert code == 1, out
    assert said in out
    assert "The arm may not be at rest" in out
    assert "The arm is at rest." not in out


def test_an_arm_in_reflex_is_refused_with_the_way_out_and_recovers(known, running):
    server = known()
    run = running(server, *_FOLLOWING, until="TRACK")
    server.type("0,80,0")
    code, out = run.left()
    assert code == 1, out
    assert "stopped by itself" in out
    assert "reflex" in server.said()
    code, out = running(server, *_FOLLOWING).left()
    assert code == 2, out
    assert "then let it recover. Run with --recover." in out
    code, out = running(server, "--recover", "--path", "hold", *_FOLLOWING[:-1], "1").left()
    assert code == 0, out
    assert "has recovered" in out


def test_a_second_program_on_the_same_arm_is_refused(known, running):
    server = known()
    first = running(server, *_FOLLOWING, until="TRACK")
    code, out = running(server, *_FOLLOWING).left()
    assert code == 2, out
    assert "in use by process" in out
    first.process.send_signal(signal.SIGINT)
    assert first.left()[0] == 130
