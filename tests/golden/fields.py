"""The fields of a `ControlStep` under names that stay when the code's own names change.

Whoever renames a field changes the right side of the table, and no stored file. A field that is not in the table is an
error, so that none is forgotten.
"""

from collections.abc import Iterator
from enum import Enum
from typing import get_args

import numpy as np

from pretouch.recording.ros import hints_of, is_record
from pretouch.types import ControlStep

FIELDS = {
    "stamp": "stamp",
    "mode": "mode",
    "reason": "reason",
    "event": "event",
    "detail": "detail",
    "latched": "latched",
    "q": "q",
    "q_commanded": "q_commanded",
    "ee.position": "ee_position",
    "ee.velocity": "ee_velocity",
    "path.position": "path_position",
    "path.phase": "path_phase",
    "desired_velocity": "desired_velocity",
    "speed_scale": "speed_scale",
    "ranges": "range_distance",
    "obstacles.unit": "obstacles.unit",
    "obstacles.point": "obstacles.point",
    "obstacles.ee_distance": "obstacles.ee_distance",
    "obstacles.body_point": "obstacles.body_point",
    "obstacles.link": "obstacles.link",
    "obstacles.direction": "obstacles.direction",
    "obstacles.distance": "obstacles.body_distance",
    "obstacles.closing_speed": "obstacles.closing_speed",
    "force": "force",
    "force.filtered": "filtered_force",
    "thresholds.upper": "thresholds.upper",
    "thresholds.lower": "thresholds.lower",
    "thresholds.mean": "thresholds.mean",
    "thresholds.sigma": "thresholds.sigma",
    "thresholds.obstacle_positive": "thresholds.obstacle_positive",
    "thresholds.obstacle_negative": "thresholds.obstacle_negative",
    "armed": "armed",
    "contact.force": "contact.force",
    "contact.axes": "contact.axes",
    "reaction_velocity": "reaction_velocity",
    "restricted": "restricted",
    "approach_limit": "approach_limit",
    "qp.qd": "qp.qd",
    "qp.slack": "qp.slack",
    "qp.multipliers": "qp.multipliers",
    "qp.outcome": "qp.outcome",
    "qp.status": "qp.status",
    "qp.violated": "qp.violated",
    "command": "command",
    "residual": "residual",
    "detector.evidence": "evidence",
    "detector.detectable": "detectable_n",
    "localisation.link": "touched.link",
    "localisation.point": "touched.point",
    "localisation.force": "touched.force",
    "localisation.sigma": "touched.sigma",
    "localisation.probability": "touched.probability",
}
"""Lasting name -> where this version keeps it: names of attributes, and the row of an array."""

Values = dict[str, np.ndarray | None]
"""The fields of one step by their lasting names, as arrays; None where the step has none."""


def values_of(step: ControlStep) -> Values:
    """Return the fields of a step."""
    return {name: _read(step, place) for name, place in FIELDS.items()}


def _read(value: object, place: str) -> np.ndarray | None:
    """Follow a place from a step to an array; enumerations become their values."""
    for part in place.split("."):
        if value is None:
            return None
        value = value[int(part)] if part.isdigit() else getattr(value, part)  # type: ignore[index]
    return None if value is None else np.array(value.value if isinstance(value, Enum) else value)


def forgotten(step: ControlStep, table: dict[str, str] = FIELDS) -> list[str]:
    """Return where a step keeps something that the table does not name."""
    named = set(table.values())
    missing = []
    for place in leaves(type(step)):
        rows = [name for name in named if name.rpartition(".")[0] == place]
        if place not in named and not (rows and len(rows) == len(_read(step, place))):
            missing.append(place)
    return missing


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
