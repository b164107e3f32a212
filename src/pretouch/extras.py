"""What is installed only where it is wanted: which modules an extra brings, and what to run where they are missing."""

import shlex
import sys
from importlib.util import find_spec
from pathlib import Path

from pretouch.errors import MissingExtraError

MODULES = {
    "franka": ("panda_py", "pylibfranka", "ruckig"),
    "meshes": ("collada", "trimesh"),
    "ros2": ("cyclonedds",),
    "sweep": ("SALib", "distributed", "pyarrow"),
    "viewer": ("trimesh", "viser"),
}
"""Modules that are imported where an extra is used."""
_SET_UP = ("sweep", "viewer")
"""Those that `make setup` installs."""
_CLONE = Path(__file__).parents[2]


def missing(extra: str, *modules: str) -> tuple[str, ...]:
    """Return those modules of an extra that are not installed; without `modules`, of all of them."""
    return tuple(name for name in modules or MODULES[extra] if find_spec(name) is None)


def command(extra: str) -> str:
    """Return what installs an extra: a target of make in the environment of a clone, or pip of the Python that runs."""
    if Path(sys.prefix) != _CLONE / ".venv":
        return f"{shlex.quote(sys.executable)} -m pip install 'pretouch[{extra}]'"
    there = "" if Path.cwd() == _CLONE else f"-C {shlex.quote(str(_CLONE))} "
    return f"make {there}{'setup' if extra in _SET_UP else extra}"


def need(extra: str, what: str, *modules: str) -> None:
    """Raise MissingExtraError where an extra, or one of its modules that are named, is not installed.

    `what` is the subject of the sentence.
    """
    if absent := missing(extra, *modules):
        raise MissingExtraError(f"{what} needs {', '.join(absent)} of the extra '{extra}': run {command(extra)}")
