"""The detection benchmark as tables of finished text, for the terminal and the document."""

from pretouch.text_table import TextTable, tabulated
from pretouch_lab.bench.contenders import BASE, WITHOUT
from pretouch_lab.bench.detection_results import ABLATED_CONTACTS, ABLATED_FREE, GOAL_CONTACTS, GOAL_FREE
from pretouch_lab.bench.goals import find
from pretouch_lab.bench.scenes import scenario
from pretouch_lab.run import Row
from pretouch_lab.table import short


def tables(results: Row) -> list[TextTable]:
    """Return all tables of what `results` of the JSON file says."""
    rows, curves = results["rows"], results["curves"]
    names = _names(rows)
    ablated = [name for name in names if name.startswith(WITHOUT)]
    whole = [name for name in names if name not in ablated]
    made = [
        _goals(rows, whole, "Contact detection: the goals"),
        _equal(curves, whole),
        _goals(
            [row for row in rows if row["scenario"] in (ABLATED_FREE, ABLATED_CONTACTS)],
            [BASE, *ablated] if ablated else [],
            "Each switch of pretouch's detection off alone",
            (ABLATED_FREE, ABLATED_CONTACTS),
            " On a part of the streams: free motion of at most two arms of each path and neighbour, and the contacts at"
            " the goal's speed; pretouch here has the same. Nothing reacts in them, so that freeze_while_reacting"
            " changes nothing.",
        ),
        _goals(
            rows,
            whole,
            "Arms as unkind as real ones",
            ("hard: all", "hard, touched: all"),
            " The world hard: friction that remembers, gears that shake, joints that ring, drift, cables, delays;"
            " contacts whose torques exceed three standard deviations of that arm's free motion.",
        ),
    ]
    return [table for table in made if table.rows]


def _names(rows: list[Row]) -> list[str]:
    return list(dict.fromkeys(row["contender"] for row in rows))


def _goals(
    rows: list[Row], names: list[str], title: str, where: tuple[str, str] = (GOAL_FREE, GOAL_CONTACTS), note: str = ""
) -> TextTable:
    goal = scenario("contacts")["goal"]
    found = [
        (name, find(rows, name, where[0]), *(find(rows, name, where[1], of) for of in (True, False))) for name in names
    ]
    columns = (
        ("detector", lambda row: row[0]),
        ("false\n[1/h]", lambda row: _rate(row[1])),
        ("seen\nmedian, 95 % [ms]", lambda row: _delay(row[2])),
        ("missed", lambda row: _missed(row[2])),
        ("unseen\nmedian, 95 % [ms]", lambda row: _delay(row[3])),
        ("missed", lambda row: _missed(row[3])),
        ("towards\nperson", lambda row: _towards(*row[2:])),
        ("goals\nreached", lambda row: reached(*row[1:])),
    )
    return tabulated(
        title,
        columns[:-1] if where[0].startswith("hard") else columns,  # hard arms have goals of their own
        found,
        f"Goals: at most {goal['false_alarms_per_hour']:g} false alarm an hour in free motion at"
        f" {goal['speed_m_s']:g} m/s, with or without somebody near; median delay at most"
        f" {1000 * goal['seen_delay_s']:g} ms for contacts the skin saw and {1000 * goal['unseen_delay_s']:g} ms for"
        f" others, none missed, of those of {goal['force_n']:g} N and more lasting {1000 * goal['duration_s']:g} ms and"
        " more on the links 3 to 7 and the hand, whose torques exceed three standard deviations of free motion's. Below"
        " a rate: 95 % bounds. Delay: from the true force passing 1 N, of what was detected. Towards person: the"
        " touched point would begin to move against the force on it, of all detected: none is the goal. Reached: as"
        f" measured here, whatever the bounds.{note}",
        1,
    )


def reached(free: Row | None, seen: Row | None, unseen: Row | None) -> str:
    """Name the goals that a detector reached: its rate of false alarms, delays of what was seen or not, direction."""
    goal = scenario("contacts")["goal"]
    found = ["rate"] if free and free["false_alarms_per_hour"] <= goal["false_alarms_per_hour"] else []
    for name, row in (("seen", seen), ("unseen", unseen)):
        if row and row["contacts"] and not row["missed"] and row["median_delay_s"] <= goal[f"{name}_delay_s"]:
            found.append(name)
    there = [row for row in (seen, unseen) if row]
    if there and not any(row["towards"] for row in there):
        found.append("direction")
    return "\n".join(found) or "none"


def _equal(curves: list[Row], names: list[str]) -> TextTable:
    """Each detector with the value of its sweep at which it keeps the goal of false alarms, and what it has then."""
    limit = scenario("contacts")["goal"]["false_alarms_per_hour"]
    kept: dict[str, Row] = {}
    for point in curves:
        if point.get("false_alarms_per_hour", limit + 1.0) <= limit:
            kept.setdefault(point["contender"], point)

    def at(name: str) -> str:
        point = kept.get(name, {})
        return f"{point['f_base_n']:g} N" if "f_base_n" in point else f"x {point['scale']:g}" if point else "none"

    columns = (
        ("detector", str),
        ("at", at),
        ("false\n[1/h]", lambda name: _rate(kept.get(name))),
        ("seen\nmedian, 95 % [ms]", lambda name: _delay(kept.get(name, {}).get("seen"))),
        ("missed", lambda name: _missed(kept.get(name, {}).get("seen"))),
        ("unseen\nmedian, 95 % [ms]", lambda name: _delay(kept.get(name, {}).get("unseen"))),
        ("missed", lambda name: _missed(kept.get(name, {}).get("unseen"))),
    )
    return tabulated(
        "The same with as many false alarms as allowed",
        columns,
        names,
        f"Each detector at the smallest value of its swept parameter at which it has at most {limit:g} false alarm an"
        " hour: the base force F_b, or a factor on the evidence that makes an alarm. Chosen with hindsight on the same"
        " streams, so it flatters all of them alike.",
        1,
    )


def _rate(row: Row | None) -> str:
    if row is None:
        return "-"
    value, low, high = (short(row[key]) for key in ("false_alarms_per_hour", "low_per_hour", "high_per_hour"))
    return f"{value}\n{low}-{high}"


def _delay(row: Row | None) -> str:
    return f"{_ms(row['median_delay_s'])}, {_ms(row['p95_delay_s'])}" if row and row["contacts"] else "-"


def _missed(row: Row | None) -> str:
    if row is None or not row["contacts"]:
        return "-"
    return f"{row['missed']}/{row['contacts']}" + (f"\n{row['busy']} busy" if row["busy"] else "")


def _towards(*rows: Row | None) -> str:
    there = [row for row in rows if row]
    detected = sum(row["contacts"] - row["missed"] for row in there)
    return f"{sum(row['towards'] for row in there)}/{detected}"


def _ms(value: float | None) -> str:
    return "-" if value is None else f"{1000 * value:.0f}"
