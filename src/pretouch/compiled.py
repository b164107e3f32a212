"""Compiled numerical functions, kept between runs wherever the machine has a place to keep them."""

import logging
import sys
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from inspect import signature
from pathlib import Path
from typing import Annotated, Any, Protocol, TypeVar, cast

from numba import njit
from numba.core import event
from numba.core.caching import FunctionCache
from numba.core.runtime.nrt import rtsys

from pretouch.errors import SourceError
from pretouch.source_digest import source_digest

Function = TypeVar("Function", bound=Callable[..., object])
Result = TypeVar("Result")
Group = TypeVar("Group")


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


class Entry(Protocol[Result]):
    """What `entry` makes: called with groups, or by `flat` with each of their fields, in order."""

    flat: Callable[..., Result]

    def __call__(self, *groups: Any, **named: Any) -> Result:
        """Call with groups."""


def entry(function: Callable[..., Result]) -> Entry[Result]:
    """Compile a function that Python calls, whose parameters may be groups: classes made with `NamedTuple`.

    In the function a group is that named tuple, and may be handed on to other compiled functions. The caller gives one
    too, or a plain tuple of the same fields, which is made in a tenth of the time; or, for a parameter annotated with
    `ByName[Group]`, any object that has its fields, such as a dataclass. Groups may hold groups.

    Numba takes 4 to 6 us to read forty arrays out of named tuples, and 1.5 us if each is an argument of its own. So two
    functions are generated: one in Python that takes the groups apart, which costs 1 us of forty arrays, and a compiled
    one that puts them together. Calls that each step makes hand the fields to that one, `flat`, themselves; groups that
    stay the same come last, `flattened` once.
    """
    name, scope = function.__name__, dict[str, Any](__name__=function.__module__)
    parameters = signature(function).parameters
    taken = []
    for parameter in parameters:
        if parameter not in function.__annotations__:
            raise TypeError(f"{name}() has no type for {parameter}: annotate it, so that its group is known.")
        taken.append(_Taken.of(parameter, function.__annotations__[parameter], scope))
    called_by_python = (
        f"def {name}({', '.join(parameters)}):\n"
        f"{''.join(line for t in taken for line in t.before)}"
        f"    return _flat(*({' + '.join(t.apart for t in taken)}))\n"
    )
    flat = (
        f"def {name}_flat({', '.join(argument for t in taken for argument in t.arguments)}):\n"
        f"    return _body({', '.join(t.together for t in taken)})\n"
    )
    # Numba keeps what it compiles beside the file that a function's code names, and reads the text there that begins at
    # the code's first line: both generated functions stand where the true one does.
    above = "\n" * (function.__code__.co_firstlineno - 1)
    for text in (called_by_python, flat):
        exec(compile(above + text, function.__code__.co_filename, "exec"), scope)  # noqa: S102  of names of parameters
    called = scope[name]
    called.__doc__, called.__wrapped__ = function.__doc__, function
    scope["_body"] = inlined(function)
    scope["_flat"] = called.flat = compiled(scope[f"{name}_flat"])
    return cast(Entry[Result], called)


def flattened(*groups: Any) -> tuple[Any, ...]:
    """Return the fields of groups, those of groups in groups too, for `Entry.flat`."""
    fields: list[Any] = []
    for group in groups:
        fields += flattened(*group) if isinstance(group, tuple) else (group,)
    return tuple(fields)


ByName = Annotated[Group, "given as any object that has the fields of the group"]
"""Annotates a parameter of an `entry`."""


@dataclass(frozen=True)
class _Taken:
    """How a parameter, or a field of a group, is handed over."""

    before: list[str]
    """Lines of Python that unpack groups of groups."""
    apart: str
    """Tuple that Python hands over."""
    arguments: list[str]
    """Names under which that arrives."""
    together: str
    """What the compiled function is given, made of these."""

    @classmethod
    def of(cls, name: str, kind: Any, scope: dict[str, Any]) -> "_Taken":
        """Take what has a name and a type; the classes of groups are noted in `scope`."""
        by_name, kind = hasattr(kind, "__metadata__"), getattr(kind, "__origin__", kind)
        if not hasattr(kind, "_fields"):
            return cls([], f"({name},)", [name], name)
        group, names = f"{kind.__name__}_{len(scope)}", [f"{name}__{field}" for field in kind._fields]
        scope[group] = kind
        parts = [cls.of(n, kind.__annotations__[f], scope) for n, f in zip(names, kind._fields, strict=True)]
        if all(part.together == n for part, n in zip(parts, names, strict=True)):
            before, apart = [], name
            if by_name:
                apart = f"({''.join(f'{name}.{field}, ' for field in kind._fields)})"
        else:
            before = [f"    {', '.join(names)} = {name}\n", *(line for part in parts for line in part.before)]
            apart = " + ".join(part.apart for part in parts)
        arguments = [argument for part in parts for argument in part.arguments]
        return cls(before, apart, arguments, f"{group}({', '.join(part.together for part in parts)})")


def is_large(told: event.Event) -> bool:
    """Return whether an event "numba:compile" of Numba is about an `entry`, which may take a minute."""
    return bool(told.data["dispatcher"].py_func.__name__.endswith("_flat"))


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
