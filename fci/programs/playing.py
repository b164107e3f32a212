"""One program against one server: both started afresh, and what came of it."""

import os
import re
import shlex
import signal
import subprocess
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

HOST, PORT = "127.0.0.1", 1337
"""Where every server is: the port is the only one that the vendor's library knows. A gripper has the next."""
_STARTS_S, _ENDS_S = 120.0, 10.0
"""A server's first start compiles; an end takes less."""
_STAND_IN = Path(__file__).parent / "stand_in"
_COMPLAINT = re.compile(
    r"libfranka: (?!Setting thread priority).*|^[\w.]*(Error|Exception)\b.*"
    r"|(Error occurred|Aborting|Failed|Object lost|terminate called).*"
)
"""What a line says that tells of something gone wrong."""
_REFUSAL = re.compile(r"rejected|refused|[Ii]ncompatible|Server reports error")
"""What such a line says if the robot, or whoever would listen beside it, declined what was asked for."""
_LONGEST = 160
"""Characters of a reason that are kept."""


@dataclass(frozen=True)
class Program:
    """A program of somebody else's, and how it is told that it went well."""

    name: str
    command: str
    """Its command line, with names in braces for what only the machine knows."""
    says: str = ""
    """What it prints when all went well."""
    ctrl_c: float = 0.0
    """After so long Ctrl-C ends it [s]; 0 if it ends by itself."""
    beside: str = ""
    """What it needs beside the robot."""
    stand_in: bool = False
    """Whether it starts a simulator of its own, in whose place it gets the server."""


@dataclass(frozen=True)
class Played:
    """What came of a program."""

    name: str
    verdict: str
    """`runs`, `refused`, `fails` or `does not end`."""
    why: str
    """Its first complaint, if it does not run."""
    seconds: float
    """How long it ran [s]."""


def programs_of(one: Mapping[str, Any]) -> Iterator[Program]:
    """Give the programs of a set, as programs.toml writes it."""
    for each in one["programs"]:
        command = f"{one['command'].replace('{name}', each['name'])} {each.get('more', '')}"
        rest = {key: each[key] for key in ("says", "ctrl_c", "beside") if key in each}
        yield Program(each["name"], command.strip(), stand_in=one.get("stand_in", False), **rest)


def play(program: Program, server: str, places: Mapping[str, str], limit: float) -> Played:
    """Start the server, run the program, and judge what it said.

    Args:
        program: what to run.
        server: its command line, with names in braces.
        places: what stands for each of them.
        limit: how long the program may take [s].
    """
    with listening(server.format(**places)):
        return run(program, places, limit)


def run(program: Program, places: Mapping[str, str], limit: float) -> Played:
    """Run the program against whatever listens, for at most so long [s], and judge what it said."""
    environment = os.environ | {"PYTHONUNBUFFERED": "1"}
    if program.stand_in:
        environment["PYTHONPATH"] = str(_STAND_IN)
    begun = time.monotonic()
    with subprocess.Popen(  # noqa: S603  what the list says
        shlex.split(program.command.format(**places)), stdin=subprocess.PIPE, stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT, env=environment, start_new_session=True,
    ) as process:  # fmt: skip
        text, interrupted = _heard(process, program.ctrl_c, limit)
    status = None if process.returncode == -signal.SIGKILL else process.returncode
    return _judged(program, status, text, time.monotonic() - begun, interrupted)


def _heard(process: subprocess.Popen[bytes], ctrl_c: float, limit: float) -> tuple[str, bool]:
    """Press Enter whenever it waits, until it ends or is ended; return what it said, and whether Ctrl-C was pressed."""
    text, enter, interrupted = b"", b"\n" * 100, False
    try:
        text, _ = process.communicate(enter, ctrl_c or limit)
    except subprocess.TimeoutExpired:
        interrupted = ctrl_c > 0
        if interrupted:
            process.send_signal(signal.SIGINT)
        try:
            text, _ = process.communicate(timeout=_ENDS_S if interrupted else 0)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            text, _ = process.communicate()
    return text.decode(errors="replace"), interrupted


def _judged(program: Program, status: int | None, text: str, seconds: float, interrupted: bool) -> Played:
    """Judge a program by its exit status, None if it did not end, and by what it said."""
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    complaints = [found[0] for line in lines if (found := _COMPLAINT.search(line))]
    as_meant = interrupted if program.ctrl_c else status == 0
    why = (complaints or [f"ended with {status}: {lines[-1] if lines else 'it said nothing'}"])[0][:_LONGEST]
    if status is None:
        verdict = "does not end"
    elif as_meant and program.says in text and not complaints:
        verdict, why = "runs", ""
    else:
        verdict = "refused" if _REFUSAL.search(why) else "fails"
    return Played(program.name, verdict, why, round(seconds, 1))


@contextmanager
def listening(command: str) -> Iterator[None]:
    """Have a server run, from when it listens on; it is ended afterwards."""
    with subprocess.Popen(  # noqa: S603  what the list says
        shlex.split(command), stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        start_new_session=True,
    ) as process:  # fmt: skip
        try:
            _await(process, command)
            yield
        finally:
            _end(process)


def _await(process: subprocess.Popen[bytes], command: str) -> None:
    until = time.monotonic() + _STARTS_S
    while not (_listens(PORT) and _listens(PORT + 1)):
        if process.poll() is not None or time.monotonic() > until:
            raise SystemExit(f"No server listens at ports {PORT} and {PORT + 1}. Try by hand: {command}")
        time.sleep(0.1)


def _end(process: subprocess.Popen[bytes]) -> None:
    process.send_signal(signal.SIGINT)
    try:
        process.wait(_ENDS_S)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def _listens(port: int) -> bool:
    """Look whether somebody listens at a port, without connecting: a server may take one client only."""
    rows = Path("/proc/net/tcp").read_text(encoding="ascii").splitlines()[1:]
    ours = {f"{address}:{port:04X}" for address in ("0100007F", "00000000")}
    return any(row.split()[3] == "0A" and row.split()[1] in ours for row in rows)
