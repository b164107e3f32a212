"""Compiled numerical functions, kept between runs wherever the machine has a place to keep them."""

from collections.abc import Callable
from contextlib import suppress
from hashlib import sha256
from pathlib import Path
from typing import Any, TypeVar, cast

from numba import njit

Function = TypeVar("Function", bound=Callable[..., object])

_NOT_COMPILED = (
    "cli", "reporting", "viewer", "foreign", "serving", "hardware", "recording", "calibration",
    "importing", "coverage", "session", "traces.py",
)  # fmt: skip


def digest(folder: Path) -> str:
    """Return what tells this state of the Python files under a folder from any other.

    But for those of packages of which nothing gets into a compiled function.
    """
    content = sha256()
    for path in sorted(folder.rglob("*.py")):
        place = path.relative_to(folder)
        if place.parts[0] not in _NOT_COMPILED:
            content.update(str(place).encode() + b"\0" + path.read_bytes())
    return content.hexdigest()[:12]


_DIGEST = digest(Path(__file__).parent)


def compiled(function: Function) -> Function:
    """Compile a function at its first call, for the types it is called with.

    A division by zero in it gives an infinite or undefined number, as in NumPy, and no exception. The machine code is
    kept beside the module, or in the user's cache where an installation is read-only. Where neither can be written it
    is compiled anew in each process: that takes seconds, and works.
    """
    # Numba looks at the function's own file only to tell whether what it kept is out of date. What got into a function
    # from another file, a constant or a call, it would go on using as it was: so the name it keeps it under tells all.
    function.__qualname__ += f"-{_DIGEST}"
    try:
        kept = njit(cache=True, error_model="numpy")(function)
    except RuntimeError:  # nowhere to keep it
        return cast(Function, njit(error_model="numpy")(function))
    _keep_if_possible(kept)
    return cast(Function, kept)


def _keep_if_possible(kept: Any) -> None:
    """Let a full disk be no reason to stop: Numba raises where it cannot write what it just compiled."""
    cache = kept._cache
    save = cache.save_overload

    def try_to_save(*given: object) -> None:
        with suppress(OSError):
            save(*given)

    cache.save_overload = try_to_save


@compiled
def _nothing() -> None:
    """Compile to almost nothing."""


def kept_in() -> str:
    """Return the folder that compiled functions are kept in, or '' where there is none."""
    _nothing()
    stats = getattr(_nothing, "stats", None)
    return str(Path(stats.cache_path).parent) if stats and stats.cache_path else ""
