"""Values that each control step makes anew."""

from dataclasses import dataclass
from typing import TypeVar, cast, dataclass_transform

Class = TypeVar("Class", bound=type)


@dataclass_transform(frozen_default=True)
def value(cls: Class) -> Class:
    """Make a class a dataclass with slots whose fields are set once, when it is made.

    The type checker holds everybody to that. Python itself does not: it would take three times as long to make one, and
    a control step makes some twenty, with a hundred fields.
    """
    return cast(Class, dataclass(slots=True)(cls))
