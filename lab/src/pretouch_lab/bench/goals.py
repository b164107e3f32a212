"""The goals of `pretouch`, set before it was built, and their results; and the table of the first page."""

from collections.abc import Callable, Iterator
from textwrap import fill

from pretouch.text_table import TextTable, tabulated
from pretouch_lab.bench.contenders import BASE
from pretouch_lab.bench.scenes import scenario
from pretouch_lab.run import Row
from pretouch_lab.table import share_below, short

PARTS = (
    ("peak_estimate_n", "blind", 5.0, "peak of the estimate at least {:g} times smaller than of blind"),
    ("true_peak_20ms_n", "blind", 4.0, "true 20 ms peak at least {:g} times smaller than of blind"),
    ("first_contact_s", "paper-off", 2.0, "first contact at least {:g} times sooner than paper-off"),
)
"""Goals at boards: a measure, its reference, the least factor by which it must be smaller, and the goal as text."""
SHORTER = 0.3
"""Least fraction by which a turn must be shorter."""
_FRONT_NOTE = (
    "Simulated, medians. The board has 25 N/mm and is in view of the units; its force is the highest 20 ms mean. Pushes"
    " have at least 15 N for 100 ms, are on the links 3 to 7 or the hand, and cause torques above three standard"
    " deviations of free motion; the arm is the nominal one with 32 units, which see the push or not. All kinds: every"
    " contact of the benchmark, on all links, from 5 N and 30 ms on, also of other arms and with impaired units."
    " Contacts during the reaction to a false alarm are left out. Nobody near: an empty room. > is a turn without an"
    " end."
)
_WIDTH = 34
"""Width of a column [characters]."""
_DEFINED = (
    "False alarms: the nominal arm on circle and line at 0.3 m/s, with Poisson bounds. Contacts have at least 15 N for"
    " 100 ms, are on the links 3 to 7 or the hand, and cause torques above three standard deviations of free motion, on"
    " the nominal arm and skin. Delays of detected contacts start at 1 N of true force. Bounds of the median are ranks,"
    " below six values the range; bounds of shares are those of Clopper and Pearson. Towards the person: all contacts,"
    " by the first motion of the touched point (redefined after the first published run), and all reactions in the"
    " closed loop; a reaction without motion does not count. Boards: 25 N/mm, in view of the units, circle and line"
    " from both sides; the median over the trials of the ratio to the reference in the same trial. Without contact the"
    " force is 0 N and the time is infinite. First contact: time after the board came within 0.8 m of the end-effector."
    " A turn: the second one. Forces beside the person: true 20 ms peak, 90th percentile of the trials."
)
Goal = tuple[str, bool | None, str, str]
"""A goal, True if it was reached, its measured value, and 95 % bounds; None: nothing was measured."""


def goals(detection: Row, avoidance: Row) -> list[Goal]:
    """Return the goals from the contents of the JSON files of both benchmarks."""
    return [
        *_false_alarms(detection["rows"]),
        *(goal for visible in (True, False) for goal in _contacts(detection["rows"], visible)),
        _towards(detection["rows"], avoidance["rows"]),
        *(_board(pair(avoidance["paired"], "static", part[1], part[0]), *part[2:]) for part in PARTS),
        *(_turn(avoidance, reference) for reference in ("paper-off", "paper")),
    ]


def goal_table(detection: Row, avoidance: Row) -> TextTable:
    """Return the goals as a table."""
    verdict = {True: "reached", False: "not reached", None: "not measured"}
    kinds = ", ".join(
        f"{about['bench']} {'quick' if about['quick'] else 'full'}, {about['seeds']} seeds"
        for about in (detection["about"], avoidance["about"])
    )
    rows = tuple(
        (fill(text, _WIDTH), verdict[reached], fill(measured, _WIDTH), bounds)
        for text, reached, measured, bounds in goals(detection, avoidance)
    )
    note = f"{kinds}. Reached: by the measured value, whatever its bounds. {_DEFINED}"
    return TextTable("The goals of pretouch", ("goal", "", "measured", "95 % bounds"), rows, note, 2)


def find(rows: list[Row], baseline: str, name: str, visible: bool | None = None) -> Row | None:
    """Return a baseline's row of a scenario, or None."""
    where = {"contender": baseline, "scenario": name} | ({} if visible is None else {"seen": visible})
    return next((row for row in rows if where.items() <= row.items()), None)


def pair(paired: list[Row], family: str, reference: str, measure: str) -> Row | None:
    """Return the ratio of `BASE` to a reference for a measure, or None."""
    where = {"family": family, "contender": BASE, "reference": reference, "measure": measure}
    return next((row for row in paired if where.items() <= row.items()), None)


def _unmeasured(text: str) -> Goal:
    return text, None, "-", "-"


def _false_alarms(rows: list[Row]) -> Iterator[Goal]:
    limit = scenario("contacts")["goal"]["false_alarms_per_hour"]
    for who in ("all", "nobody near", "somebody standing", "somebody passing"):
        text = f"at most {limit:g} false alarm an hour at 0.3 m/s: {who}"
        row = find(rows, BASE, "free: goal" + ("" if who == "all" else f", {who}"))
        if row is None:
            yield _unmeasured(text)
            continue
        rate, low, high = (short(row[key]) for key in ("false_alarms_per_hour", "low_per_hour", "high_per_hour"))
        measured = f"{rate}/h ({row['false_alarms']} in {row['hours']:.2g} h)"
        yield text, row["false_alarms_per_hour"] <= limit, measured, f"{low} to {high}/h"


def _contacts(rows: list[Row], visible: bool) -> list[Goal]:
    word = "seen" if visible else "unseen"
    limit, row = scenario("contacts")["goal"][f"{word}_delay_s"], find(rows, BASE, "contacts: goal", visible)
    delay, missed = f"median delay at most {1000 * limit:g} ms, {word} by the skin", f"none of those missed, {word}"
    if row is None or not row["contacts"]:
        return [_unmeasured(delay), _unmeasured(missed)]
    lost, of, median = row["missed"], row["contacts"], row["median_delay_s"]
    first: Goal = (delay, False, "none detected", "-")
    if median is not None:
        low, high = (1000 * bound for bound in row["median_bounds_s"])
        measured = f"{1000 * median:.0f} ms (95 % below {1000 * row['p95_delay_s']:.0f} ms)"
        first = (delay, median <= limit, measured, f"{low:.0f} to {high:.0f} ms")
    return [first, (missed, lost == 0, f"{lost} of {of}", _at_most(lost, of))]


def _at_most(events: int, of: int) -> str:
    return f"at most {100 * share_below(events, of):.1f} %"


def _towards(streams: list[Row], played: list[Row]) -> Goal:
    text, own = "never a reaction towards the person", [row for row in played if row["contender"] == BASE]
    both = [row for visible in (True, False) if (row := find(streams, BASE, "contacts: all", visible))]
    against, of = sum(row["towards"] for row in both), sum(row["contacts"] - row["missed"] for row in both)
    moved, reactions = sum(row["towards_person"] for row in own), sum(row["reactions"] for row in own)
    if not of + reactions:
        return _unmeasured(text)
    measured = f"{against} of {of} contacts detected, {moved} of {reactions} reactions in the closed loop"
    return text, against + moved == 0, measured, _at_most(against + moved, of + reactions)


def _board(row: Row | None, times: float, text: str) -> Goal:
    if row is None:
        return _unmeasured(text.format(times))
    part, low, high = (
        "0" if row[key] is None else f"{1 / row[key]:.3g}" if row[key] else "infinitely many"
        for key in ("part", "low", "high")
    )
    reached = row["part"] is not None and row["part"] <= 1 / times
    return text.format(times), reached, f"{part} times ({row['trials']} trials)", f"{high} to {low} times"


def _turn(avoidance: Row, reference: str) -> Goal:
    text = f"turn beside a person at least {100 * SHORTER:g} % shorter than {reference}'s, forces not larger"
    row = pair(avoidance["paired"], "person", reference, "cycle_time_s")
    force = {
        cell["contender"]: cell["true_peak_20ms_n"]["p90"]
        for cell in avoidance["families"]
        if cell["family"] == "person" and cell["true_peak_20ms_n"]
    }
    if row is None or not {BASE, reference} <= force.keys():
        return _unmeasured(text)
    shorter, high, low = (
        "infinitely less" if row[key] is None else f"{100 * (1 - row[key]):.0f}" for key in ("part", "high", "low")
    )
    reached = row["part"] is not None and row["part"] <= 1 - SHORTER and force[BASE] <= force[reference]
    measured = f"{shorter} % ({row['trials']} trials); {force[BASE]:.1f} N and {force[reference]:.1f} N"
    return text, reached, measured, f"{high} to {low} %"


def front_table(detection: Row, avoidance: Row) -> TextTable:
    """Return the table of the first page: blind, paper and pretouch; a dash stands for a missing measure."""
    cells = {(cell["family"], cell["contender"]): cell for cell in avoidance["families"]}
    names = [name for name in ("blind", "paper", BASE) if {("static", name), ("person", name)} <= cells.keys()]

    def contacts(name: str, which: str) -> list[Row]:
        rows = (find(detection["rows"], name, f"contacts: {which}", visible) for visible in (True, False))
        return [row for row in rows if row is not None]

    def delay(name: str) -> str:
        delays = [row["median_delay_s"] for row in contacts(name, "goal")]
        return " / ".join("none" if delay is None else f"{1000 * delay:.0f} ms" for delay in delays) or "-"

    def missed(which: str) -> Callable[[str], str]:
        def text(name: str) -> str:
            rows = contacts(name, which)
            return f"{sum(row['missed'] for row in rows)} of {sum(row['contacts'] for row in rows)}" if rows else "-"

        return text

    def force(name: str) -> str:
        cell = cells["static", name]
        return "keeps away" if cell["first_contact_s"] is None else f"{_median(cell['true_peak_20ms_n'])} N"

    def alarms(near: str) -> Callable[[str], str]:
        def text(name: str) -> str:
            row = find(detection["rows"], name, f"free: goal, {near}")
            return "-" if row is None else short(row["false_alarms_per_hour"])

        return text

    columns = (
        ("", str),
        ("force on a board\nin its way", force),
        ("a push is noticed after\n(seen / not seen)", delay),
        ("pushes not\nnoticed", missed("goal")),
        ("contacts of all\nkinds not noticed", missed("all")),
        ("a turn beside\na person", lambda name: f"{_median(cells['person', name]['cycle_time_s'])} s"),
        ("false alarms an hour,\nnobody near", alarms("nobody near")),
        ("the same, somebody\nstands near", alarms("somebody standing")),
    )
    return tabulated("What happens when it touches something", columns, names, _FRONT_NOTE, 1)


def _median(spread: Row | None) -> str:
    return "-" if spread is None else ">" if spread["median"] is None else f"{spread['median']:.1f}"
