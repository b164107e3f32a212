"""`pretouch run franka` through the vendor's own libraries, against simulated arms that speak its protocol."""

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from pretouch.arms.franka import identity
from pretouch.recording.reader import open_recording
from pretouch.session.confirmations import ConfirmedRobots

pytestmark = [pytest.mark.slow, pytest.mark.alone]
_FOLLOWING = "--no-skin", "--profile", "blind", "--floor", "-0.2", "--yes", "--seconds", "25"


def running(server, folder, *words):
    """Start `pretouch run` in a process of its own, with a memory of its own."""
    where = "--arm", server.kind, "--ip", server.address
    return subprocess.Popen(
        [sys.executable, "-m", "pretouch.cli", "run", "franka", *where, *words],
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL, text=True, cwd=folder,
        env=os.environ | {"XDG_STATE_HOME": str(folder / "state")},
    )  # fmt: skip


def children(run):
    """The processes that a run has started, but for that of the library which counts what is shared."""
    numbers = Path(f"/proc/{run.pid}/task/{run.pid}/children").read_text().split()
    return [int(n) for n in numbers if "resource_tracker" not in Path(f"/proc/{n}/cmdline").read_text()]


@pytest.fixture
def known(serve, tmp_path):
    """Serve an arm on the paper's circle whose force sign was confirmed."""

    def start(kind="panda"):
        server = serve(kind, "--start", "path")
        ConfirmedRobots(tmp_path / "state" / "pretouch").keep(identity(kind, server.address))
        return server

    return start


def said_until(process, sign):
    """Read what a process says until a line has a sign in it."""
    lines = []
    for line in process.stdout:
        lines.append(line)
        if sign in line:
            return "".join(lines)
    raise AssertionError(f"{sign!r} was not said:\n{''.join(lines)}")


def test_pushes_confirm_the_sign_once_and_the_run_begins_and_ends_at_rest(serve, tmp_path):
    server = serve("panda", "--start", "path")
    run = running(server, tmp_path, *_FOLLOWING[:-1], "2", "--record", "a.mcap")
    for axis in ("+y", "+x", "+z"):
        said_until(run, f"towards {axis}")
        server.type(axis)
    out, _ = run.communicate(timeout=60)
    assert run.returncode == 0, out
    assert "The force sign is confirmed" in out
    assert "The arm is at rest." in out
    assert re.search(r"\d{4} states answered", out)
    assert "reflex" not in server.said()
    steps = [kept.step for kept in open_recording(tmp_path / "a.mcap")]
    assert np.abs(steps[0].command).max() < 0.02
    assert np.linalg.norm(steps[-1].ee_velocity) > 0.1
    assert ConfirmedRobots(tmp_path / "state" / "pretouch").is_confirmed(identity("panda", server.address))


def test_pushes_felt_the_other_way_round_refuse_before_anything_moves(serve, tmp_path):
    server = serve("panda", "--start", "path")
    run = running(server, tmp_path, *_FOLLOWING[:-1], "2")
    for axis in "yxz":
        said_until(run, f"towards +{axis}")
        server.type(f"-{axis}")
    out, _ = run.communicate(timeout=60)
    assert run.returncode == 2, out
    assert "opposite to the pushes" in out
    assert "Motion" not in server.said()
    assert not ConfirmedRobots(tmp_path / "state" / "pretouch").is_confirmed(identity("panda", server.address))


@pytest.mark.parametrize("kind", ["panda", "fr3"])
def test_the_arm_yields_to_a_push_and_sigterm_brings_it_to_rest_without_a_reflex(known, tmp_path, kind):
    server = known(kind)
    run = running(server, tmp_path, *_FOLLOWING, "--record", "a.mcap")
    said_until(run, "TRACK")
    server.type("0,25,0:0.3")
    said_until(run, "REACT")
    time.sleep(1.0)
    run.send_signal(signal.SIGTERM)
    out, _ = run.communicate(timeout=60)
    assert run.returncode == 143, out
    assert "The arm is at rest." in out
    assert "reflex" not in server.said()
    recorded = open_recording(tmp_path / "a.mcap")
    assert recorded.complete
    steps = [kept.step for kept in recorded]
    felt = next(i for i, step in enumerate(steps) if step.contact is not None)
    assert steps[felt].contact.force[1] > 5.0
    assert steps[felt + 20].ee_velocity[1] > 0.0


def test_the_process_that_speaks_with_the_arm_dying_is_said(known, tmp_path):
    server = known()
    run = running(server, tmp_path, *_FOLLOWING)
    said_until(run, "TRACK")
    for child in children(run):
        os.kill(child, signal.SIGKILL)
    out, _ = run.communicate(timeout=60)
    assert run.returncode == 1, out
    assert "The run ended early: The process that moves the arm" in out
    assert "The arm may not be at rest" in out


def test_an_arm_whose_computer_dies_in_motion_is_not_said_to_stand(known, tmp_path):
    server = known()
    run = running(server, tmp_path, *_FOLLOWING)
    said_until(run, "TRACK")
    os.kill(server.process.pid, signal.SIGKILL)
    out, _ = run.communicate(timeout=60)
    assert run.returncode == 1, out
    assert "The arm may not be at rest" in out
    assert "The arm is at rest." not in out


@pytest.mark.parametrize("frozen", ["server", "process"])
def test_an_arm_of_which_no_state_comes_ends_the_run(known, tmp_path, frozen):
    """A pulled cable leaves the connection open; so does a process that stands still."""
    server = known()
    run = running(server, tmp_path, *_FOLLOWING)
    said_until(run, "TRACK")
    for process in [server.process.pid] if frozen == "server" else children(run):
        os.kill(process, signal.SIGSTOP)
    begun = time.monotonic()
    out, _ = run.communicate(timeout=60)
    took = time.monotonic() - begun
    assert run.returncode == 1, out
    assert "The arm may not be at rest" in out
    assert took < 8.0


def test_an_arm_in_reflex_is_refused_with_the_way_out_and_recovers(known, tmp_path):
    server = known()
    run = running(server, tmp_path, *_FOLLOWING)
    said_until(run, "TRACK")
    server.type("0,80,0")
    out, _ = run.communicate(timeout=60)
    assert run.returncode == 1, out
    assert "stopped by itself" in out
    assert "reflex" in server.said()
    refused = running(server, tmp_path, *_FOLLOWING)
    out, _ = refused.communicate(timeout=60)
    assert refused.returncode == 2, out
    assert "then let it recover. Run with --recover." in out
    again = running(server, tmp_path, "--recover", "--path", "hold", *_FOLLOWING[:-1], "1")
    out, _ = again.communicate(timeout=60)
    assert again.returncode == 0, out
    assert "has recovered" in out


def test_a_second_program_on_the_same_arm_is_refused(known, tmp_path):
    server = known()
    first = running(server, tmp_path, *_FOLLOWING)
    said_until(first, "TRACK")
    second = running(server, tmp_path, *_FOLLOWING)
    out, _ = second.communicate(timeout=60)
    assert second.returncode == 2, out
    assert "in use by process" in out
    first.send_signal(signal.SIGINT)
    first.communicate(timeout=30.0)
    assert first.returncode == 130
