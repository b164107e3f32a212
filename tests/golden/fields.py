"""The fields of a `ControlStep` under names that stay when the code's own names change.

Whoever renames a field adds it to the table, and changes no stored file: a field that has no stored value fails.
"""

from collections.abc import Iterator
from enum import Enum
from typing import get_args

import numpy as np

from pretouch.recording.ros import hints_of, is_record
from pretouch.types import ControlStep

LASTING = {
    "ee_position": "ee.position", "ee_velocity": "ee.velocity", "path_position": "path.position",
    "path_phase": "path.phase", "range_distance": "ranges", "obstacles.body_distance": "obstacles.distance",
    "filtered_force": "force.filtered", "evidence": "detector.evidence", "detectable_n": "detector.detectable",
    "touched": "localisation",
}  # fmt: skip
"""Where this version keeps something -> its lasting name, if it is another: of a field, or of a record."""

Values = dict[str, np.ndarray | None]
"""The fields of one step by their lasting names, as arrays; None where the step has none."""


def leaves(kind: type, before: str = "") -> Iterator[str]:
    """All places in a dataclass and the dataclasses within it, those of optional ones included."""
    for name, kinds in hints_of(kind):
        inner = [hint for hint in get_args(kinds) or (kinds,) if is_record(hint)]
        place = f"{before}{name}"
        if inner:
            for hint in inner:
                yield from leaves(hint, f"{place}.")
        else:
            yield place


def lasting(place: str) -> str:
    """The lasting name of a place."""
    record, _, field = place.rpartition(".")
    return LASTING.get(place) or (f"{LASTING.get(record, record)}.{field}" if record else place)


FIELDS = {lasting(place): place for place in leaves(ControlStep)}
"""Lasting name -> where this version keeps it: names of attributes."""


def values_of(step: ControlStep) -> Values:
    """Return the fields of a step."""
    return {name: _read(step, place) for name, place in FIELDS.items()}


def _read(value: object, place: str) -> np.ndarray | None:
    """Follow a place from a step to an array; enumerations become their values."""
    for part in place.split("."):
        if value is None:
            return None
        value = getattr(value, part)
    return None if value is None else np.array(value.value if isinstance(value, Enum) else value)
