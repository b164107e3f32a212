"""Fields of our classes, by their annotations."""

from dataclasses import fields, is_dataclass
from functools import cache
from types import NoneType, UnionType
from typing import Any, Union, get_args, get_origin, get_type_hints


def is_record(hint: Any) -> bool:
    """Whether a type is a dataclass or a named tuple."""
    return isinstance(hint, type) and (is_dataclass(hint) or hasattr(hint, "_fields"))


@cache
def hints_of(kind: type) -> tuple[tuple[str, Any], ...]:
    """Return names and annotations of the fields of a dataclass or named tuple, in order."""
    hints = get_type_hints(kind)
    return tuple((name, hints[name]) for name in (getattr(kind, "_fields", None) or [f.name for f in fields(kind)]))


def optional(hint: Any) -> Any:
    """Return what an annotation allows beside None; None if it does not allow that."""
    if get_origin(hint) not in (Union, UnionType):
        return None
    (left,) = (inner for inner in get_args(hint) if inner is not NoneType)
    return left
