"""Optional dependencies: the modules of each extra, and the command that installs them."""

import json
import shlex
import sys
from dataclasses import dataclass
from importlib.metadata import distribution, version
from importlib.util import find_spec
from pathlib import Path
from urllib.parse import unquote, urlsplit

from pretouch.errors import MissingExtraError

_CLONE = Path(__file__).parents[2]
LAB, FCI = "pretouch-lab", "pretouch-fci"
_FOLDERS = {LAB: "lab", FCI: "fci", "pretouch-ros2": "ros2"}
"""Folder in a clone of each distribution beside this one."""


@dataclass(frozen=True)
class Extra:
    """An extra of a distribution."""

    name: str
    """Name of the extra; '' for the distribution itself."""
    modules: tuple[str, ...]
    """Modules that code with this extra imports."""
    target: str
    """Target of make that installs it in a clone."""
    distribution: str = "pretouch"

    def missing(self, *modules: str) -> tuple[str, ...]:
        """Return its modules that are not installed, of all or of those that are named."""
        return tuple(name for name in modules or self.modules if find_spec(name) is None)

    @property
    def command(self) -> str:
        """Command that installs it for this Python; see `install_command`."""
        return install_command(self.distribution, self.name, self.target)

    def need(self, what: str, *modules: str) -> None:
        """Raise MissingExtraError where it, or one of its modules that are named, is not installed.

        `what` needs it; it is the subject of the sentence, in the singular.
        """
        if absent := self.missing(*modules):
            raise MissingExtraError(f"{what} needs {', '.join(absent)} of the extra '{self.name}': run {self.command}")


FIGURES = Extra("figures", ("matplotlib",), "setup")
FRANKA = Extra("franka", ("panda_py", "pylibfranka", "ruckig"), "franka")
LIVE = Extra("live", ("viser",), "setup")
MESHES = Extra("meshes", ("collada",), "meshes")
PARQUET = Extra("parquet", ("pyarrow",), "setup")
ROS2 = Extra("", ("pretouch_ros2",), "ros2", "pretouch-ros2")
UNITS = Extra("units", ("mpremote",), "units")


def install_command(owner: str, extra: str = "", target: str = "setup") -> str:
    """Return the command that installs a distribution, or an extra of it, where this Python is.

    In a clone that is a target of make, or pip of the folder in an environment other than the clone's own. A
    distribution beside this one that is missing is looked for beside the wheel of Pretouch too.
    """
    python = shlex.quote(sys.executable)
    pip = f"{python} -m pip install" if find_spec("pip") else f"uv pip install --python {python}"
    if not (_CLONE / "lab" / "pyproject.toml").is_file():
        if owner not in _FOLDERS or find_spec(owner.replace("-", "_")):
            return f"{pip} {_quoted(owner, extra)}"
        return f"{pip} {_find_links()}{_quoted(owner, extra, '==' + version('pretouch'))}"
    if Path(sys.prefix) != _CLONE / ".venv":
        return f"{pip} -e {_quoted(_CLONE / _FOLDERS.get(owner, ''), extra)}"
    return f"make {'' if Path.cwd() == _CLONE else f'-C {shlex.quote(str(_CLONE))} '}{target}"


def _find_links() -> str:
    """Return the option that names the folder which Pretouch was installed from; '' where that was an index."""
    text = distribution("pretouch").read_text("direct_url.json") or '{"url": ""}'
    scheme, _, path, *_ = urlsplit(json.loads(text)["url"])
    return f"--find-links {shlex.quote(str(Path(unquote(path)).parent))} " if scheme == "file" else ""


def _quoted(what: object, extra: str, release: str = "") -> str:
    return f"'{what}{f'[{extra}]' if extra else ''}{release}'"
