"""For other people's tests: a simulated Panda or FR3 that belongs to one test.

A process of its own, because the vendor's libraries hold the interpreter while they wait for a state: a server in a
thread beside them would never send it.
"""

import itertools
import os
import socket
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Literal, Self

import numpy as np

from pretouch.errors import RobotError
from pretouch.types import FloatArray
from pretouch_fci.pushes import push_of
from pretouch_fci.wire import PORT

_STARTS_S = 120.0
"""The first server after an installation compiles [s]."""
_ANSWERS_S = 10.0
_ENDS_S = 10.0
_LOOKS_S = 0.005
"""Time between two looks at what it says [s]."""
_ADDRESSES = 250
"""A process has so many addresses of its own."""
_numbers = itertools.count()


@dataclass(frozen=True, slots=True)
class TrueMotion:
    """True motion and forces in each millisecond of the arm's time."""

    time: FloatArray
    """(k,) as the states say it [s]: in lockstep the first motion begins at 1000."""
    force: FloatArray
    """(k, 3) all forces on the arm [N], base frame."""
    q: FloatArray
    """(k, 7) joint positions [rad]."""


class FrankaServer:
    """`pretouch serve-fci` in lockstep at a loopback address of its own. A context manager."""

    def __init__(self, robot: Literal["panda", "fr3"] = "panda", **options: object) -> None:
        """Start it, and wait until it listens; what it refuses is a RobotError.

        Args:
            robot: the robot.
            **options: those of `pretouch serve-fci`, such as scene="static", hand=True, seed=3 or box=("0.5,...",).
        """
        self.host = _free_address()
        """Its address; the port is the only one that the vendor's libraries know."""
        self._lines: tuple[str, ...] = ()
        self._folder = TemporaryDirectory()
        self._truth, self._log = (Path(self._folder.name) / name for name in ("truth.csv", "said.txt"))
        ours = {"host": self.host, "stdin": True, "truth": self._truth}
        words = _words({"robot": robot, "lockstep": True, **options, **ours})
        # -P: a module of the tests must not stand in for one of the server's
        command = [sys.executable, "-P", "-m", "pretouch.cli", "serve-fci", *words]
        with self._log.open("wb") as log:
            self._process = subprocess.Popen(  # noqa: S603  our own program
                command, stdin=subprocess.PIPE, stdout=log, stderr=subprocess.STDOUT, bufsize=0
            )
        try:
            self._wait_for("Listening at", _STARTS_S, 0)
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def push(self, force: Sequence[float], seconds: float = 0.5, at: float = 0.0) -> None:
        """Push the end-effector from `at` [s] on; the time begins now and passes as the arm's does.

        In lockstep that is while a motion runs. So a push that is asked for before a motion comes at the same
        millisecond of it each time.

        Args:
            force: (3,) on the arm, base frame [N].
            seconds: how long it lasts [s].
            at: when it begins [s].
        """
        line = f"{float(at)}:{','.join(str(float(one)) for one in force)}:{float(seconds)}"
        push_of(line)
        self._type(line)

    def press_stop(self, pressed: bool = True) -> None:
        """Press the user stop, or release it."""
        self._type("stop" if pressed else "release")

    def guide(self, pressed: bool = True) -> None:
        """Press the buttons at the flange, or release them: an arm at rest then gives way to pushes."""
        self._type("guide" if pressed else "let go")

    @property
    def said(self) -> tuple[str, ...]:
        """Lines that the server has printed so far, such as why a motion ended."""
        if self._log.exists():
            *lines, _ = self._log.read_text(errors="replace").split("\n")
            self._lines = tuple(lines)
        return self._lines

    @property
    def truth(self) -> TrueMotion:
        """True motion and forces until now. Between motions only: in a motion the server waits for a command."""
        count = len(self.said)
        self._type("time")
        self._wait_for("The arm's time is", _ANSWERS_S, count)
        _, *lines = self._truth.read_text().splitlines()
        rows = np.array([line.split(",") for line in lines], dtype=np.float64).reshape(-1, 11)
        return TrueMotion(rows[:, 0], rows[:, 1:4], rows[:, 4:])

    def close(self) -> None:
        """End it, whatever its client does."""
        process = self._process
        process.terminate()
        try:
            process.wait(_ENDS_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        if process.stdin is not None:
            process.stdin.close()
        self._lines = self.said  # the last that it said
        self._folder.cleanup()

    def _type(self, line: str) -> None:
        assert self._process.stdin is not None  # noqa: S101  a pipe, as asked for
        try:
            self._process.stdin.write(f"{line}\n".encode())
        except (BrokenPipeError, ValueError):  # ended by itself, or closed
            raise RobotError(f"The simulated robot has ended: {' '.join(self.said)}") from None

    def _wait_for(self, beginning: str, most: float, count: int) -> None:
        """Wait for a line with a beginning, behind so many others, up to a time [s]."""
        until = time.monotonic() + most
        while True:
            ended = self._process.poll() is not None
            lines = self.said[count:]
            if any(line.startswith(beginning) for line in lines):
                return
            if ended or time.monotonic() > until:
                why = "has ended" if ended else f"does not answer within {most:g} s"
                raise RobotError(f"The simulated robot {why}: {' '.join(lines) or 'is it in a motion?'}")
            time.sleep(_LOOKS_S)


def _words(options: dict[str, object]) -> list[str]:
    """Write options as words of a command line."""
    words = []
    for name, value in options.items():
        flag = name.replace("_", "-")
        match value:
            case bool():
                words.append(f"--{flag}" if value else f"--no-{flag}")
            case list() | tuple():
                words += [f"--{flag}", *map(str, value)]
            case _:
                words += [f"--{flag}", str(value)]
    return words


def _free_address() -> str:
    """Find a loopback address at which nobody listens: the process' number is in it, so that no other one finds it."""
    pid = os.getpid()
    for _ in range(_ADDRESSES):
        host = f"127.{1 + pid // 250 % 250}.{1 + pid % 250}.{1 + next(_numbers) % _ADDRESSES}"
        with socket.socket() as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                probe.bind((host, PORT))
            except OSError:
                continue
            return host
    raise RobotError(f"No loopback address has a free port {PORT}: end simulated robots that are no longer needed.")
