"""The detection benchmark as tables of finished text, for the terminal and the document."""

from pretouch.text_table import TextTable
from pretouch_lab.benchmarks.ablations import BASE, WITHOUT
from pretouch_lab.benchmarks.bounds import short
from pretouch_lab.benchmarks.detection.results import ABLATED_CONTACTS, ABLATED_FREE, GOAL_CONTACTS, GOAL_FREE
from pretouch_lab.benchmarks.scenario_files import scenario
from pretouch_lab.rows import Row


def detection_tables(results: Row) -> list[TextTable]:
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
        _false_alarms(rows, whole),
        _contacts(rows, whole),
        _boards(rows),
    ]
    return [table for table in made if table.rows]


def _names(rows: list[Row]) -> list[str]:
    return list(dict.fromkeys(row["contender"] for row in rows))


def _find(rows: list[Row], contender: str, name: str, seen: bool | None = None) -> Row | None:
    where = {"contender": contender, "scenario": name, "seen": seen}
    return next((row for row in rows if all(row[key] == value for key, value in where.items())), None)


def _goals(
    rows: list[Row], names: list[str], title: str, where: tuple[str, str] = (GOAL_FREE, GOAL_CONTACTS), note: str = ""
) -> TextTable:
    goal = scenario("contacts")["goal"]
    lines = []
    for name in names:
        free = _find(rows, name, where[0])
        seen, unseen = (_find(rows, name, where[1], of) for of in (True, False))
        lines.append(
            (name, _rate(free), *_delays(seen), *_delays(unseen), _towards(seen, unseen), reached(free, seen, unseen))
        )
    return TextTable(
        title,
        ("detector", "false\n[1/h]", "seen\nmedian, 95 % [ms]", "missed", "unseen\nmedian, 95 % [ms]", "missed",
         "towards\nperson", "goals\nreached"),
        tuple(lines),
        f"Goals: at most {goal['false_alarms_per_hour']:g} false alarm an hour in free motion at"
        f" {goal['speed_m_s']:g} m/s, with or without somebody near; median delay at most"
        f" {1000 * goal['seen_delay_s']:g} ms for contacts the skin saw and {1000 * goal['unseen_delay_s']:g} ms for"
        f" others, none missed, of those of {goal['force_n']:g} N and more lasting {1000 * goal['duration_s']:g} ms and"
        " more on the links 3 to 7 and the hand, whose torques exceed three standard deviations of free motion's. Below"
        " a rate: 95 % bounds. Delay: from the true force passing 1 N, of what was detected. Towards person: the"
        " touched point would begin to move against the force on it, of all detected: none is the goal. Reached: as"
        f" measured here, whatever the bounds.{note}",
        1,
    )  # fmt: skip


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
    lines = []
    for name in names:
        points = [point for point in curves if point["contender"] == name and "false_alarms_per_hour" in point]
        kept = next((point for point in points if point["false_alarms_per_hour"] <= limit), None)
        if kept is None:
            lines.append((name, "none", *("-",) * 5))
            continue
        value = f"{kept['f_base_n']:g} N" if "f_base_n" in kept else f"x {kept['scale']:g}"
        lines.append((name, value, _rate(kept), *_delays(kept["seen"]), *_delays(kept["unseen"])))
    return TextTable(
        "The same with as many false alarms as allowed",
        ("detector", "at", "false\n[1/h]", "seen\nmedian, 95 % [ms]", "missed", "unseen\nmedian, 95 % [ms]", "missed"),
        tuple(lines),
        f"Each detector at the smallest value of its swept parameter at which it has at most {limit:g} false alarm an"
        " hour: the base force F_b, or a factor on the evidence that makes an alarm. Chosen with hindsight on the same"
        " streams, so it flatters all of them alike.",
        1,
    )  # fmt: skip


def _false_alarms(rows: list[Row], names: list[str]) -> TextTable:
    groups = list(
        dict.fromkeys(
            row["scenario"] for row in rows if row["scenario"].startswith("free") and row["scenario"] != ABLATED_FREE
        )
    )
    lines = []
    for group in groups:
        found = [_find(rows, name, group) for name in names]
        hours = next((row["hours"] for row in found if row), 0.0)
        lines.append((group.removeprefix("free: "), f"{hours:.2g}", *(_rate(row) for row in found)))
    return TextTable(
        "False alarms per hour of free motion", ("arms", "hours", *names), tuple(lines),
        "Below: 95 % bounds, Poisson's, wider by how much more the counts of the arms scatter than such counts do.", 1,
    )  # fmt: skip


def _contacts(rows: list[Row], names: list[str]) -> TextTable:
    groups = dict.fromkeys(
        (row["scenario"], row["seen"])
        for row in rows
        if row["scenario"].startswith("contacts") and row["scenario"] != ABLATED_CONTACTS
    )
    lines = []
    for group, seen in groups:
        found = [_find(rows, name, group, seen) for name in names]
        count = next((row["contacts"] + row["busy"] for row in found if row), 0)
        cells = (
            "-" if row is None else f"{_ms(row['median_delay_s'])}, {_ms(row['p95_delay_s'])}\n"
            f"{row['missed']}/{row['contacts']}" for row in found
        )  # fmt: skip
        lines.append((group.removeprefix("contacts: "), "seen" if seen else "unseen", str(count), *cells))
    return TextTable(
        "Contacts: median and 95 % of the delay [ms], below what was missed",
        ("contacts", "", "number", *names), tuple(lines),
        "Rows of a speed, an arm or a kind of sensing hold the contacts of the goals; tap, push, clamp and all hold"
        " every contact. Contacts that came while a false alarm was being answered are left out of a detector's count.",
        2,
    )  # fmt: skip


def _boards(rows: list[Row]) -> TextTable:
    chosen = [row for row in rows if row["scenario"].startswith("board")]
    lines = [
        (
            row["scenario"].removeprefix("board: "), row["contender"], _ms(row["median_delay_s"]),
            f"{row['missed']}/{row['contacts']}", _n(row["peak_estimate_n"]), _n(row["true_peak_20ms_n"]),
            _n(row["clamping_n"]), str(row["false_alarms"]),
        )
        for row in sorted(chosen, key=lambda row: row["scenario"])
    ]  # fmt: skip
    return TextTable(
        "Boards in the closed loop: medians",
        ("board", "detector", "delay\n[ms]", "missed", "peak\n[N]", "true\n20 ms [N]", "clamping\n[N]", "false"),
        tuple(lines),
        "The arm runs into a board on circle and line, from both sides, restrictions off, and yields: paper is still"
        " slowed by what is near, pretouch by nothing, so this is its detector and its reaction alone. Peak: of the"
        " estimate. Clamping: mean true force half a second to a second after the touch, the board being where it was.",
    )  # fmt: skip


def _rate(row: Row | None) -> str:
    if row is None:
        return "-"
    value, low, high = (short(row[key]) for key in ("false_alarms_per_hour", "low_per_hour", "high_per_hour"))
    return f"{value}\n{low}-{high}"


def _delays(row: Row | None) -> tuple[str, str]:
    if row is None or not row["contacts"]:
        return "-", "-"
    busy = f"\n{row['busy']} busy" if row["busy"] else ""
    return f"{_ms(row['median_delay_s'])}, {_ms(row['p95_delay_s'])}", f"{row['missed']}/{row['contacts']}{busy}"


def _towards(*rows: Row | None) -> str:
    there = [row for row in rows if row]
    detected = sum(row["contacts"] - row["missed"] for row in there)
    return f"{sum(row['towards'] for row in there)}/{detected}"


def _ms(value: float | None) -> str:
    return "-" if value is None else f"{1000 * value:.0f}"


def _n(value: float | None) -> str:
    return "-" if value is None else f"{value:.1f}"
