"""Frozen sets of parameters that contain others: nested, optional, or a choice of parts. As text and as plain tables.

A part is a set of parameters with behaviour, chosen by name: `class MyDetector(Detector, name="mine")`. The definition
of a subclass with a name registers it; parts of other distributions are loaded by the entry points of their group.
"""

import ast
import inspect
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass, replace
from functools import cache
from itertools import pairwise
from numbers import Real
from types import MappingProxyType, NoneType, UnionType
from typing import Any, ClassVar, Literal, Self, Union, get_args, get_origin

from pretouch.checks import Checked, hints_of
from pretouch.errors import ParameterError
from pretouch.plugins import load, names

NONE = ("none", "off")
"""Texts for a part or group that is left out."""
_PART = "part"
"""Key of a part's name in a table."""
_BOOLEANS = {"yes": True, "true": True, "no": False, "false": False}


class Part(Checked):
    """Base of the interfaces that parts of a profile implement. A direct subclass names its group of entry points."""

    group: ClassVar[str] = ""
    name: ClassVar[str] = ""
    """Name of the part in texts and recordings."""
    registry: ClassVar[dict[str, "type[Part]"]]
    """Parts of the interface with a definition, by name."""
    State: ClassVar[type] = NoneType
    """Class of the part's state between steps, if it is more than one value: a class with fields."""
    interfaces: ClassVar[dict[str, "type[Part]"]] = {}
    """Interfaces by group."""

    def __init_subclass__(cls, name: str = "", group: str = "") -> None:
        super().__init_subclass__()
        if group:
            cls.group, cls.registry, cls.interfaces[group] = group, {}, cls
        if name:
            other = cls.registry.setdefault(name, cls)
            if (other.__module__, other.__qualname__) != (cls.__module__, cls.__qualname__):
                both = f"{other.__qualname__} and {cls.__qualname__}"
                raise ParameterError(f"{both} have the name {name!r}: rename one.")
            cls.name, cls.registry[name] = name, cls

    @classmethod
    def of_kind(cls, part: object) -> Self:
        """Return a part if it is of this class, otherwise one with default parameters."""
        return part if isinstance(part, cls) else cls()

    @classmethod
    def choices(cls) -> tuple[str, ...]:
        """Return the names of all parts of this interface."""
        return tuple(dict.fromkeys((*cls.registry, *names(cls.group))))

    @classmethod
    def called(cls, name: str) -> "type[Part]":
        """Return the part of a name; for an unknown one, a ParameterError lists the names."""
        if name not in cls.registry and name in names(cls.group):
            load(cls.group, name)
        if name not in cls.registry:
            raise ParameterError(f"There is no {cls.__name__} called {name!r}: choose from {', '.join(cls.choices())}.")
        return cls.registry[name]


def as_table(value: object) -> Any:
    """Return parameters as dicts, lists and plain values."""
    if is_dataclass(value) and not isinstance(value, type):
        part = {_PART: value.name} if isinstance(value, Part) else {}
        return part | {f.name: as_table(getattr(value, f.name)) for f in fields(value)}
    return [as_table(item) for item in value] if isinstance(value, tuple) else value


def from_table(hint: Any, table: Any, where: str = "") -> Any:
    """Make the parameters of a type from a table of `as_table`.

    Raises ParameterError for a wrong value, and for names that only the type or only the table has.
    """
    kind, optional = _without_none(hint)
    if table is None and optional:
        return None
    if get_origin(kind) is tuple and isinstance(table, list):
        inner = get_args(kind)[0]
        return tuple(from_table(inner, item, f"{where}.{i}") for i, item in enumerate(table))
    if not is_dataclass(kind) and not _is_part(kind):
        return _plain(kind, table, where)
    if not isinstance(table, dict):
        raise ParameterError(f"{where} is {table!r}: it must be a table.")
    chosen = kind.called(str(table.get(_PART))) if _is_part(kind) else kind
    hints, values = hints_of(chosen, False), {key: item for key, item in table.items() if key != _PART}
    if unlike := sorted(values.keys() ^ hints.keys()):
        paths = ", ".join(f"{where}.{name}".lstrip(".") for name in unlike)
        raise ParameterError(f"{chosen.__name__} differs in {paths}: use the version of pretouch that wrote it.")
    return chosen(**{name: from_table(hints[name], item, f"{where}.{name}") for name, item in values.items()})


def _plain(kind: Any, value: Any, where: str) -> Any:
    """Refuse a number for a text or a boolean, and the other way round."""
    kind = str if get_origin(kind) is Literal else kind
    for other in (bool, str):
        if isinstance(value, other) != (kind is other):
            raise ParameterError(f"{where.lstrip('.')} is {value!r}: give a value of its type.")
    return value


def changed(value: Any, changes: Mapping[str, str], where: str = "") -> Any:
    """Return parameters with changes: path -> text, as `detect.window_s` -> `0.5` or `detect` -> `thresholds`.

    A part is chosen before its own parameters change, and all changes of a set apply at once, for some are only allowed
    together. Raises ParameterError for an unknown parameter, or a value that is not allowed.
    """
    trees: dict[str, dict[str, str]] = {}
    for path, text in changes.items():
        first, _, rest = path.partition(".")
        trees.setdefault(first, {})[rest] = text
    hints, new = hints_of(value.__class__, False), {}
    for name, tree in trees.items():
        path = f"{where}.{name}" if where else name
        if name not in hints:
            raise ParameterError(f"The parameter {path!r} is unknown: choose from {', '.join(hints)}.")
        now, (kind, _) = getattr(value, name), _without_none(hints[name])
        if "" in tree:
            now = _read(hints[name], tree.pop(""), path, now)
        if tree:
            if not is_dataclass(now):
                first = next(iter(kind.choices())) if _is_part(kind) else "on"
                why = f"none: choose it first, as {path}={first}" if now is None else "a single value"
                raise ParameterError(f"{path}.{next(iter(tree))} cannot be set, because {path} is {why}.")
            now = changed(now, tree, path)
        new[name] = now
    return replace(value, **new) if new else value


def leaves(params: Any, where: str = "") -> Iterator[tuple[str, object]]:
    """Yield each parameter by its path; a part by its name, before its own parameters."""
    for f in fields(params):
        path, value = (f"{where}.{f.name}" if where else f.name), getattr(params, f.name)
        if is_dataclass(value):
            if isinstance(value, Part):
                yield path, value.name
            yield from leaves(value, path)
        else:
            yield path, value


@cache
def field_docs(kind: type) -> Mapping[str, str]:
    """Return the docstring of each field of a dataclass, by name, on one line; inherited ones too."""
    docs: dict[str, str] = {}
    for base in filter(is_dataclass, reversed(kind.__mro__)):
        (node,) = ast.parse(inspect.getsource(base)).body
        docs |= {
            field.target.id: " ".join(str(ast.literal_eval(text.value)).split())
            for field, text in pairwise(getattr(node, "body", ()))
            if isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name) and isinstance(text, ast.Expr)
        }
    return MappingProxyType(docs)


def describe(params: Any) -> str:
    """Return a text with each parameter of a profile, a part or another set: path, value, and meaning with its unit."""
    lines = []
    for path, value in leaves(params):
        group, _, name = path.rpartition(".")
        docs = field_docs((at(params, group) if group else params).__class__)
        lines.append(f"{path} = {_written(value)}: {docs.get(name, '')}".rstrip(": "))
    return "\n".join(lines)


def at(value: Any, path: str, where: str = "") -> Any:
    """Return the parameter or set at a path; an unknown path is a ParameterError."""
    first, _, rest = path.partition(".")
    here, kind = f"{where}.{first}" if where else first, value.__class__
    names_here = hints_of(kind, False) if is_dataclass(value) else {}
    inner = getattr(value, first) if first in names_here else None
    if inner is None and (rest or first not in names_here):
        raise ParameterError(f"The parameter {here!r} is unknown: there is {', '.join(names_here) or 'no parameters'}.")
    return at(inner, rest, here) if rest else inner


def _read(hint: Any, text: str, where: str, now: object = None) -> Any:
    """Read a value of a type. A part or group that is chosen once more keeps its parameters."""
    kind, optional = _without_none(hint)
    if optional and text in NONE:
        return None
    if _is_part(kind):
        part = kind.called(text)
        return now if type(now) is part else part()
    if is_dataclass(kind):
        if text not in ("on", "yes"):
            raise ParameterError(f"{where} is {text!r}: write on or none, or change one of its parameters.")
        return now if now is not None else kind()  # type: ignore[operator]
    if get_origin(kind) is tuple:
        inner = get_args(kind)[0]
        return () if text in NONE else tuple(_read(inner, one, where) for one in text.split(","))
    if kind is bool:
        if text not in _BOOLEANS:
            raise ParameterError(f"{where} is {text!r}: write yes or no.")
        return _BOOLEANS[text]
    if kind not in (int, float):
        return text
    try:
        return kind(text)
    except ValueError:
        raise ParameterError(f"{where} is {text!r}: write a {'whole ' if kind is int else ''}number.") from None


def differences(mine: Any, other: Any, where: str = "") -> Iterator[str]:
    """Yield the changes that turn one set of parameters into another, as PATH=VALUE for `changed`."""
    for f in fields(mine):
        path, a, b = f"{where}.{f.name}" if where else f.name, getattr(mine, f.name), getattr(other, f.name)
        if a == b:
            continue
        if is_dataclass(a) and not isinstance(a, type):
            if type(a) is not type(b):
                yield f"{path}={a.name if isinstance(a, Part) else 'on'}"
                b = type(a)()
            yield from differences(a, b, path)
        else:
            yield f"{path}={_written(a)}"


def _written(value: object) -> str:
    if value is None or value == ():
        return NONE[0]
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, tuple):
        return ",".join(map(_written, value))
    return f"{value:.12g}" if isinstance(value, Real) and not isinstance(value, int) else str(value)


def _without_none(hint: Any) -> tuple[Any, bool]:
    """Return a type without None, and whether it had None."""
    if get_origin(hint) in (Union, UnionType):
        (left,) = (inner for inner in get_args(hint) if inner is not NoneType)
        return left, True
    return hint, False


def _is_part(kind: Any) -> bool:
    return isinstance(kind, type) and issubclass(kind, Part)
