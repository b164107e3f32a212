"""`pretouch run --robot franka` through the vendor's own libraries, against simulated arms that speak its protocol."""

import os
import re
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from importlib.util import find_spec
from itertools import count
from pathlib import Path

import numpy as np
import pytest

from pretouch.hardware.keys import save_keys
from pretouch.recording.reader import open_recording
from pretouch.robot.description import fr3, panda
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import paper_skin
from pretouch.serving.wire_skin import made_keys
from pretouch.session.franka import identity
from pretouch.session.remembered import Remembered
from pretouch.types import Mode

pytestmark = [
    pytest.mark.slow,
    pytest.mark.alone,
    pytest.mark.skipif(not (find_spec("panda_py") and find_spec("pylibfranka")), reason="needs the extra franka"),
]
_ARMS = {"panda": panda, "fr3": fr3}
_number = count(1)
_FOLLOWING = "--no-skin", "--profile", "blind", "--floor", "-0.2", "--yes", "--seconds", "25"


def address():
    """An address of this machine that no other test uses: the vendor's libraries know one port."""
    pid = os.getpid()
    return f"127.{10 + pid // 250 % 50}.{1 + pid % 250}.{next(_number)}"


@contextmanager
def served(kind, where, folder, *words):
    """Serve a simulated arm from a process of its own."""
    log = folder / f"served-{where}.log"
    with log.open("w") as file:
        process = subprocess.Popen(
            [sys.executable, "-m", "pretouch.cli", "serve-fci", "--robot", kind, "--host", where, *words],
            stdout=file, stderr=subprocess.STDOUT, cwd=folder,
        )  # fmt: skip
    try:
        end = time.monotonic() + 60.0
        while "Listening at" not in log.read_text():
            assert process.poll() is None, log.read_text()
            assert time.monotonic() < end, log.read_text()
            time.sleep(0.05)
        yield log
    finally:
        process.terminate()
        process.wait(10.0)


def running(kind, where, folder, *words):
    """Start `pretouch run` in a process of its own, with a memory of its own."""
    return subprocess.Popen(
        [sys.executable, "-m", "pretouch.cli", "run", "--robot", "franka", "--arm", kind, "--ip", where, *words],
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL, text=True, cwd=folder,
        env=os.environ | {"XDG_STATE_HOME": str(folder / "state")},
    )  # fmt: skip


def confirmed(kind, where, folder):
    """Note that a robot's force sign was confirmed."""
    Remembered(folder / "state" / "pretouch").keep(identity(kind, where))


def said_until(process, sign):
    """Read what a process says until a line has a sign in it."""
    lines = []
    for line in process.stdout:
        lines.append(line)
        if sign in line:
            return "".join(lines)
    raise AssertionError(f"{sign!r} was not said:\n{''.join(lines)}")


def in_lockstep(kind, folder, name, scene, *words):
    """Run once in lockstep with units; return the recording and what the arm's server said."""
    where, keys = address(), folder / "keys.toml"
    if not keys.exists():
        save_keys(made_keys(paper_skin(RobotModel(_ARMS[kind]())).ids, 0), keys)
    port = 20_000 + (os.getpid() * 7 + next(_number)) % 30_000
    units = "--units", f"127.0.0.1:{port}", "--keys", "keys.toml"
    with served(kind, where, folder, "--lockstep", "--start", "path", *units, *scene) as log:
        heard = "--keys", "keys.toml", "--units-port", str(port)
        run = running(kind, where, folder, "--lockstep", "--record", name, *heard, *words)
        out, _ = run.communicate(timeout=300)
        assert run.returncode == 0, out
        return open_recording(folder / name), log.read_text()


def steps_as_written(recording):
    return [recording.step_data(i) for i in range(len(recording))]


@pytest.mark.parametrize("kind", ["panda", "fr3"])
@pytest.mark.parametrize(("side", "push"), [("+y", -1.0), ("-y", 1.0)])
def test_the_static_experiment_repeats_to_the_last_bit_and_the_arm_yields_away_from_the_board(
    tmp_path, kind, side, push
):
    scene = "--scene", "static", "--side", side, "--stiffness", "10000"
    words = "--profile", "paper:restriction.mode=off", "--seconds", "9"
    first, said = in_lockstep(kind, tmp_path, "a.mcap", scene, *words)
    second, _ = in_lockstep(kind, tmp_path, "b.mcap", scene, *words)
    assert steps_as_written(first) == steps_as_written(second)
    assert "reflex" not in said
    contacts = [kept.step for kept in first if kept.step.contact is not None]
    assert contacts
    assert push * contacts[0].contact.force[1] > 5.0
    moving = [kept.step for kept in first if kept.step.mode is Mode.REACT]
    assert push * moving[20].ee_velocity[1] > 0.0


@pytest.mark.parametrize("kind", ["panda", "fr3"])
def test_the_dynamic_experiment_repeats_to_the_last_bit_and_the_arm_yields_to_the_push(tmp_path, kind):
    scene, words = ("--scene", "dynamic"), ("--seconds", "9")
    first, said = in_lockstep(kind, tmp_path, "a.mcap", scene, *words)
    second, _ = in_lockstep(kind, tmp_path, "b.mcap", scene, *words)
    assert steps_as_written(first) == steps_as_written(second)
    assert "reflex" not in said
    steps = [kept.step for kept in first]
    contact = next(i for i, step in enumerate(steps) if step.contact is not None)
    after = np.mean([step.ee_velocity for step in steps[contact + 20 : contact + 60]], axis=0)
    assert after @ steps[contact].contact.force > 0.0


def test_pushes_confirm_the_sign_once_and_the_run_begins_and_ends_at_rest(tmp_path):
    where = address()
    pushes = [f"{12 + 6 * k}:{force}:1.5" for k, force in enumerate(["0,14,0", "14,0,0"] * 6)]
    with served("panda", where, tmp_path, "--start", "path", "--push", *pushes) as log:
        run = running("panda", where, tmp_path, *_FOLLOWING[:-1], "2", "--record", "a.mcap")
        out, _ = run.communicate(timeout=150)
        assert run.returncode == 0, out
    assert "The force sign is confirmed" in out
    assert "The arm is at rest." in out
    assert re.search(r"\d{4} states answered", out)
    assert "Motion ended: " not in log.read_text() or "reflex" not in log.read_text()
    steps = [kept.step for kept in open_recording(tmp_path / "a.mcap")]
    assert np.abs(steps[0].command).max() < 0.02
    assert np.linalg.norm(steps[-1].ee_velocity) > 0.1
    assert Remembered(tmp_path / "state" / "pretouch").knows(identity("panda", where))


def test_pushes_felt_the_other_way_round_refuse_before_anything_moves(tmp_path):
    where = address()
    pushes = [f"{12 + 6 * k}:{force}:1.5" for k, force in enumerate(["0,-14,0", "-14,0,0"] * 6)]
    with served("panda", where, tmp_path, "--start", "path", "--push", *pushes) as log:
        run = running("panda", where, tmp_path, *_FOLLOWING[:-1], "2")
        out, _ = run.communicate(timeout=150)
        assert run.returncode == 2, out
        assert "opposite to the pushes" in out
        assert "Motion" not in log.read_text()
    assert not Remembered(tmp_path / "state" / "pretouch").knows(identity("panda", where))


@pytest.mark.parametrize("kind", ["panda", "fr3"])
def test_sigterm_in_the_middle_brings_the_arm_to_rest_without_a_reflex(tmp_path, kind):
    where = address()
    confirmed(kind, where, tmp_path)
    with served(kind, where, tmp_path, "--start", "path") as log:
        run = running(kind, where, tmp_path, *_FOLLOWING, "--record", "a.mcap")
        said_until(run, "TRACK")
        time.sleep(1.0)
        run.send_signal(signal.SIGTERM)
        out, _ = run.communicate(timeout=60)
        assert run.returncode == 143, out
        assert "The arm is at rest." in out
        assert "reflex" not in log.read_text()
    assert open_recording(tmp_path / "a.mcap").complete


def test_the_process_that_speaks_with_the_arm_dying_is_said(tmp_path):
    where = address()
    confirmed("panda", where, tmp_path)
    with served("panda", where, tmp_path, "--start", "path"):
        run = running("panda", where, tmp_path, *_FOLLOWING)
        said_until(run, "TRACK")
        children = Path(f"/proc/{run.pid}/task/{run.pid}/children").read_text().split()
        for child in children:
            if "resource_tracker" not in Path(f"/proc/{child}/cmdline").read_text():
                os.kill(int(child), signal.SIGKILL)
        out, _ = run.communicate(timeout=60)
        assert run.returncode == 1, out
        assert "The run ended early: The process that moves the arm" in out
        assert "Whether the arm is at rest is not known" in out


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
