"""The program that commands the arm dies: the arm comes to rest, by what it was sent last."""

import signal
import subprocess
import sys
from time import monotonic, sleep

import numpy as np
import pytest
from ros2.tests.processes import HERE, arm_peer, speeds, velocities

from pretouch.robot.description import panda
from pretouch_ros2.params import ArmParams

PANDA = panda()
PARAMS = ArmParams("on-robot", "base")
LATE_S = 0.2
"""How late a busy machine may hand a message on [s]."""


@pytest.mark.slow
@pytest.mark.parametrize(
    "ending", [pytest.param(signal.SIGKILL, id="killed"), pytest.param(signal.SIGSTOP, id="frozen")]
)
def test_an_arm_whose_commands_end_comes_to_rest_within_its_limits(domain, tmp_path, ending):
    with arm_peer(domain, tmp_path / "log.npy", "--ideal") as arm:
        command = [sys.executable, str(HERE / "commander.py"), str(domain)]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as commander:
            try:
                assert commander.stdout is not None
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
    braking = float((np.abs(qd[at_end - 20 : at_end + 20]).max(axis=0) / PANDA.qdd_max).max())
    rest = time[1:][moving][-1] - ended
    assert rest < PARAMS.ahead_s + PARAMS.hold_s + braking + LATE_S
    assert not moving[-300:].any()
