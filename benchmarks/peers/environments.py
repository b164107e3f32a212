"""Where each peer can be imported: its own environment, one that is named, or this one."""

import os
import re
import subprocess
import sys
import tomllib
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
_FOLDER = ROOT / ".venv" / "peers"
_SHARED = ("daqp", "numpy")
"""Requirements of Pretouch and its tests that every peer's environment gets too: the same solver and arrays for all."""


@dataclass(frozen=True)
class Peer:
    """A package to compare with."""

    extra: str
    """Optional extra of Pretouch that lists what it needs."""
    imported: str
    """What an environment must be able to import."""


PEERS = (Peer("mink", "mink"), Peer("pink", "pink"), Peer("neo", "roboticstoolbox"))


def python_of(peer: Peer, named: dict[str, str]) -> str | None:
    """Find the interpreter to run a peer with: the one named, the one `set_up` made, or this one; None without any."""
    if peer.extra in named:
        return named[peer.extra]
    own = _own(peer)
    if own.is_file():
        return str(own)
    return sys.executable if find_spec(peer.imported) else None


def set_up(peer: Peer) -> None:
    """Make an environment for a peer if it has none. Pretouch is not installed in it, so no versions can clash."""
    python = _own(peer)
    if python.is_file():
        return
    print(f"Installing {peer.extra} into {_FOLDER / peer.extra}", flush=True)
    folder = python.parents[1]
    subprocess.run([sys.executable, "-m", "venv", str(folder)], check=True)  # noqa: S603, our own arguments
    try:
        pip = [str(python), "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
        subprocess.run([*pip, *_requirements(peer)], check=True)  # noqa: S603, names from our own file
    except BaseException:
        python.unlink()  # half an environment must not be taken for one
        raise


def _own(peer: Peer) -> Path:
    return _FOLDER / peer.extra / "bin" / "python"


def _requirements(peer: Peer) -> list[str]:
    """Read the peer's extra, and the ranges of what is shared, from pyproject.toml."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = project["optional-dependencies"]
    shared = [r for r in project["dependencies"] + extras["dev"] if re.split(r"[^\w-]", r, maxsplit=1)[0] in _SHARED]
    return [*shared, *extras[peer.extra]]


def single_threaded() -> dict[str, str]:
    """Return environment variables for a worker that computes on one thread."""
    names = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
    return os.environ | dict.fromkeys(names, "1")
