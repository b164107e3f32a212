"""What the shield benchmark came to: a row for each filter and commander, and tables of them."""

from collections.abc import Callable
from math import sqrt

from pretouch.text_table import TextTable, tabulated
from pretouch_lab.benchmarks.shield.measures import TOLERANCE
from pretouch_lab.benchmarks.shield.trial import CLOSE_M, SAME_M, SEEN_S, seen_in_time, speed_bound
from pretouch_lab.run import Row
from pretouch_lab.table import grouped, rounded
from pretouch_lab.tables import plain, share

_COUNTS = ("steps", "exceptions", "non_finite", "limit_violations")


def rows_of_cells(files: list[Row]) -> list[Row]:
    """Return a row for each filter and commander of what the tasks left."""
    return [
        {**key, **_counted(trials), **_touched(trials)}
        for key, group in grouped(files, ("filter", "commander"))
        if (trials := [trial for file in group for trial in file["trials"]])
    ]


def _counted(trials: list[Row]) -> Row:
    """Sums over trials."""
    raised = [trial["first_exception"] for trial in trials if trial["exceptions"]]
    return {
        **{name: sum(trial[name] for trial in trials) for name in _COUNTS},
        "first_exception": raised[0] if raised else "",
        "intervention": _rms(trials, "change_m2_s2", "changes"),
        "task_error": _rms(trials, "error_m2", "errors"),
    }


def _rms(parts: list[Row], squares: str, count: str) -> float | None:
    total = sum(part[count] for part in parts)
    return rounded(sqrt(sum(part[squares] for part in parts) / total), 4) if total else None


def _touched(trials: list[Row]) -> Row:
    """Touches of the trials, those that were seen in time apart from the others."""
    touches = [touch for trial in trials for touch in trial["touches"]]
    seen = [touch for touch in touches if seen_in_time(touch)]
    kinds = {
        "": seen,
        "close_": [touch for touch in seen if touch["mistaken_m"] <= CLOSE_M],
        "unseen_": [touch for touch in touches if not seen_in_time(touch)],
    }
    row: Row = {"trials": len(trials), "bound_m_s": rounded(speed_bound(CLOSE_M), 4)}
    for prefix, found in kinds.items():
        speeds = [touch["speed_m_s"] for touch in found]
        row |= {f"{prefix}touches": len(found), f"{prefix}touch_speed_m_s": max(speeds, default=None)}
    excess = [touch["speed_m_s"] - speed_bound(touch["mistaken_m"]) for touch in seen]
    row |= {"over_bound": sum(each > 0.0 for each in excess), "excess_m_s": _largest(excess)}
    least = [trial["least_distance_m"] for trial in trials]
    return row | {"least_distance_m": min(least, default=None)}


def _largest(values: list[float]) -> float | None:
    return rounded(max(values), 4) if values else None


def guarantees() -> str:
    """Say what is counted, and how."""
    return (
        "Filters between the commander and the arm: `pretouch` and `paper` as they are; `none`: `pretouch` without"
        " restriction, the limits of the joints alone. Commanders: `at-person`, which knows where the person is and"
        " drives a part of the arm at them, at up to 1.5 m/s; `tracking`, an ordinary one.\n\n"
        "Trials are those of"
        " `bench avoidance` in which somebody moves, with all errors and latencies. A limit is broken where a command"
        f" passes position, velocity or acceleration by more than {TOLERANCE:g}. The speed at a touch is that of the"
        " arm's touching point towards the person. A touch was seen in time if in each step of the"
        f" {SEEN_S:g} s before it the controller knew a point whose closest point on the body lay within"
        f" {100 * SAME_M:.0f} cm of the touching place. If that was thought up to e farther than it was, the braking"
        " curve leaves the touch speed of 0.05 m/s and what it allows at e in addition, and the drives are off by up to"
        f" 0.03 m/s when it begins to bind: {speed_bound(0.01):.2f} m/s in all where e is 1 cm or less,"
        f" {speed_bound(CLOSE_M):.2f} m/s at 2 cm, {speed_bound(0.05):.2f} m/s at 5 cm: the bound of each touch."
        " Where nothing was seen no filter can know: a column of its own."
    )


def tables_of(rows: list[Row]) -> list[TextTable]:
    """Return the tables of the rows."""
    limits = tabulated("What holds whoever commands", _HELD, rows, "least: least true distance in the trials.")
    cost = tabulated(
        "What it costs", _COST, rows,
        "change: rms of how far the command at the end-effector is from what was asked, while that is sound. off: rms"
        " distance of the hand from where the ordinary commander wants it.",
    )  # fmt: skip
    return [limits, cost]


def _number(key: str, digits: int, factor: float = 1.0) -> Callable[[Row], str]:
    return lambda row: (
        "-" if row[key] is None else f"{round(factor * row[key], digits) + 0.0:.{digits}f}"
    )  # no minus before a zero


_NAMES = (("filter", plain("filter")), ("commander", plain("commander")))
_HELD = (
    *_NAMES,
    ("steps", plain("steps")),
    ("exceptions", plain("exceptions")),
    ("no\nnumber", plain("non_finite")),
    ("limits\nbroken", plain("limit_violations")),
    ("trials", plain("trials")),
    ("seen: over\nthe bound", share("over_bound", "touches")),
    ("by\n[m/s]", _number("excess_m_s", 2)),
    ("fastest\n[m/s]", _number("touch_speed_m_s", 2)),
    ("seen to\n2 cm", plain("close_touches")),
    ("fastest\n[m/s]", _number("close_touch_speed_m_s", 2)),
    ("unseen", plain("unseen_touches")),
    ("fastest\n[m/s]", _number("unseen_touch_speed_m_s", 2)),
    ("least\n[mm]", _number("least_distance_m", 0, 1e3)),
)
_COST = (
    *_NAMES,
    ("off\n[mm]", _number("task_error", 0, 1e3)),
    ("change\n[m/s]", _number("intervention", 2)),
)
