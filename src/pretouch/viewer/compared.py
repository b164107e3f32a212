"""What the page of a recording says of another profile on the same data."""

from collections.abc import Sequence
from html import escape

import numpy as np

from pretouch.recording.compare import Comparison, Found
from pretouch.types import FloatArray

_NAMED = 5
"""Contacts named in a sentence."""


def compared(comparison: Comparison, start: float) -> str:
    """Say which contacts were recorded, and which another profile finds on the same data."""
    mine, other = comparison.recorded, comparison.other
    said = (
        f"As recorded, {mine.name}: {_named(mine.contacts, start)}. On the same data {other.name} finds"
        f" {_named(other.contacts, start)}."
    )
    return f"<div id='compared' style='padding:0 12px 10px;font-size:12px;line-height:1.4'>{escape(said)}</div>"


def found_by_other(comparison: Comparison, stamps: FloatArray) -> dict[int, str]:
    """Say at which steps another profile finds contacts."""
    other = comparison.other
    at = np.searchsorted(stamps, [found.time - 1e-9 for found in other.contacts]).tolist()
    sizes = [np.linalg.norm(found.force) for found in other.contacts]
    return {i: f"Contact of {size:.1f} N found by {other.name}" for i, size in zip(at, sizes, strict=True)}


def _named(contacts: Sequence[Found], start: float) -> str:
    """Name contacts, in time since the start [s]."""
    if not contacts:
        return "no contact"
    shown = ", ".join(f"{np.linalg.norm(c.force):.1f} N at {c.time - start:.2f} s" for c in contacts[:_NAMED])
    more = len(contacts) - _NAMED
    return f"contacts of {shown}" + (f" and {more} more" if more > 0 else "")
