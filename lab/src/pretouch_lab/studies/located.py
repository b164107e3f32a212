"""Whether cues of units tell better where a contact is: what two ways of detecting the same contacts say of places."""

from collections.abc import Callable

import numpy as np

from pretouch_lab.rows import Row, rounded

SIDES = ("without", "with")
"""The two ways in which each contact is detected."""
LEAST_N, LEAST_S = 15.0, 0.1
"""What a firm contact has at least: force [N] and duration [s]."""
FIRM, DETECTED = f"{LEAST_N:g} N, {1000 * LEAST_S:g} ms and more", "all detected"
"""Sets of contacts that are counted."""
NOTE = (
    "Each pair without, then with. Judged 100 ms after the force began to rise, or at its end if earlier. Detected:"
    " a place was said then. Right body: of all n; link 7, flange and hand are one. Median, 90 %: error of the place,"
    " of those detected both ways (both)."
)


def firm(contact: Row) -> bool:
    """Whether a contact is one of 15 N and more that lasts 100 ms and more."""
    return bool(contact["force_n"] >= LEAST_N and contact["duration_s"] >= LEAST_S)


def chosen(contacts: list[Row], name: str) -> list[Row]:
    """Return those of a set, by its name; each contact has what was said of it each way as `where`."""
    if name == FIRM:
        return [contact for contact in contacts if firm(contact)]
    return [contact for contact in contacts if any(contact["where"][side]["detected"] for side in SIDES)]


def compared(said: list[Row]) -> Row:
    """Count what was said of contacts each way; errors of those detected both ways, to compare the same ones."""
    both = [one for one in said if all(one[side]["detected"] for side in SIDES)]
    return {"contacts": len(said), "both": len(both)} | {
        side: {
            **{name: sum(one[side][name] for one in said) for name in ("detected", "right")},
            **{f"p{part}_m": _at([one[side]["error_m"] for one in both], part) for part in (50, 90)},
        }
        for side in SIDES
    }


def _at(values: list[float], percent: float) -> float | None:
    return rounded(float(np.percentile(values, percent)), 4) if values else None


def _pair(name: str) -> Callable[[Row], str]:
    return lambda found: " / ".join(str(found[side][name]) for side in SIDES)


def _errors(name: str) -> Callable[[Row], str]:
    def write(found: Row) -> str:
        return " / ".join("-" if (value := found[side][name]) is None else f"{100 * value:.1f}" for side in SIDES)

    return write


COLUMNS = (
    ("n", lambda found: str(found["contacts"])),
    ("detected", _pair("detected")),
    ("right\nbody", _pair("right")),
    ("both", lambda found: str(found["both"])),
    ("median\n[cm]", _errors("p50_m")),
    ("90 %\n[cm]", _errors("p90_m")),
)
"""Of a table of what `compared` returned."""
