"""Compiled numerical functions, kept between runs wherever the machine has a place to keep them."""

from collections.abc import Callable
from hashlib import sha256
from pathlib import Path
from typing import TypeVar, cast

from numba import njit

Function = TypeVar("Function", bound=Callable[..., object])


def digest(folder: Path) -> str:
    """Return what tells this state of the files under a folder that hold compiled functions from any other."""
    content = sha256()
    for path in sorted(folder.rglob("*.py")):
        text = path.read_bytes()
        if b"@compiled" in text:
            content.update(path.name.encode() + b"\0" + text)
    return content.hexdigest()[:12]


_DIGEST = digest(Path(__file__).parent)


def compiled(function: Function) -> Function:
    """Compile a function at its first call, for the types it is called with.

    A division by zero in it gives an infinite or undefined number, as in NumPy, and no exception. The machine code is
    kept beside the module, or in the user's cache where an installation is read-only. Where neither can be written it
    is compiled anew in each process: that takes seconds, and works.
    """
    # Numba looks at the function's own file only to tell whether what it kept is out of date. What is compiled into one
    # function from another file, it would go on using as it was: so the name it keeps it under tells all files.
    function.__qualname__ += f"-{_DIGEST}"
    try:
        kept = njit(cache=True, error_model="numpy")(function)
    except RuntimeError:  # nowhere to keep it
        kept = njit(error_model="numpy")(function)
    return cast(Function, kept)


@compiled
def _nothing() -> None:
    """Compile to almost nothing."""


def kept_in() -> str:
    """Return the folder that compiled functions are kept in, or '' where there is none."""
    _nothing()
    stats = getattr(_nothing, "stats", None)
    return str(Path(stats.cache_path).parent) if stats and stats.cache_path else ""
