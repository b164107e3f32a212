"""What a recomputation to the bit rests on."""

import platform
from functools import cache
from importlib.metadata import version
from pathlib import Path

from pretouch import __version__
from pretouch.controller import Controller
from pretouch.source_digest import source_digest

_LIBRARIES = ("numpy", "numba", "mujoco-core", "scipy")


@cache
def libraries() -> dict[str, str]:
    """Return the versions of the libraries whose numbers a result rests on."""
    return {name: version(name) for name in _LIBRARIES}


@cache
def versions() -> dict[str, str]:
    """Return what a recomputation to the bit rests on: program, its source, libraries, machine."""
    found = {"pretouch": __version__, "source": source_digest(Controller)[:12], **libraries()}
    return found | {"python": platform.python_version(), "system": platform.system(), "machine": _machine()}


def _machine() -> str:
    """Name the processor: its kind decides how a sum is rounded."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError):
        lines = []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return f"{platform.machine()} {names[0] if names else platform.processor()}".strip()
