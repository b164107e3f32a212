"""Compiled numerical functions, cached between runs where the machine has a place for the cache."""

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
    """Compile a function at its first call, for the types of its arguments.

    A division by zero in it gives an infinite or undefined number, as in NumPy, and no exception. The machine code is
    cached beside the module, or in the user's cache where an installation is read-only. Where neither can be written,
    each process compiles anew: that takes seconds, and works.
    """
    return cast(Function, _dispatcher(function))


def entry(function: Function) -> Function:
    """Compile a function that only Python calls: its cached machine code loads in half of the time."""
    return cast(Function, _dispatcher(function, "-entry"))


def kernel(function: Function) -> Function:
    """Compile a function that compiled ones call: without the wrapper for Python in a third of the time.

    A call from Python, as in a test, compiles it once more.
    """
    return cast(Function, wraps(function)(_Kernel(function)))


class _Kernel:
    """Compiles a function for compiled callers and for Python, each at the first call."""

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
        """Numba type of the function; a type keeps no reference to its dispatcher."""
        self._within = _dispatcher(self._function, "-within", no_cpython_wrapper=True, no_cfunc_wrapper=True)
        return types.Dispatcher(self._within)


def _dispatcher(function: Callable[..., object], kind: str = "", **options: bool) -> Any:
    """Return a dispatcher, which compiles a function at a call or loads its cached machine code."""
    dispatcher: Any = cast(Any, njit)(error_model="numpy", **options)(function)
    # Numba checks only the function's own file for changes. It would go on with old constants and functions from other
    # files: so the cached name contains the digest of them all.
    name = function.__qualname__
    with suppress(RuntimeError, SourceError):  # no place for a cache, or no source text for a digest
        function.__qualname__ = f"{name}-{source_digest(function)[:12]}{kind}"
        dispatcher._cache = _Cache(function)  # type: ignore[no-untyped-call]
        dispatcher._cache.linked = kind != "-entry"
    function.__qualname__ = name
    return dispatcher


def inlined(function: Function) -> Function:
    """Compile a function into its only compiled caller: large groups of arguments are then not copied.

    With several callers it would make the machine code longer, and code that does not fit the processor's cache is
    slow.
    """
    return cast(Function, njit(error_model="numpy", inline="always")(function))


LEVEL, _LEVEL_HAS = "x86-64-v3", {"avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe"}
"""Processors of a wheel's machine code, of 2013 and later, and their features."""


class _Cache(FunctionCache):
    """Numba's cache, faster where all functions are cached."""

    linked = True
    """True if compiled functions call it; otherwise the machine code is cached with the names of its symbols only."""

    _shipped = False
    """True while the machine code of a wheel is looked up."""

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Load machine code, without Numba's registration of all types, which takes a tenth of a second."""
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
        """Save machine code; a full disk, for which Numba raises an error, does not stop the program."""
        if not self.linked:
            module = data.library._get_module_for_linking()
            names = [part.name for part in (*module.functions, *module.global_variables) if not part.is_declaration]
            data.library._shared_module = parse_assembly("".join(f'@"{name}" = global i8 0\n' for name in names))
        with suppress(OSError):
            super().save_overload(sig, data)  # type: ignore[no-untyped-call]


_LARGE = ("line", "perceive", "assess_sample", "move_within")
"""Functions that take seconds."""


class FirstStart(event.Listener):
    """Logs once that a large function is compiled, to the logger `pretouch`: a warning at a terminal."""

    logged = False
    """True after the message."""

    def on_start(self, event: event.Event) -> None:
        """Log the message at the first large function."""
        if not self.logged and event.data["dispatcher"].py_func.__name__ in _LARGE:
            self.logged = True
            self.say("Compiling for this processor, once after an installation: about a minute ...")

    def on_end(self, event: event.Event) -> None:
        """Do nothing: more functions may follow."""

    def say(self, sentence: str) -> None:
        """Log a sentence; a command replaces this method."""
        level = logging.WARNING if sys.stderr and sys.stderr.isatty() else logging.INFO
        logging.getLogger("pretouch").log(level, sentence)


FIRST_START = FirstStart()
event.register("numba:compile", FIRST_START)
