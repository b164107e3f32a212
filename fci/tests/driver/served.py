"""Simulated arms that speak the Franka Control Interface, each a process at a loopback address of its own."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from fci.tests.soak.programs import Program
from tests.ports import loopback

_TAIL = 65536
HERE = Path(__file__).parent


def wait_for(happened: Callable[[], bool], what: str, most: float = 20.0) -> None:
    until = time.monotonic() + most
    while not happened():
        assert time.monotonic() < until, f"{what} did not happen within {most} s"
        time.sleep(0.01)


class Served(Program):
    """`pretouch serve-fci`, with a keyboard."""

    def __init__(self, place: Path, kind: str, *more: str) -> None:
        self.kind, self.address = kind, loopback()
        name = self.address.replace(".", "-")
        self.truth = place / f"{name}.csv"
        self._keyboard, typed = os.openpty()
        at = "--robot", kind, "--host", self.address, "--truth", str(self.truth)
        super().__init__(place, name, "serve-fci", *at, *more, stdin=typed)
        os.close(typed)
        try:
            assert self.said_within("(Listening) at", 60.0), self.said()
        except BaseException:
            self.close()
            raise

    def type(self, line: str) -> None:
        os.write(self._keyboard, f"{line}\n".encode())

    def q(self) -> np.ndarray:
        """(T, 7) where the arm truly was in the last milliseconds, as far as it has been written [rad]."""
        with self.truth.open("rb") as file:
            file.seek(max(0, self.truth.stat().st_size - _TAIL))
            lines = file.read().decode().splitlines()[1:-1]
        return np.array([line.split(",")[4:] for line in lines], dtype=np.float64).reshape(-1, 7)

    def speed(self) -> float:
        """Largest mean joint speed in the last tenth of a second [rad/s]."""
        q = self.q()[-100:]
        return float(np.abs(q[-1] - q[0]).max() / (1e-3 * (len(q) - 1))) if len(q) == 100 else 0.0

    def moves(self) -> bool:
        return self.speed() > 0.1

    def rests(self) -> bool:
        return self.speed() < 0.003

    def clients_gone(self) -> int:
        return self.said().count("disconnected")

    def close(self) -> None:
        self.process.send_signal(signal.SIGTERM)
        self.process.send_signal(signal.SIGCONT)  # a test may have stopped it
        try:
            self.process.wait(20.0)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        os.close(self._keyboard)


def child(script: str, *arguments: str) -> subprocess.Popen[str]:
    """A Python process: the vendor's libraries cannot share one with each other."""
    command = [sys.executable, str(HERE / script), *arguments]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)


def output(script: str, *arguments: str) -> str:
    process = child(script, *arguments)
    said, _ = process.communicate(timeout=240)
    assert process.returncode == 0, said
    return said.strip().splitlines()[-1]
