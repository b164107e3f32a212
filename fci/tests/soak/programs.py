"""Programs, each in a process of its own, with a file of what it says, and a wall clock of ours if we like."""

import os
import re
import resource
import struct
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

CLOCK = Path(__file__).parent / "clock"
_ROOT = Path(__file__).parents[3]
STARTS_S = 600.0
"""Longest wait for a program to say what it says at first [s]: it may compile, beside others, on two cores."""
_MIB = 2.0**-20
_PAGES = os.sysconf("SC_PAGE_SIZE")


class WallClock:
    """How far the programs' wall clocks are off; a file that they have mapped."""

    def __init__(self, place: Path) -> None:
        self.place = place
        self.step(0.0)

    def step(self, off: float) -> None:
        """Set it, for all at once [s]."""
        with self.place.open("r+b" if self.place.exists() else "wb") as file:
            file.write(struct.pack("<d", off))


class Program:
    """`pretouch ...`, with its children."""

    def __init__(
        self, folder: Path, name: str, *words: str, clock: WallClock | None = None, stdin: int = subprocess.DEVNULL
    ) -> None:
        """Start it in a folder, with a memory of its own there."""
        self._log = folder / f"{name}.log"
        more = {"XDG_STATE_HOME": str(folder / "state")}
        if clock is not None:
            more |= {
                "PYTHONPATH": os.pathsep.join((str(CLOCK), str(_ROOT))), "PRETOUCH_SOAK_CLOCK": str(clock.place),
            }  # fmt: skip
        with self._log.open("w") as log:
            self.process = subprocess.Popen(
                [sys.executable, "-m", "pretouch.cli", *words],
                cwd=folder, env=os.environ | more, stdin=stdin, stdout=log, stderr=subprocess.STDOUT,
            )  # fmt: skip

    def said(self) -> str:
        """All that it has said."""
        return self._log.read_text(errors="replace")

    def said_within(self, pattern: str, most: float = STARTS_S) -> str:
        """Wait until it has said something; return the first group of the pattern, or '' if it ended before."""
        until = time.monotonic() + most
        while not (found := re.search(pattern, self.said())):
            if self.process.poll() is not None:
                return ""
            assert time.monotonic() < until, f"{pattern!r} was not said within {most} s:\n{self.said()}"
            time.sleep(0.05)
        return found[1]

    def family(self) -> list[int]:
        """Numbers of its process and of those it has started, but for the library's that counts what is shared."""
        try:
            text = Path(f"/proc/{self.process.pid}/task/{self.process.pid}/children").read_text()
        except OSError:
            return []
        return [self.process.pid, *(int(n) for n in text.split() if b"resource_tracker" not in _command(int(n)))]

    def memory(self) -> list[float]:
        """Memory of each of its processes [MiB]: resident, without what it shares."""
        return [megabytes for number in self.family() if (megabytes := _private(number)) > 0.0]

    def fill_disk(self, most: int) -> None:
        """Let it write files of so many bytes at most, as on a disk that is full."""
        for number in self.family():
            resource.prlimit(number, resource.RLIMIT_FSIZE, (most, resource.RLIM_INFINITY))

    def left(self, most: float = 60.0) -> tuple[int, str]:
        """Wait until it ends by itself; return its exit code and all that it has said."""
        return self.process.wait(most), self.said()

    def end(self, sign: int, most: float = 30.0) -> int:
        """Send it a signal and wait; return its exit code."""
        self.process.send_signal(sign)
        try:
            return self.process.wait(most)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
            raise AssertionError(f"It did not end within {most} s of signal {sign}:\n{self.said()}") from None


@contextmanager
def program(folder: Path, name: str, *words: str, clock: WallClock | None = None) -> Iterator[Program]:
    """Have a program for as long as the context lasts."""
    made = Program(folder, name, *words, clock=clock)
    try:
        yield made
    finally:
        made.process.kill()
        made.process.wait()


def _command(number: int) -> bytes:
    try:
        return Path(f"/proc/{number}/cmdline").read_bytes()
    except OSError:
        return b""


def _private(number: int) -> float:
    """Anonymous resident memory of a process [MiB], 0 if it is gone."""
    try:
        fields = Path(f"/proc/{number}/statm").read_text().split()
    except OSError:
        return 0.0
    return (int(fields[1]) - int(fields[2])) * _PAGES * _MIB
