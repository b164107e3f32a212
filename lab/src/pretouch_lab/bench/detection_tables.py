"""Tables of the detection benchmark, for the terminal and the document."""

from pretouch.text_table import TextTable
from pretouch_lab.bench.contenders import BASE, WITHOUT
from pretouch_lab.bench.detection_results import (
    ABLATED_CONTACTS,
    ABLATED_FREE,
    GOAL_CONTACTS,
    GOAL_FREE,
    HARD,
    HARD_CONTACTS,
)
from pretouch_lab.bench.scenes import scenario
from pretouch_lab.run import Row
from pretouch_lab.table import Column, short, table

_COLUMNS = (
    Column("detector", "detector"),
    Column("false\n[1/h]", "rate"),
    Column("seen\nmedian, 95 % [ms]", "seen"),
    Column("missed", "seen_missed"),
    Column("unseen\nmedian, 95 % [ms]", "unseen"),
    Column("missed", "unseen_missed"),
)
_TOWARDS, _REACHED = Column("towards\nperson", "towards"), Column("goals\nreached", "reached")


def tables(results: Row) -> list[TextTable]:
    """Return all tables of the `results` in the JSON file."""
    goal, rows = scenario("contacts")["goal"], results["rows"]
    names = list(dict.fromkeys(row["contender"] for row in rows))
    ablated = [name for name in names if name.startswith(WITHOUT)]
    whole = [name for name in names if name not in ablated]
    note = (
        f"Goals: at most {goal['false_alarms_per_hour']:g} false alarm an hour in free motion at"
        f" {goal['speed_m_s']:g} m/s, with or without a person near; a median delay of at most"
        f" {1000 * goal['seen_delay_s']:g} ms for contacts that the skin saw and {1000 * goal['unseen_delay_s']:g} ms"
        " for others; no missed contact. The contacts of the goals have at least"
        f" {goal['force_n']:g} N for {1000 * goal['duration_s']:g} ms, are on the links 3 to 7 or the hand, and cause"
        " torques above three standard deviations of free motion. Below a rate: 95 % bounds. Delay: from 1 N of true"
        " force, of detected contacts. Towards person: the touched point would start to move against the force, of"
        " detected contacts; the goal is none. Reached: by the measured value, whatever its bounds."
    )
    goal_columns, hard_columns = (*_COLUMNS, _TOWARDS, _REACHED), (*_COLUMNS, _TOWARDS)  # hard arms have own goals
    compared = [BASE, *ablated] if ablated else []
    every = [
        table("Contact detection: the goals", goal_columns, _judged(rows, whole, GOAL_FREE, GOAL_CONTACTS), note),
        _equal(results["curves"], whole),
        table(
            "Pretouch with one switch of its detection off at a time",
            goal_columns,
            _judged(rows, compared, ABLATED_FREE, ABLATED_CONTACTS),
            f"{note} Only a part of the streams: free motion of at most two arms for each path and bystander, and the"
            " contacts at the goal's speed; pretouch has the same part here. No arm reacts or has touch sensors in a"
            " stream, so freeze_while_reacting and touch are not in this table.",
        ),
        table(
            "Hard arms, with the errors of real ones",
            hard_columns,
            _judged(rows, whole, HARD, HARD_CONTACTS),
            f"{note} The world hard adds friction with memory, ripple of gears, ringing joints, drift, cables and"
            " delays. Its contacts cause torques above three standard deviations of the same arm's free motion.",
        ),
    ]
    return [each for each in every if each.rows]


def find(rows: list[Row], detector: str, name: str, visible: bool | None = None) -> Row | None:
    """Return a detector's row of a scenario, or None."""
    where = {"contender": detector, "scenario": name} | ({} if visible is None else {"seen": visible})
    return next((row for row in rows if where.items() <= row.items()), None)


def _texts(name: str, free: Row | None, visible: Row | None, hidden: Row | None) -> Row:
    """Return the text of each column for a detector."""
    return {
        "detector": name,
        "rate": _rate(free),
        "seen": _delay(visible),
        "seen_missed": _missed(visible),
        "unseen": _delay(hidden),
        "unseen_missed": _missed(hidden),
    }


def _judged(rows: list[Row], names: list[str], free: str, contacts: str) -> list[Row]:
    """Return a line of the table of goals for each detector, from scenarios of free motion and of contacts."""
    lines = []
    for name in names:
        alarms = find(rows, name, free)
        visible, hidden = (find(rows, name, contacts, flag) for flag in (True, False))
        both = [row for row in (visible, hidden) if row]
        detected = sum(row["contacts"] - row["missed"] for row in both)
        against = sum(row["towards"] for row in both)
        verdict = {"towards": f"{against}/{detected}", "reached": reached(alarms, visible, hidden)}
        lines.append(_texts(name, alarms, visible, hidden) | verdict)
    return lines


def reached(free: Row | None, visible: Row | None, hidden: Row | None) -> str:
    """Name the goals that a detector reached: rate of false alarms, delays of contacts seen or not, direction."""
    goal = scenario("contacts")["goal"]
    names = ["rate"] if free and free["false_alarms_per_hour"] <= goal["false_alarms_per_hour"] else []
    for name, row in (("seen", visible), ("unseen", hidden)):
        if row and row["contacts"] and not row["missed"] and row["median_delay_s"] <= goal[f"{name}_delay_s"]:
            names.append(name)
    both = [row for row in (visible, hidden) if row]
    if both and not any(row["towards"] for row in both):
        names.append("direction")
    return "\n".join(names) or "none"


def _equal(curves: list[Row], names: list[str]) -> TextTable:
    """Return a table of each detector at the first value of its sweep that reaches the goal of false alarms."""
    limit = scenario("contacts")["goal"]["false_alarms_per_hour"]
    quiet: dict[str, Row] = {}
    for point in curves:
        if point.get("false_alarms_per_hour", limit + 1.0) <= limit:
            quiet.setdefault(point["contender"], point)
    lines = []
    for name in names:
        point = quiet.get(name, {})
        at = f"{point['f_base_n']:g} N" if "f_base_n" in point else f"x {point['scale']:g}" if point else "none"
        lines.append(_texts(name, point or None, point.get("seen"), point.get("unseen")) | {"at": at})
    return table(
        "Detectors at equal rates of false alarms",
        (_COLUMNS[0], Column("at", "at"), *_COLUMNS[1:]),
        lines,
        f"Each detector at the smallest value of its swept parameter with at most {limit:g} false alarm an hour. The"
        " parameter is the base force F_b, or a factor on the evidence for an alarm. The value is chosen on the same"
        " streams, which favours all detectors alike.",
    )


def _rate(row: Row | None) -> str:
    if row is None:
        return "-"
    value, low, high = (short(row[key]) for key in ("false_alarms_per_hour", "low_per_hour", "high_per_hour"))
    return f"{value}\n{low}-{high}"


def _delay(row: Row | None) -> str:
    if row is None or not row["contacts"]:
        return "-"
    return ", ".join("-" if row[key] is None else f"{1000 * row[key]:.0f}" for key in ("median_delay_s", "p95_delay_s"))


def _missed(row: Row | None) -> str:
    if row is None or not row["contacts"]:
        return "-"
    return f"{row['missed']}/{row['contacts']}" + (f"\n{row['busy']} busy" if row["busy"] else "")
