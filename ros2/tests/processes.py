"""Other processes in the tests of ROS 2."""

import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from time import sleep

import numpy as np

HERE = Path(__file__).parent
ROOT = HERE.parents[1]


class ArmPeer:
    """The process of `arm_peer.py`."""

    def __init__(self, process: subprocess.Popen[str], log: Path) -> None:
        self._process, self._log = process, log

    def tell(self, order: str) -> None:
        assert self._process.stdin is not None
        print(order, file=self._process.stdin, flush=True)

    def pause(self, seconds: float) -> None:
        """Let it stand still as on a machine that has no time for it."""
        self._process.send_signal(signal.SIGSTOP)
        sleep(seconds)
        self._process.send_signal(signal.SIGCONT)

    def stop(self) -> np.ndarray:
        """End it and return what was commanded: rows of time and q (7,)."""
        self.tell("stop")
        assert self._process.wait(20) == 0
        return np.load(self._log)


@contextmanager
def arm_peer(domain: int, log: Path, *options: str) -> Iterator[ArmPeer]:
    command = [sys.executable, "-m", "ros2.tests.arm_peer", "--domain", str(domain), "--log", str(log), *options]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, cwd=ROOT) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline() == "ready\n"
            yield ArmPeer(process, log)
        finally:
            process.kill()


def velocities(log: np.ndarray) -> np.ndarray:
    """Joint velocities (T, 7) between the rows of what was commanded [rad/s]."""
    return np.diff(log[:, 1:], axis=0) / np.diff(log[:, 0])[:, None]


def speeds(log: np.ndarray) -> np.ndarray:
    """Largest joint speeds (T,), likewise."""
    return np.abs(velocities(log)).max(axis=1)
