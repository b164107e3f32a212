"""The detection benchmark as tables of finished text, for the terminal and the document."""

from collections.abc import Callable

from pretouch.text_table import TextTable, tabulated
from pretouch_lab.benchmarks.ablations import BASE, WITHOUT
from pretouch_lab.benchmarks.bounds import short
from pretouch_lab.benchmarks.detection.results import ABLATED_CONTACTS, ABLATED_FREE, GOAL_CONTACTS, GOAL_FREE
from pretouch_lab.benchmarks.goals import find
from pretouch_lab.benchmarks.scenario_files import scenario
from pretouch_lab.rows import Row
from pretouch_lab.tables import plain, share


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
        _hard(rows, whole),
        _hard_contacts(rows, whole),
        _boards(rows),
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
        columns,
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


def _groups(rows: list[Row], family: str, without: str) -> dict[tuple[str, bool | None], None]:
    """Scenarios of a family, each with whether the contacts were seen, in their order."""
    return dict.fromkeys(
        (row["scenario"], row["seen"])
        for row in rows
        if row["scenario"].startswith(family) and row["scenario"] != without
    )


def _false_alarms(rows: list[Row], names: list[str]) -> TextTable:
    return _rates(
        rows, names, "free: ", "False alarms per hour of free motion", "arms",
        "Below: 95 % bounds, Poisson's, wider by how much more the counts of the arms scatter than such counts do.",
    )  # fmt: skip


def _hard(rows: list[Row], names: list[str]) -> TextTable:
    goal = scenario("hard")["goal"]
    return _rates(
        rows, names, "hard: ", "False alarms per hour of arms as unkind as real ones", "motion",
        f"The world hard: friction that remembers, gears that shake, joints that ring, drift, cables, delays. Goals: at"
        f" most {goal['false_alarms_per_hour']:g} an hour of all, {goal['in_any_motion_per_hour']:g} in any motion;"
        " untold-load is no part of all, for each load that nobody announced may give one alarm. Below: 95 % bounds.",
    )  # fmt: skip


def _rates(rows: list[Row], names: list[str], family: str, title: str, what: str, note: str) -> TextTable:
    def hours(group: tuple[str, bool | None]) -> str:
        found = (find(rows, name, group[0]) for name in names)
        return f"{next((row['hours'] for row in found if row), 0.0):.2g}"

    def of(name: str) -> Callable[[tuple[str, bool | None]], str]:
        return lambda group: _rate(find(rows, name, group[0]))

    return tabulated(
        title,
        (
            (what, lambda group: group[0].removeprefix(family)),
            ("hours", hours),
            *((name, of(name)) for name in names),
        ),
        _groups(rows, family, ABLATED_FREE),
        note,
        1,
    )


def _contacts(rows: list[Row], names: list[str]) -> TextTable:
    return _delays(
        rows, names, "contacts: ", "Contacts: median and 95 % of the delay [ms], below what was missed", "contacts",
        "Rows of a speed, an arm or a kind of sensing hold the contacts of the goals; tap, push, clamp and all hold"
        " every contact. Contacts that came while a false alarm was being answered are left out of a detector's count.",
    )  # fmt: skip


def _hard_contacts(rows: list[Row], names: list[str]) -> TextTable:
    goal = scenario("hard")["goal"]
    return _delays(
        rows, names, "hard, touched: ",
        "Contacts on such arms: median and 95 % of the delay [ms], below what was missed", "motion",
        "15 to 30 N for 100 to 400 ms on the links 3 to 7 and the hand whose torques exceed three standard deviations"
        f" of that arm's free motion. Goals: {100 * goal['found']:g} % found, median {1000 * goal['seen_delay_s']:g} ms"
        f" seen and {1000 * goal['unseen_delay_s']:g} ms unseen.",
    )  # fmt: skip


def _delays(rows: list[Row], names: list[str], family: str, title: str, what: str, note: str) -> TextTable:
    def count(group: tuple[str, bool | None]) -> str:
        found = (find(rows, name, *group) for name in names)
        return str(next((row["contacts"] + row["busy"] for row in found if row), 0))

    def of(name: str) -> Callable[[tuple[str, bool | None]], str]:
        def write(group: tuple[str, bool | None]) -> str:
            row = find(rows, name, *group)
            if row is None:
                return "-"
            return f"{_ms(row['median_delay_s'])}, {_ms(row['p95_delay_s'])}\n{row['missed']}/{row['contacts']}"

        return write

    return tabulated(
        title,
        (
            (what, lambda group: group[0].removeprefix(family)),
            ("", lambda group: "seen" if group[1] else "unseen"),
            ("number", count),
            *((name, of(name)) for name in names),
        ),
        _groups(rows, family, ABLATED_CONTACTS),
        note,
        2,
    )


def _boards(rows: list[Row]) -> TextTable:
    def newtons(key: str) -> Callable[[Row], str]:
        return lambda row: "-" if row[key] is None else f"{row[key]:.1f}"

    columns = (
        ("board", lambda row: row["scenario"].removeprefix("board: ")),
        ("detector", plain("contender")),
        ("delay\n[ms]", lambda row: _ms(row["median_delay_s"])),
        ("missed", share("missed", "contacts")),
        ("peak\n[N]", newtons("peak_estimate_n")),
        ("true\n20 ms [N]", newtons("true_peak_20ms_n")),
        ("clamping\n[N]", newtons("clamping_n")),
        ("false", plain("false_alarms")),
    )
    chosen = [row for row in rows if row["scenario"].startswith("board")]
    return tabulated(
        "Boards in the closed loop: medians",
        columns,
        sorted(chosen, key=lambda row: str(row["scenario"])),
        "The arm runs into a board on circle and line, from both sides, restrictions off, and yields: paper is still"
        " slowed by what is near, pretouch by nothing, so this is its detector and its reaction alone. Peak: of the"
        " estimate. Clamping: mean true force half a second to a second after the touch, the board being where it was.",
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
