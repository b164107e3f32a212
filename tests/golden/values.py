"""The stored values: `python -m tests.golden.values` renews them.

They change only where a change of what the arm does is meant. The commit that renews them renews nothing else, and says
how far they moved and why: otherwise nobody can see what a change of the code did.
"""

from itertools import pairwise
from pathlib import Path

from tests.golden.fields import Values
from tests.golden.kept import summary, write
from tests.golden.streams import PROFILES, STREAMS, run

FILE = Path(__file__).with_name("values.npz")
STORED = (
    *(f"course/{name}" for name in PROFILES), "release/pretouch", "clamp", "pinch", "press", "blocked/hard",
    "blocked/floor", "silent/paper", "silent/pretouch", "faults/paper", "faults/pretouch", "touch", "outside-points",
)  # fmt: skip
"""Inputs of which values are stored."""
_EVERY = 40
"""Cycles from one that is stored to the next, besides those in which something begins or ends."""


def selected(steps: dict[int, Values]) -> dict[int, Values]:
    """Return some steps: each in which something begins or ends, and some between."""
    kept = {i for i in steps if i % _EVERY == _EVERY - 1}
    kept |= {i for (_, before), (i, now) in pairwise(steps.items()) if _what(before) != _what(now)}
    return {i: steps[i] for i in sorted(kept)}


def _what(values: Values) -> tuple[object, ...]:
    """What a step is about."""
    return (
        str(values["mode"]), str(values["qp.outcome"]), values["contact.force"] is None,
        values["localisation.link"].size > 0, bool(values["reaction_velocity"].any()),
    )  # fmt: skip


if __name__ == "__main__":
    chosen = {name: selected(run(STREAMS[name])) for name in STORED}
    write(FILE, chosen)
    print(f"{FILE.name}: {summary(chosen)}, {FILE.stat().st_size / 1000:.0f} kB. Commit it alone.")
