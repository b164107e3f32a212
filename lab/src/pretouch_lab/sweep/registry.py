"""All experiments that can be swept, by name."""

from pretouch.errors import ExperimentError
from pretouch_lab.sweep.measures import CLOSED_LOOP, Measure
from pretouch_lab.sweep.streams import ON_STREAMS

MEASURES: dict[str, Measure] = {m.name: m for m in (*CLOSED_LOOP, *ON_STREAMS)}
REMOVED = {"ishigami": "It only tested the sweep and is part of its tests now: try static --vary detect.f_base_n=7:20."}
"""Where former experiments went, by name."""


def measure(name: str) -> Measure:
    """Look an experiment up. Raises ExperimentError."""
    if name not in MEASURES:
        known, went = ", ".join(MEASURES), f" {REMOVED[name]}" if name in REMOVED else ""
        raise ExperimentError(f"The experiment {name!r} cannot be swept: choose from {known}.{went}")
    return MEASURES[name]
