"""What is installed only where it is wanted: which modules an extra brings, and what to run where they are missing."""

import shlex
import sys
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

from pretouch.errors import MissingExtraError

_CLONE = Path(__file__).parents[2]


@dataclass(frozen=True)
class Extra:
    """An extra of a distribution."""

    name: str
    modules: tuple[str, ...]
    """Modules that are imported where it is used."""
    target: str
    """Target of make that installs it in a clone."""
    distribution: str = "pretouch"

    def missing(self, *modules: str) -> tuple[str, ...]:
        """Return those of its modules that are not installed: of all, or of those that are named."""
        return tuple(name for name in modules or self.modules if find_spec(name) is None)

    @property
    def command(self) -> str:
        """What installs it: a target of make in the environment of a clone, or pip of the Python that runs."""
        if Path(sys.prefix) != _CLONE / ".venv":
            return f"{shlex.quote(sys.executable)} -m pip install '{self.distribution}[{self.name}]'"
        there = "" if Path.cwd() == _CLONE else f"-C {shlex.quote(str(_CLONE))} "
        return f"make {there}{self.target}"

    def need(self, what: str, *modules: str) -> None:
        """Raise MissingExtraError where it, or one of its modules that are named, is not installed.

        `what` needs it; it is the subject of the sentence, in the singular.
        """
        if absent := self.missing(*modules):
            raise MissingExtraError(f"{what} needs {', '.join(absent)} of the extra '{self.name}': run {self.command}")


BAGS = Extra("bags", ("rosbags",), "setup")
FIGURES = Extra("figures", ("matplotlib",), "setup")
FRANKA = Extra("franka", ("panda_py", "pylibfranka", "ruckig"), "franka")
MESHES = Extra("meshes", ("collada",), "meshes")
ROS2 = Extra("ros2", ("cyclonedds", "rosbags"), "ros2")
VIEWER = Extra("viewer", ("viser",), "setup")
