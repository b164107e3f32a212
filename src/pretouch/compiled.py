"""Compiled numerical functions, kept between runs wherever the machine has a place to keep them."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from hashlib import sha256
from inspect import signature
from pathlib import Path
from typing import Annotated, Any, TypeVar, cast

from numba import njit

Function = TypeVar("Function", bound=Callable[..., object])
Result = TypeVar("Result")
Group = TypeVar("Group")

_NOT_COMPILED = (
    "cli", "reporting", "viewer", "experiments", "foreign", "serving", "hardware", "recording", "calibration",
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


def entry(function: Callable[..., Result]) -> Callable[..., Result]:
    """Compile a function that Python calls, whose parameters may be groups: classes made with `NamedTuple`.

    In the function a group is that named tuple, and may be handed on to other compiled functions. The caller gives one
    too; or, for a parameter annotated with `ByName[Group]`, any object that has its fields, such as a dataclass. Groups
    may hold groups.

    Numba takes 4 to 6 us to read forty arrays out of named tuples, and 1.5 us if each is an argument of its own. So two
    functions are generated: one in Python that takes the groups apart, and a compiled one that puts them together.
    """
    name, scope = function.__name__, dict[str, Any](__name__=function.__module__)
    parameters = signature(function).parameters
    taken = []
    for parameter in parameters:
        if parameter not in function.__annotations__:
            raise TypeError(f"{name}() has no type for {parameter}: annotate it, so that its group is known.")
        taken.append(_Taken.of(parameter, function.__annotations__[parameter], scope))
    code = (
        f"def {name}({', '.join(parameters)}):\n"
        f"    return _flat({', '.join(part for t in taken for part in t.apart)})\n"
        f"def {name}_flat({', '.join(argument for t in taken for argument in t.arguments)}):\n"
        f"    return _body({', '.join(t.together for t in taken)})\n"
    )
    # Numba keeps what it compiles beside the file that a function's code names
    exec(compile(code, function.__code__.co_filename, "exec"), scope)  # noqa: S102  made of the names of its parameters
    called = scope[name]
    called.__doc__, called.__wrapped__ = function.__doc__, function
    scope["_body"] = compiled(function)
    scope["_flat"] = compiled(scope[f"{name}_flat"])
    return cast(Callable[..., Result], called)


ByName = Annotated[Group, "given as any object that has the fields of the group"]
"""Annotates a parameter of an `entry`."""


@dataclass(frozen=True)
class _Taken:
    """How a parameter, or a field of a group, is handed over."""

    apart: list[str]
    """What Python hands over."""
    arguments: list[str]
    """Names under which that arrives."""
    together: str
    """What the compiled function is given, made of these."""

    @classmethod
    def of(cls, path: str, kind: Any, scope: dict[str, Any]) -> "_Taken":
        """Take what is at a path, of a type; the classes of groups are noted in `scope`."""
        by_name, kind = hasattr(kind, "__metadata__"), getattr(kind, "__origin__", kind)
        if not hasattr(kind, "_fields"):
            return cls([path], [path.replace(".", "__")], path.replace(".", "__"))
        group = f"{kind.__name__}_{len(scope)}"
        scope[group] = kind
        parts = [cls.of(f"{path}.{field}", kind.__annotations__[field], scope) for field in kind._fields]
        # a tuple of arrays and numbers only is taken apart at once, which costs less than to look each name up
        plain = not by_name and all(part.together == part.arguments[0] for part in parts)
        return cls(
            [f"*{path}"] if plain else [read for part in parts for read in part.apart],
            [argument for part in parts for argument in part.arguments],
            f"{group}({', '.join(part.together for part in parts)})",
        )


@compiled
def _nothing() -> None:
    """Compile to almost nothing."""


def kept_in() -> str:
    """Return the folder that compiled functions are kept in, or '' where there is none."""
    _nothing()
    stats = getattr(_nothing, "stats", None)
    return str(Path(stats.cache_path).parent) if stats and stats.cache_path else ""
