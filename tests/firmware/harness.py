"""Runs what is meant for a sensor unit on this machine: in the real MicroPython, and in CPython.

Both interpreters find every file of `firmware/` and `tests/firmware/fakes/` under its bare name (`import vl53l1x`), and
the files they are given besides; a file given hides one of the same name. Each run is a process of its own.

- `MicroPython` is the WebAssembly build in Node, put into `build/micropython` by `make micropython`. It has `struct`,
  `hashlib`, `micropython`, `array`, `gc`, `json`, `os`, `select`, `time.ticks_us`. Of `machine`, `network`, `socket`
  and `esp` there are fakes.
- `CPython` has stand-ins (`tests/firmware/shims`) for the module `micropython` and for what MicroPython's `time` and
  `sys` have besides.

In tests, use `micropython(files, script)`, or the fixture of conftest.py `unit_python(files, script)`, which runs a
test once in each. Both return the lines that the script printed, and fail the test if the script raises.

Tests that are all unit-side are functions without arguments in a module of `tests/firmware/cases/`, in plain asserts,
which test_cases.py runs in one process.
"""

import base64
import json
import shutil
import subprocess
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

import pytest

from tests.needs import skip_for

Files = Mapping[str, str | bytes | Path]
"""Name in the root of the unit's file system to content; a `Path` stands for the content of that file."""
Run = Callable[[Files, str], list[str]]

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
PACKAGE = ROOT / "build/micropython/node_modules/@micropython/micropython-webassembly-pyscript/micropython.mjs"
TIMEOUT = 60.0
"""Longest a script may run [s]."""


def _tree(files: Files) -> dict[str, bytes]:
    paths = [*(ROOT / "firmware").glob("*.py"), *(HERE / "fakes").glob("*.py")]
    return {path.name: path.read_bytes() for path in paths} | {
        name: content.encode() if isinstance(content, str) else content if isinstance(content, bytes)
        else content.read_bytes() for name, content in files.items()
    }  # fmt: skip


def _lines(command: list[str | Path], stdin: str) -> list[str]:
    done = subprocess.run(command, input=stdin, capture_output=True, text=True, timeout=TIMEOUT, check=False)
    if done.returncode:
        pytest.fail(f"{done.stdout}{done.stderr}", pytrace=False)
    lines = done.stdout.split("\n")
    return lines if lines[-1] else lines[:-1]


def node(program: str) -> list[str | Path]:
    """Return the command that runs a program of ours with MicroPython. Skip the test where Node or that is missing."""
    found = shutil.which("node")
    if found is None:
        skip_for("apt-get install nodejs npm")
    if not PACKAGE.exists():
        skip_for("make micropython")
    return [found, HERE / program, PACKAGE]


def packed(files: Mapping[str, bytes]) -> dict[str, str]:
    """Return files as our programs for Node take them."""
    return {name: base64.b64encode(content).decode() for name, content in files.items()}


def micropython(files: Files, script: str) -> list[str]:
    """Return the lines a script prints in MicroPython. Skip the test where Node or the package is missing."""
    return _lines(node("run.mjs"), json.dumps({"files": packed(_tree(files)), "script": script}))


def cpython(files: Files, script: str, folder: Path) -> list[str]:
    """Return the lines a script prints in CPython, its files in an empty folder."""
    for name, content in _tree(files).items():
        (folder / name).write_bytes(content)
    start = f"import sys; sys.path[:0] = [{str(folder)!r}, {str(HERE / 'shims')!r}]; import as_on_unit; "
    start += "exec(compile(sys.stdin.read(), '<stdin>', 'exec'))"
    return _lines([sys.executable, "-I", "-S", "-B", "-c", start], script)
