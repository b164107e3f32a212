"""Every command that can be given, those below `skin`, `robot` and `bench` too."""

from collections.abc import Iterator
from typing import Any, get_args, get_type_hints

from pretouch.cli.registry import command_class, command_names


def _single(name: str, kind: Any) -> Iterator[tuple[str, Any]]:
    """Yield name and class of a command, or of each one that stands below it."""
    what = get_type_hints(kind, include_extras=True).get("what")
    below = [each for each in get_args(what) if hasattr(each, "__metadata__")]
    if not below:
        yield name, kind
    for each in below:
        called, *_ = (one.name for one in each.__metadata__)
        yield from _single(f"{name} {called}", each.__origin__)


COMMANDS: dict[str, Any] = dict(pair for name in command_names() for pair in _single(name, command_class(name)))
"""Class of each command, by its words."""
