"""A table of finished text, for the terminal, for documents and for pages."""

from dataclasses import dataclass


@dataclass(frozen=True)
class TextTable:
    """A table of finished text."""

    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str
    names: int = 2
    """How many columns at the left hold names, not numbers."""
