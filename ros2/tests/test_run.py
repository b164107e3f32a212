"""`pretouch run ros2`, as a program of its own, with a simulated arm in another process."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from time import monotonic, sleep

import numpy as np
import pytest
from ros2.tests.arm_peer import ArmPeer, speeds, velocities
from ros2.tests.asking import NAMES, publishing, trajectory, twist

from pretouch.recording.reader import open_recording
from pretouch.recording.verify import verify
from pretouch.robot.description import panda
from pretouch.session.memory import ConfirmedRobots
from pretouch.session.push import DIRECTIONS
from pretouch_ros2.arm import identity
from pretouch_ros2.messages import TRAJECTORY, TWIST
from pretouch_ros2.params import ArmParams, NodeParams

# two processes in real time: alone, lest another test takes the arm's time and it is rightly found not to follow
pytestmark = [pytest.mark.slow, pytest.mark.alone]
LIMIT_S = 90.0
LATE_S = 0.2
"""How late a busy machine may hand a message on [s]."""
# a machine that CI shares stops either process for 50 ms and more, which is rightly held against a real arm
PROFILE = "blind:failure.state_timeout_s=1"


@contextmanager
def running(domain: int, folder: Path, *words: str, profile: str = PROFILE) -> Iterator[subprocess.Popen[str]]:
    command = [
        sys.executable, "-u", "-m", "pretouch.cli", "run", "ros2", "--sign", "by-robot", "--frame",
        "base", "--domain", str(domain), "--no-skin", "--profile", profile, "--path", "hold", "--yes",
        "--holds", str(folder / "holds"), *words,
    ]  # fmt: skip
    environment = os.environ | {"XDG_STATE_HOME": str(folder / "state")}
    with subprocess.Popen(
        command, env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    ) as process:
        try:
            yield process
        finally:
            process.kill()


def confirmed(domain: int, folder: Path) -> None:
    known = identity(NodeParams(domain=domain), ArmParams("by-robot", "base"))
    ConfirmedRobots(folder / "state" / "pretouch").add(known)


def lines_until(process: subprocess.Popen[str], sign: str) -> list[str]:
    said = []
    for line in process.stdout:
        said.append(line)
        if sign in line:
            return said
    raise AssertionError("".join(said))


killed_or_frozen = pytest.mark.parametrize("ending", [signal.SIGKILL, signal.SIGSTOP], ids=["killed", "frozen"])


def ended(run: subprocess.Popen[str], arm: ArmPeer, ending: signal.Signals) -> tuple[np.ndarray, int, float]:
    """End the program; return what the arm was commanded, in which row that was, and how long it then moved [s]."""
    run.send_signal(ending)
    instant = monotonic()
    sleep(1.0)
    log = arm.stop()
    moving = speeds(log) > 1e-6
    assert not moving[-300:].any()
    return log, int(np.searchsorted(log[:, 0], instant)), log[1:, 0][moving][-1] - instant


@killed_or_frozen
def test_a_run_that_is_killed_or_frozen_in_motion_leaves_the_arm_at_rest(domain, tmp_path, arm, ending):
    confirmed(domain, tmp_path)
    with running(domain, tmp_path, "--seconds", "30") as run:
        lines_until(run, "TRACK")
        arm.tell("push 0 0 20")
        lines_until(run, "REACT")
        sleep(0.2)
        log, at_end, moved = ended(run, arm, ending)
    assert speeds(log)[at_end - 50 : at_end].max() > 0.05  # samples: a busy machine may log none for a while
    assert moved < 0.4 + LATE_S
    braking = slice(np.searchsorted(log[1:, 0], log[at_end, 0] + 0.1), None)
    acceleration = np.abs(np.diff(velocities(log)[braking], axis=0)) / 1e-3 / panda().qdd_max
    assert np.percentile(acceleration, 99) < 1.1


@killed_or_frozen
def test_at_speed_it_is_at_rest_as_soon_as_it_can_brake(domain, tmp_path, arm, other, ending):
    params, fast = ArmParams("by-robot", "base"), trajectory(NAMES, (0.0, 0.8 * np.array([1, -1, 1, 1, 1, 1, 1])))
    confirmed(domain, tmp_path)
    with running(domain, tmp_path, "--seconds", "60", "--desired", "trajectory") as run:
        lines_until(run, "was received on /pretouch/joint_trajectory yet")
        with publishing(other, "/pretouch/joint_trajectory", TRAJECTORY, lambda: fast):
            lines_until(run, "TRACK")
            sleep(0.5)
            log, at_end, moved = ended(run, arm, ending)
    qd = np.abs(velocities(log))
    assert qd[at_end - 20 : at_end].min(axis=1).max() > 0.75
    braking = float((qd[at_end - 20 : at_end + 20].max(axis=0) / panda().qdd_max).max())
    assert moved < params.ahead_s + params.hold_s + braking + LATE_S


def test_a_commander_drives_by_the_profile_pretouch_after_pushes_that_torques_confirm(domain, tmp_path, arm, other):
    place = tmp_path / "a.mcap"
    words = "--torques", "/external_joint_torques", "--desired", "twist", "--record", str(place)
    chosen = "pretouch:perception=none:failure.state_timeout_s=1"
    with running(domain, tmp_path, *words, "--seconds", "12", profile=chosen) as run:
        said = []
        for direction in DIRECTIONS:
            said += lines_until(run, "Push the hand")
            arm.tell("push " + " ".join(str(14.0 * part) for part in direction.axis))
            said += lines_until(run, "Let go.")
            arm.tell("push 0 0 0")
        said += lines_until(run, "was received on /pretouch/twist yet")
        with publishing(other, "/pretouch/twist", TWIST, lambda: twist((0.0, 0.05, 0.0))):
            said += lines_until(run, "TRACK")
            sleep(1.5)
            arm.tell("push 0 0 25")
            said += lines_until(run, "REACT")
            arm.tell("push 0 0 0")
            said += lines_until(run, "TRACK")
            sleep(0.5)
        said += lines_until(run, "The desired motion ended")
        out, _ = run.communicate(timeout=LIMIT_S)
    out = "".join(said) + out
    assert run.returncode == 0, out
    for part in (
        "The force sign is confirmed",
        "The arm follows the commands on /pretouch/twist",
        "The arm is at rest.",
    ):
        assert part in out
    assert "keeps its end-effector" not in out
    log = arm.stop()
    assert speeds(log)[-50:].max() < 1e-9
    recorded = open_recording(place)
    y = [kept.step.ee_position[1] for kept in recorded if kept.step is not None]
    assert max(y) - y[0] > 0.03
    assert verify(recorded).differing == 0
