"""`pretouch run franka` through the vendor's own libraries, against simulated arms that speak its protocol."""

import os
import re
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import count
from pathlib import Path

import numpy as np
import pytest

from pretouch.arms.franka import identity
from pretouch.recording.reader import open_recording
from pretouch.session.confirmations import ConfirmedRobots

pytestmark = [pytest.mark.slow, pytest.mark.alone]
_number = count(1)
_FOLLOWING = "--no-skin", "--profile", "blind", "--floor", "-0.2", "--yes", "--seconds", "25"


def address():
    """An address of this machine that no other test uses: the vendor's libraries know one port."""
    pid = os.getpid()
    return f"127.{10 + pid // 250 % 50}.{1 + pid % 250}.{next(_number)}"


@dataclass(frozen=True)
class Server:
    """A simulated arm in a process of its own, with a keyboard."""

    process: subprocess.Popen
    log: Path
    keyboard: int

    def said(self):
        return self.log.read_text()

    def type(self, line):
        os.write(self.keyboard, f"{line}\n".encode())


@contextmanager
def served(kind, where, folder, *words):
    """Serve a simulated arm."""
    log = folder / f"served-{where}.log"
    keyboard, typed = os.openpty()
    with log.open("w") as file:
        process = subprocess.Popen(
            [sys.executable, "-m", "pretouch.cli", "serve-fci", "--robot", kind, "--host", where, *words],
            stdin=typed, stdout=file, stderr=subprocess.STDOUT, cwd=folder,
        )  # fmt: skip
    server = Server(process, log, keyboard)
    try:
        end = time.monotonic() + 60.0
        while "Listening at" not in server.said():
            assert process.poll() is None, server.said()
            assert time.monotonic() < end, server.said()
            time.sleep(0.05)
        yield server
    finally:
        process.terminate()
        process.send_signal(signal.SIGCONT)
        process.wait(10.0)
        os.close(keyboard)
        os.close(typed)


def running(kind, where, folder, *words):
    """Start `pretouch run` in a process of its own, with a memory of its own."""
    return subprocess.Popen(
        [sys.executable, "-m", "pretouch.cli", "run", "franka", "--arm", kind, "--ip", where, *words],
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL, text=True, cwd=folder,
        env=os.environ | {"XDG_STATE_HOME": str(folder / "state")},
    )  # fmt: skip


def children(run):
    """The processes that a run has started, but for that of the library which counts what is shared."""
    numbers = Path(f"/proc/{run.pid}/task/{run.pid}/children").read_text().split()
    return [int(n) for n in numbers if "resource_tracker" not in Path(f"/proc/{n}/cmdline").read_text()]


def confirmed(kind, where, folder):
    """Note that a robot's force sign was confirmed."""
    ConfirmedRobots(folder / "state" / "pretouch").keep(identity(kind, where))


def said_until(process, sign):
    """Read what a process says until a line has a sign in it."""
    lines = []
    for line in process.stdout:
        lines.append(line)
        if sign in line:
            return "".join(lines)
    raise AssertionError(f"{sign!r} was not said:\n{''.join(lines)}")


def test_pushes_confirm_the_sign_once_and_the_run_begins_and_ends_at_rest(tmp_path):
    where = address()
    with served("panda", where, tmp_path, "--start", "path") as server:
        run = running("panda", where, tmp_path, *_FOLLOWING[:-1], "2", "--record", "a.mcap")
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
    assert ConfirmedRobots(tmp_path / "state" / "pretouch").is_confirmed(identity("panda", where))


def test_pushes_felt_the_other_way_round_refuse_before_anything_moves(tmp_path):
    where = address()
    with served("panda", where, tmp_path, "--start", "path") as server:
        run = running("panda", where, tmp_path, *_FOLLOWING[:-1], "2")
        for axis in "yxz":
            said_until(run, f"towards +{axis}")
            server.type(f"-{axis}")
        out, _ = run.communicate(timeout=60)
        assert run.returncode == 2, out
        assert "opposite to the pushes" in out
        assert "Motion" not in server.said()
    assert not ConfirmedRobots(tmp_path / "state" / "pretouch").is_confirmed(identity("panda", where))


@pytest.mark.parametrize("kind", ["panda", "fr3"])
def test_sigterm_in_the_middle_brings_the_arm_to_rest_without_a_reflex(tmp_path, kind):
    where = address()
    confirmed(kind, where, tmp_path)
    with served(kind, where, tmp_path, "--start", "path") as server:
        run = running(kind, where, tmp_path, *_FOLLOWING, "--record", "a.mcap")
        said_until(run, "TRACK")
        time.sleep(1.0)
        run.send_signal(signal.SIGTERM)
        out, _ = run.communicate(timeout=60)
        assert run.returncode == 143, out
        assert "The arm is at rest." in out
        assert "reflex" not in server.said()
    assert open_recording(tmp_path / "a.mcap").complete


def test_the_process_that_speaks_with_the_arm_dying_is_said(tmp_path):
    where = address()
    confirmed("panda", where, tmp_path)
    with served("panda", where, tmp_path, "--start", "path"):
        run = running("panda", where, tmp_path, *_FOLLOWING)
        said_until(run, "TRACK")
        for child in children(run):
            os.kill(child, signal.SIGKILL)
        out, _ = run.communicate(timeout=60)
        assert run.returncode == 1, out
        assert "The run ended early: The process that moves the arm" in out
        assert "The arm may not be at rest" in out


def test_an_arm_whose_computer_dies_in_motion_is_not_said_to_stand(tmp_path):
    where = address()
    confirmed("panda", where, tmp_path)
    with served("panda", where, tmp_path, "--start", "path") as server:
        run = running("panda", where, tmp_path, *_FOLLOWING)
        said_until(run, "TRACK")
        os.kill(server.process.pid, signal.SIGKILL)
        out, _ = run.communicate(timeout=60)
        assert run.returncode == 1, out
        assert "The arm may not be at rest" in out
        assert "The arm is at rest." not in out


@pytest.mark.parametrize("frozen", ["server", "process"])
def test_an_arm_of_which_no_state_comes_ends_the_run(tmp_path, frozen):
    """A pulled cable leaves the connection open; so does a process that stands still."""
    where = address()
    confirmed("panda", where, tmp_path)
    with served("panda", where, tmp_path, "--start", "path") as server:
        run = running("panda", where, tmp_path, *_FOLLOWING)
        said_until(run, "TRACK")
        for process in [server.process.pid] if frozen == "server" else children(run):
            os.kill(process, signal.SIGSTOP)
        begun = time.monotonic()
        out, _ = run.communicate(timeout=60)
        took = time.monotonic() - begun
    assert run.returncode == 1, out
    assert "The arm may not be at rest" in out
    assert took < 8.0


def test_an_arm_in_reflex_is_refused_with_the_way_out_and_recovers(tmp_path):
    where = address()
    confirmed("panda", where, tmp_path)
    with served("panda", where, tmp_path, "--start", "path") as server:
        run = running("panda", where, tmp_path, *_FOLLOWING)
        said_until(run, "TRACK")
        server.type("0,80,0")
        out, _ = run.communicate(timeout=60)
        assert run.returncode == 1, out
        assert "stopped by itself" in out
        assert "reflex" in server.said()
        refused = running("panda", where, tmp_path, *_FOLLOWING)
        out, _ = refused.communicate(timeout=60)
        assert refused.returncode == 2, out
        assert "then let it recover. Run with --recover." in out
        again = running("panda", where, tmp_path, "--recover", "--path", "hold", *_FOLLOWING[:-1], "1")
        out, _ = again.communicate(timeout=60)
        assert again.returncode == 0, out
        assert "has recovered" in out


def test_a_second_program_on_the_same_arm_is_refused(tmp_path):
    where = address()
    confirmed("panda", where, tmp_path)
    with served("panda", where, tmp_path, "--start", "path"):
        first = running("panda", where, tmp_path, *_FOLLOWING)
        said_until(first, "TRACK")
        second = running("panda", where, tmp_path, *_FOLLOWING)
        out, _ = second.communicate(timeout=60)
        assert second.returncode == 2, out
        assert "in use by process" in out
        first.send_signal(signal.SIGINT)
        first.communicate(timeout=30.0)
        assert first.returncode == 130
