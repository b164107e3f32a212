"""Compiled numerical functions, kept between runs wherever the machine has a place to keep them."""

import logging
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeVar, cast

from numba import njit
from numba.core import event
from numba.core.caching import FunctionCache
from numba.core.runtime.nrt import rtsys

from pretouch.errors import SourceError
from pretouch.source_digest import source_digest

Function = TypeVar("Function", bound=Callable[..., object])


def compiled(function: Function) -> Function:
    """Compile a function at its first call, for the types it is called with.

    A division by zero in it gives an infinite or undefined number, as in NumPy, and no exception. The machine code is
    kept beside the module, or in the user's cache where an installation is read-only. Where neither can be written it
    is compiled anew in each process: that takes seconds, and works.
    """
    # Numba looks at the function's own file only to tell whether what it kept is out of date. What got into a function
    # from another file, a constant or a call, it would go on using as it was: so the name it keeps it under tells all.
    with suppress(RuntimeError, SourceError):  # nowhere to keep it, or no text to tell whether it is out of date
        function.__qualname__ += f"-{source_digest(function)[:12]}"
        cache = _Cache(function)  # type: ignore[no-untyped-call]
        kept: Any = njit(error_model="numpy")(function)
        kept._cache = cache
        return cast(Function, kept)
    return cast(Function, njit(error_model="numpy")(function))


def inlined(function: Function) -> Function:
    """Make a function part of the compiled one that calls it, at one place: large groups are not copied to it.

    It is compiled there alone. Elsewhere it would only make the machine code longer, and what does not fit the
    processor's cache is slow.
    """
    return cast(Function, njit(error_model="numpy", inline="always")(function))


class _Cache(FunctionCache):
    """Numba's cache, with less to do where all is kept."""

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Load machine code: what Numba's own registers before, all that can be compiled, takes a tenth of a second."""
        rtsys.initialize(target_context)
        with self._guard_against_spurious_io_errors():
            return self._load_overload(sig, target_context)  # type: ignore[no-untyped-call]

    def save_overload(self, sig: Any, data: Any) -> None:
        """Let a full disk be no reason to stop: Numba raises where it cannot write what it just compiled."""
        with suppress(OSError):
            super().save_overload(sig, data)  # type: ignore[no-untyped-call]


def is_large(told: event.Event) -> bool:
    """Return whether an event "numba:compile" of Numba is about a part of a control step, which may take a minute."""
    return told.data["dispatcher"].py_func.__name__ in ("line", "perceive", "assess_sample", "move_within")


class FirstStart(event.Listener):
    """Says once that something large is compiled, to the logger `pretouch`: a warning to people at a terminal."""

    said = False
    """Whether somebody has said it."""

    def on_start(self, event: event.Event) -> None:
        """Say it, where nobody has."""
        if not self.said and is_large(event):
            self.said = True
            level = logging.WARNING if sys.stderr and sys.stderr.isatty() else logging.INFO
            logging.getLogger("pretouch").log(
                level, "Compiling for this processor, once after an installation: up to two minutes ..."
            )

    def on_end(self, event: event.Event) -> None:
        """Nothing: others may follow."""


FIRST_START = FirstStart()
event.register("numba:compile", FIRST_START)


@compiled
def _nothing() -> None:
    """Compile to almost nothing."""


def kept_in() -> str:
    """Return the folder that compiled functions are kept in, or '' where there is none."""
    _nothing()
    stats = getattr(_nothing, "stats", None)
    return str(Path(stats.cache_path).parent) if stats and stats.cache_path else ""
