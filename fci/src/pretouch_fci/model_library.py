"""The Panda's model library: C source with the arm's numbers, compiled when a client asks for it."""

import platform
import shutil
from collections.abc import Callable
from functools import cache
from pathlib import Path
from subprocess import SubprocessError, run
from tempfile import TemporaryDirectory

import numpy as np

from pretouch.errors import RobotError
from pretouch.robot.model import RobotModel
from pretouch.types import FloatArray
from pretouch_fci.frames import combined, flange_of, inertials, moved

_FUNCTIONS = Path(__file__).with_suffix(".c")
_SYSTEMS = ("Linux", "Windows")
"""By the numbers in the request, as `platform.system` names them."""
_MACHINES = ("x86_64", "i686", "armv7l", "aarch64")
"""Likewise, as `platform.machine` does."""
_PATIENCE_S = 60.0


def library_answer(model: RobotModel, request: bytes, say: Callable[[str], None]) -> bytes:
    """Return the body of the answer to a request for the library; what prevents one is said."""
    try:
        machine, system = request
        _check_platform(machine, system)
        return b"\0" + _compiled(model)
    except RobotError as error:
        say(f"The client has no model library: {error}")
        return b"\1"


def _check_platform(machine: int, system: int) -> None:
    """Raise RobotError unless this is a machine such as the client's."""
    client = f"{_name(_SYSTEMS, system)} on {_name(_MACHINES, machine)}"
    here = f"{platform.system()} on {platform.machine()}"
    if client != here:
        raise RobotError(f"it asks for one for {client}, and here is {here}: start the server on such a machine.")


def _name(names: tuple[str, ...], number: int) -> str:
    return names[number] if number < len(names) else f"number {number}"


@cache
def _compiled(model: RobotModel) -> bytes:
    """Compile the library; where that fails, raise RobotError."""
    compiler = shutil.which("cc")
    if compiler is None:
        raise RobotError("there is no C compiler: install one that is found as cc.")
    try:
        with TemporaryDirectory(prefix="pretouch-") as folder:
            source, library = Path(folder) / "model.c", Path(folder) / "model.so"
            source.write_text(source_of(model), encoding="utf-8")
            command = [compiler, "-std=c99", "-O2", "-fPIC", "-shared", "-s", str(source), "-o", str(library), "-lm"]
            done = run(command, capture_output=True, timeout=_PATIENCE_S)  # noqa: S603  our own source
            reason = done.stderr.decode(errors="replace").strip().rpartition("\n")[2]
            if not done.returncode:
                return library.read_bytes()
    except (OSError, SubprocessError) as error:
        reason = str(error)
    raise RobotError(f"{compiler} failed ({reason}): install another.")


def source_of(model: RobotModel) -> str:
    """Return the C source of an arm of seven joints, without what its flange carries.

    The numbers are those with all joints at 0, so that joints may have any axis, and links any number of bodies.
    """
    kin, flange, bodies = model.kinematics(np.zeros(model.n)), flange_of(model), inertials(model)
    last = model.moved_by.sum(axis=1) - 1  # the last joint that moves a link
    groups = [[link for link in range(flange + 1) if last[link] == joint] for joint in range(model.n)]
    links = [group[0] for group in groups] + [flange]
    parts = [
        combined([moved(bodies[link], kin.rotation[link], kin.position[link]) for link in group]) for group in groups
    ]
    tables = {
        "AXIS": kin.axis,
        "ANCHOR": kin.anchor,
        "HOME_R": kin.rotation[links].reshape(-1, 9),
        "HOME_P": kin.position[links],
        "MASS": np.array([part.mass for part in parts]),
        "COM": np.array([part.com for part in parts]),
        "INERTIA": np.array([part.inertia.ravel() for part in parts]),
    }
    return "\n".join([*(_table(name, values) for name, values in tables.items()), _FUNCTIONS.read_text("utf-8")])


def _table(name: str, values: FloatArray) -> str:
    """Return a table as C has it."""
    sizes = "".join(f"[{size}]" for size in values.shape)
    numbers = repr(values.tolist()).replace("[", "{").replace("]", "}")
    return f"static const double {name}{sizes} = {numbers};"
