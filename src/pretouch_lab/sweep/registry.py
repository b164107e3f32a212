"""All experiments that can be swept, by name."""

from pretouch.errors import ExperimentError
from pretouch_lab.sweep.measures import CLOSED_LOOP, Measure
from pretouch_lab.sweep.streams import ON_STREAMS
from pretouch_lab.sweep.trying import ISHIGAMI

MEASURES: dict[str, Measure] = {m.name: m for m in (*CLOSED_LOOP, *ON_STREAMS, ISHIGAMI)}


def measure(name: str) -> Measure:
    """Look an experiment up. Raises ExperimentError."""
    if name not in MEASURES:
        raise ExperimentError(f"The experiment {name!r} cannot be swept: choose from {', '.join(MEASURES)}.")
    return MEASURES[name]
