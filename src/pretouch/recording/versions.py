"""What a recomputation to the bit rests on."""

import platform
from functools import cache
from importlib.metadata import version
from pathlib import Path

import pretouch
from pretouch.compiled import digest

_LIBRARIES = ("numpy", "numba", "mujoco-core", "daqp", "scipy")


@cache
def versions() -> dict[str, str]:
    """Return what a recomputation to the bit rests on: program, its source, libraries, machine."""
    found = {"pretouch": pretouch.__version__, "source": digest(Path(pretouch.__file__).parent)}
    found |= {name: version(name) for name in _LIBRARIES}
    return found | {"python": platform.python_version(), "system": platform.system(), "machine": _machine()}


def _machine() -> str:
    """Name the processor: its kind decides how a sum is rounded."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError):
        lines = []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return f"{platform.machine()} {names[0] if names else platform.processor()}".strip()
