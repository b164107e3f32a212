"""Types of options that several commands have, and the word that names an arm."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Any

import tyro
from tyro.constructors import PrimitiveConstructorSpec

from pretouch.arms import DEFAULT


def _listed(kind: Callable[[str], Any], metavar: str, noun: str) -> PrimitiveConstructorSpec[tuple[Any, ...]]:
    """Return how tyro reads values between commas."""

    def read(words: list[str]) -> tuple[Any, ...]:
        try:
            return tuple(kind(word.strip()) for word in words[0].split(",") if word.strip())
        except ValueError:
            raise ValueError(f"{words[0]!r}: give {noun}, separated by commas") from None

    return PrimitiveConstructorSpec(
        nargs=1,
        metavar=metavar,
        instance_from_str=read,
        is_instance=lambda value: isinstance(value, tuple),
        str_from_instance=lambda value: [",".join(map(str, value))],
    )


Words = Annotated[tuple[str, ...], _listed(str, "A,B,...", "words")]
"""Words between commas."""
Paths = Annotated[tuple[Path, ...], _listed(Path, "A,B,...", "folders")]
"""Folders between commas."""
Numbers = Annotated[tuple[float, ...], _listed(float, "X,Y,...", "numbers")]
"""Numbers between commas."""
Counts = Annotated[tuple[int, ...], _listed(int, "N,N,...", "whole numbers")]
"""Whole numbers between commas."""
OptionalFile = Annotated[Path | None, tyro.conf.arg(metavar="FILE")]
"""A file, or none."""
JsonFile = Annotated[
    Path | None,
    tyro.conf.arg(
        metavar="FILE", help="File for the numbers, or - for standard output: text then goes to standard error."
    ),
]
"""Where a command writes its numbers; see `writing.numbers_to`."""


def split_arm(words: Sequence[str]) -> tuple[str, Sequence[str]]:
    """Return the name of the arm that words begin with, the default one where they name none, and the other words."""
    if words and not words[0].startswith("-"):
        return words[0], words[1:]
    return DEFAULT, words
