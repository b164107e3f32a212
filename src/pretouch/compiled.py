"""Compiled numerical functions, kept between runs wherever the machine has a place to keep them."""

import logging
import sys
from collections.abc import Callable
from contextlib import suppress
from functools import cached_property, wraps
from typing import Any, TypeVar, cast

from llvmlite.binding import get_host_cpu_features, parse_assembly
from numba import njit
from numba.core import event, types
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
    return cast(Function, _dispatcher(function))


def entry(function: Function) -> Function:
    """Compile a function that Python calls and compiled ones do not: what is kept of it loads in half of the time."""
    return cast(Function, _dispatcher(function, "-entry"))


def kernel(function: Function) -> Function:
    """Make a function part of compiled ones: without what a call from Python needs, a third of the time to compile.

    A call from Python, as a test makes, compiles it once more.
    """
    return cast(Function, wraps(function)(_Kernel(function)))


class _Kernel:
    """Compiles a function for compiled ones, and anew for Python, when they first call it."""

    def __init__(self, function: Callable[..., object]) -> None:
        self._function = function

    def __call__(self, *arguments: object) -> object:
        """Call it from Python."""
        return self._alone(*arguments)

    @cached_property
    def _alone(self) -> Any:
        return _dispatcher(self._function)

    @cached_property
    def _numba_type_(self) -> types.Dispatcher:
        """What compiled code takes the function for; the type does not hold what it is of."""
        self._within = _dispatcher(self._function, "-within", no_cpython_wrapper=True, no_cfunc_wrapper=True)
        return types.Dispatcher(self._within)


def _dispatcher(function: Callable[..., object], kind: str = "", **options: bool) -> Any:
    """Return what compiles a function when it is called, or takes what was kept of that."""
    kept: Any = cast(Any, njit)(error_model="numpy", **options)(function)
    # Numba looks at the function's own file only to tell whether what it kept is out of date. What got into a function
    # from another file, a constant or a call, it would go on using as it was: so the name it keeps it under tells all.
    name = function.__qualname__
    with suppress(RuntimeError, SourceError):  # nowhere to keep it, or no text to tell whether it is out of date
        function.__qualname__ = f"{name}-{source_digest(function)[:12]}{kind}"
        kept._cache = _Cache(function)  # type: ignore[no-untyped-call]
        kept._cache.linked = kind != "-entry"
    function.__qualname__ = name
    return kept


def inlined(function: Function) -> Function:
    """Make a function part of the compiled one that calls it, at one place: large groups are not copied to it.

    It is compiled there alone. Elsewhere it would only make the machine code longer, and what does not fit the
    processor's cache is slow.
    """
    return cast(Function, njit(error_model="numpy", inline="always")(function))


LEVEL, _LEVEL_HAS = "x86-64-v3", {"avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe"}
"""Processors that a wheel's machine code is for, of 2013 and later, and what they can do."""


class _Cache(FunctionCache):
    """Numba's cache, with less to do where all is kept."""

    linked = True
    """Whether compiled functions call it; else only the names of what it defines are kept beside the machine code."""

    _shipped = False
    """Whether a wheel's machine code is looked for."""

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Load machine code: what Numba's own registers before, all that can be compiled, takes a tenth of a second."""
        rtsys.initialize(target_context)
        with self._guard_against_spurious_io_errors():
            overload = self._load_overload(sig, target_context)  # type: ignore[no-untyped-call]
            if overload is None and {name for name, has in get_host_cpu_features().items() if has} >= _LEVEL_HAS:
                self._shipped = True
                overload = self._load_overload(sig, target_context)  # type: ignore[no-untyped-call]
                self._shipped = False
            return overload

    def _index_key(self, sig: Any, codegen: Any) -> Any:
        sig, (triple, *host), code = super()._index_key(sig, codegen)  # type: ignore[no-untyped-call]
        return sig, (triple, LEVEL, "") if self._shipped else (triple, *host), code

    def save_overload(self, sig: Any, data: Any) -> None:
        """Let a full disk be no reason to stop: Numba raises where it cannot write what it just compiled."""
        if not self.linked:
            module = data.library._get_module_for_linking()
            names = [part.name for part in (*module.functions, *module.global_variables) if not part.is_declaration]
            data.library._shared_module = parse_assembly("".join(f'@"{name}" = global i8 0\n' for name in names))
        with suppress(OSError):
            super().save_overload(sig, data)  # type: ignore[no-untyped-call]


_LARGE = ("line", "perceive", "assess_sample", "move_within")
"""Functions that take seconds."""


class FirstStart(event.Listener):
    """Says once that something large is compiled, to the logger `pretouch`: a warning to people at a terminal."""

    said = False
    """Whether somebody has said it."""

    def on_start(self, event: event.Event) -> None:
        """Say it, where nobody has."""
        if not self.said and event.data["dispatcher"].py_func.__name__ in _LARGE:
            self.said = True
            self.say("Compiling for this processor, once after an installation: about a minute ...")

    def on_end(self, event: event.Event) -> None:
        """Nothing: others may follow."""

    def say(self, sentence: str) -> None:
        """Log a sentence; a command puts something else in its place."""
        level = logging.WARNING if sys.stderr and sys.stderr.isatty() else logging.INFO
        logging.getLogger("pretouch").log(level, sentence)


FIRST_START = FirstStart()
event.register("numba:compile", FIRST_START)
