"""The program that commands the arm dies: the arm comes to rest, by what it was sent last."""

import signal
import subprocess
import sys
from time import monotonic, sleep

import numpy as np
import pytest
from ros2.tests.arm_peer import ROOT, arm_peer, speeds, velocities

from pretouch.control.joint_box import joint_box, joint_limits
from pretouch.loop import MonotonicClock
from pretouch.robot.description import panda
from pretouch.robot.model import RobotModel
from pretouch_ros2.node import Ros2Node
from pretouch_ros2.params import ArmParams, NodeParams
from pretouch_ros2.robot import Ros2Robot

PERIOD = 0.01
PARAMS = ArmParams("on-robot", "base")
LATE_S = 0.2
"""How late a busy machine may hand a message on [s]."""


@pytest.mark.slow
@pytest.mark.parametrize(
    "ending", [pytest.param(signal.SIGKILL, id="killed"), pytest.param(signal.SIGSTOP, id="frozen")]
)
def test_an_arm_whose_commands_end_comes_to_rest_within_its_limits(domain, tmp_path, ending):
    with arm_peer(domain, tmp_path / "log.npy", "--ideal") as arm:
        command = [sys.executable, "-m", "ros2.tests.test_dead_publisher", str(domain)]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=ROOT) as commander:
            try:
                for line in commander.stdout:
                    last = np.array(line.split(), dtype=float)
                    if np.abs(last).max() > 0.75:
                        break
                commander.send_signal(ending)
                ended = monotonic()
                sleep(1.0)
            finally:
                commander.kill()
        log = arm.stop()
    time, qd, moving = log[:, 0], velocities(log), speeds(log) > 1e-6
    at_end = int(np.searchsorted(time, ended))
    assert np.abs(qd[at_end - 20 : at_end]).max() > 0.5
    braking = float((np.abs(qd[at_end - 20 : at_end + 20]).max(axis=0) / panda().qdd_max).max())
    rest = time[1:][moving][-1] - ended
    assert rest < PARAMS.ahead_s + PARAMS.hold_s + braking + LATE_S
    assert not moving[-300:].any()


def drive(domain: int) -> None:
    """Drive the arm by joint velocities that swing, until killed, and tell them."""
    model = RobotModel(panda())
    limits = joint_limits(model, 0.01, PERIOD)
    with Ros2Node(NodeParams(domain=domain)) as node, Ros2Robot(ArmParams("by-robot", "base"), model, node) as robot:
        robot.wait(10)
        robot.begin()
        clock, start = MonotonicClock(PERIOD), None
        while True:
            now = clock.tick()
            start = start or now
            state = robot.read()
            wanted = 0.8 * min(now - start, 1.0) * np.sin(2.0 * (now - start) + np.arange(7))
            sent = np.clip(wanted, *joint_box(state.q_commanded, state.qd_commanded, limits.table)[:2])
            robot.command(sent)
            print(*sent, flush=True)


if __name__ == "__main__":
    drive(int(sys.argv[1]))
