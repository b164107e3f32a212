"""Checks of parameters: what a field may hold stands in its type."""

import math
import sys
from dataclasses import dataclass, fields, is_dataclass
from functools import cache, cached_property
from numbers import Integral, Real
from types import UnionType
from typing import Annotated, Any, ClassVar, Literal, NamedTuple, Union, get_args, get_origin, get_type_hints

from pretouch.errors import ParameterError

_SMALLEST, _LARGEST = 1e-6, 1e6


def is_number(value: object) -> bool:
    """Return whether a value is a finite number that a float can hold: a text may have whole numbers of any size."""
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= sys.float_info.max


@dataclass(frozen=True)
class Check:
    """Allowed range of a finite number, ends included unless they are open."""

    low: float = -math.inf
    high: float = math.inf
    open_low: bool = False
    open_high: bool = False

    def problem(self, value: float) -> str | None:
        """Say what is wrong with the value, or None."""
        if not abs(value) <= sys.float_info.max:
            return "must be finite"
        if value != 0 and not _SMALLEST <= abs(value) <= _LARGEST:
            return f"must be between {_SMALLEST:g} and {_LARGEST:g} in size; check its unit"
        if value < self.low or (self.open_low and value == self.low):
            return f"must be {'greater than' if self.open_low else 'at least'} {self.low:g}"
        if value > self.high or (self.open_high and value == self.high):
            return f"must be {'less than' if self.open_high else 'at most'} {self.high:g}"
        return None


Negative = Annotated[float, Check(high=0.0, open_high=True)]
Positive = Annotated[float, Check(low=0.0, open_low=True)]
NonNegative = Annotated[float, Check(low=0.0)]
Fraction = Annotated[float, Check(low=0.0, high=1.0)]
Count = Annotated[int, Check(low=0)]
PositiveCount = Annotated[int, Check(low=1)]


class _NumbersOf:
    """Makes the record of a parameter set's plain numbers at its first use."""

    def __get__(self, _instance: object, owner: type) -> Any:
        return _numbers_of(owner)


class Checked:
    """Base of parameter sets: checks every field at construction."""

    Numbers: ClassVar[Any] = _NumbersOf()
    """The set in compiled code: a `NamedTuple` of its numbers, without optional values, texts and other sets.

    A compiled function annotates the set itself: the fields have the same names."""

    def __post_init__(self) -> None:
        kind: Any = type(self)
        for name, hint in hints_of(kind).items():
            _check_field(kind.__name__, name, hint, getattr(self, name))

    @cached_property
    def numbers(self) -> Any:
        """The numbers of this set, for a compiled function that Python calls."""
        kinds = get_type_hints(self.Numbers)
        return self.Numbers(*(kind(getattr(self, name)) for name, kind in kinds.items()))


@cache
def _numbers_of(kind: type) -> Any:
    hints = hints_of(kind, False).items()
    plain = [(name, number) for name, number in hints if number in (float, int, bool)]
    for base in kind.__mro__[1:]:  # a part is compiled as the set that it adds no number to
        if issubclass(base, Checked) and is_dataclass(base) and [*base.Numbers._fields] == [name for name, _ in plain]:
            return base.Numbers
    make: Any = NamedTuple
    record = make("Numbers", plain)
    # Numba's cache looks the class up by its name
    record.__module__, record.__qualname__ = kind.__module__, f"{kind.__qualname__}.Numbers"
    return record


@cache
def hints_of(kind: Any, checks: bool = True) -> dict[str, Any]:
    """Types of the fields of a parameter set by their names, with the checks that stand in them or without."""
    hints = get_type_hints(kind, include_extras=checks)
    return {item.name: hints[item.name] for item in fields(kind)}


def _check_field(owner: str, name: str, hint: object, value: object) -> None:
    if get_origin(hint) in (Union, UnionType) and value is not None:
        for inner in get_args(hint):
            _check_field(owner, name, inner, value)
    if get_origin(hint) is Literal and value not in get_args(hint):
        raise ParameterError(f"{owner}.{name} is {value!r}: choose one of {', '.join(map(str, get_args(hint)))}.")
    if hint is bool and not isinstance(value, bool):
        raise ParameterError(f"{owner}.{name} is {value!r}: it must be true or false.")
    whole = getattr(hint, "__origin__", None) is int
    for check in getattr(hint, "__metadata__", ()):
        if whole and not isinstance(value, Integral):
            raise ParameterError(f"{owner}.{name} is {value}: it must be a whole number.")
        number = isinstance(value, Real) and not isinstance(value, bool)
        problem = check.problem(value) if number else "must be a number"
        if problem:
            raise ParameterError(f"{owner}.{name} is {value}: it {problem}.")
