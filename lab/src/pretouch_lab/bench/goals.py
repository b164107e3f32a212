"""The goals set for `pretouch` before it was built, with what was reached; and the one table that says why."""

from dataclasses import dataclass
from textwrap import fill

from pretouch.text_table import TextTable, tabulated
from pretouch_lab.bench.contenders import BASE
from pretouch_lab.bench.scenes import scenario
from pretouch_lab.run import Row
from pretouch_lab.table import share_below, short

PEAK_ESTIMATE, TRUE_PEAK, SOONER, SHORTER = 5.0, 4.0, 2.0, 0.3
"""Times the peaks are to be smaller and the first contact sooner; part by which a turn is to be shorter."""

_SHOWN = ("blind", "paper", "pretouch")
"""Baselines of the closed loop, and detectors of the same names."""

_FRONT_NOTE = (
    "Simulated, medians. The board has 25 N/mm, and units see it; its force is the highest for 20 ms. Pushes: the"
    " contacts of the goals, of 15 N and more for 100 ms and more on the links 3 to 7 and the hand, whose torques"
    " exceed three standard deviations of free motion's, on the usual arm with 32 units; seen by these or not. All"
    " kinds: every contact of the benchmark, on all links, from 5 N and 30 ms on, of other arms and with impaired units"
    " too. Left out are contacts that came while a false alarm was being answered. Nobody near: in an empty room. A"
    " turn that did not end is >."
)
_WIDTH = 34
"""Of a column [characters]."""
_DEFINED = (
    "False alarms: the usual arm on circle and line at 0.3 m/s; bounds as Poisson's. Contacts: of 15 N and more for"
    " 100 ms and more on the links 3 to 7 and the hand, whose torques exceed three standard deviations of free"
    " motion's, on the usual arm and skin; delay from the true force passing 1 N, of what was detected; bounds of the"
    " median from its ranks (of fewer than six values their range), of shares Clopper and Pearson's. Towards the"
    " person: of all contacts, by the first motion of the touched point (redefined after the first published run), and"
    " of all reactions in the closed loop; an answer that moves nothing is none. Boards: 25 N/mm, seen by units, circle"
    " and line from both sides; median over the trials of the part of the reference's value in the same trial, where"
    " without contact the force is 0 N and the time endless. First contact: from the board being within 0.8 m of the"
    " end-effector. A turn: the second one. Forces beside the person: true 20 ms peak, 90 % of the trials below it."
)


@dataclass(frozen=True)
class Goal:
    """One goal."""

    text: str
    measured: str
    bounds: str
    """95 % bounds of what was measured."""
    reached: bool | None
    """None: nothing was measured."""

    @property
    def row(self) -> tuple[str, ...]:
        """Cells of the table."""
        verdict = {True: "reached", False: "not reached", None: "not measured"}
        return fill(self.text, _WIDTH), verdict[self.reached], fill(self.measured, _WIDTH), self.bounds


def goals(detection: Row, avoidance: Row) -> list[Goal]:
    """Return the goals, given what the JSON files of both benchmarks hold."""
    return [
        *_false_alarms(detection["rows"]),
        *(goal for seen in (True, False) for goal in _contacts(detection["rows"], seen)),
        _towards(detection["rows"], avoidance["rows"]),
        *_boards(avoidance["paired"]),
        *_person(avoidance),
    ]


def goal_table(detection: Row, avoidance: Row) -> TextTable:
    """Return the goals as a table."""
    abouts = [part["about"] for part in (detection, avoidance)]
    kinds = ", ".join(
        f"{about['bench']} {'quick' if about['quick'] else 'full'}, {about['seeds']} seeds" for about in abouts
    )
    return TextTable(
        "The goals of pretouch", ("goal", "", "measured", "95 % bounds"),
        tuple(one.row for one in goals(detection, avoidance)),
        f"{kinds}. Reached: the measured value reaches it, whatever its bounds. {_DEFINED}", 2,
    )  # fmt: skip


def find(rows: list[Row], baseline: str, name: str, seen: bool | None = None) -> Row | None:
    """Return a baseline's row of a scenario, None if there is none."""
    where = {"contender": baseline, "scenario": name} | ({} if seen is None else {"seen": seen})
    return next((row for row in rows if where.items() <= row.items()), None)


def _false_alarms(rows: list[Row]) -> list[Goal]:
    limit = scenario("contacts")["goal"]["false_alarms_per_hour"]
    near = {"goal": "all", "goal, nobody near": "nobody near", "goal, somebody standing": "somebody standing near",
            "goal, somebody passing": "somebody passing"}  # fmt: skip
    found = []
    for name, text in near.items():
        row, wanted = find(rows, BASE, f"free: {name}"), f"at most {limit:g} false alarm an hour at 0.3 m/s: {text}"
        found.append(Goal(wanted, "-", "-", None) if row is None else Goal(
            wanted, f"{short(row['false_alarms_per_hour'])}/h ({row['false_alarms']} in {row['hours']:.2g} h)",
            f"{short(row['low_per_hour'])} to {short(row['high_per_hour'])}/h", row["false_alarms_per_hour"] <= limit,
        ))  # fmt: skip
    return found


def _contacts(rows: list[Row], seen: bool) -> list[Goal]:
    word = "seen" if seen else "unseen"
    limit, row = scenario("contacts")["goal"][f"{word}_delay_s"], find(rows, BASE, "contacts: goal", seen)
    texts = f"median delay at most {1000 * limit:g} ms, {word} by the skin", f"none of those missed, {word}"
    if row is None or not row["contacts"]:
        return [Goal(text, "-", "-", None) for text in texts]
    missed, of = row["missed"], row["contacts"]
    none_detected = row["median_delay_s"] is None
    low, high = (0.0, 0.0) if none_detected else row["median_bounds_s"]
    return [
        Goal(texts[0], "none detected", "-", False) if none_detected else Goal(
            texts[0], f"{1000 * row['median_delay_s']:.0f} ms (95 % below {1000 * row['p95_delay_s']:.0f} ms)",
            f"{1000 * low:.0f} to {1000 * high:.0f} ms", row["median_delay_s"] <= limit,
        ),
        Goal(texts[1], f"{missed} of {of}", f"at most {100 * share_below(missed, of):.1f} %", missed == 0),
    ]  # fmt: skip


def _towards(streams: list[Row], played: list[Row]) -> Goal:
    both = [row for seen in (True, False) if (row := find(streams, BASE, "contacts: all", seen))]
    against, of = sum(row["towards"] for row in both), sum(row["contacts"] - row["missed"] for row in both)
    own = [row for row in played if row["contender"] == BASE]
    moved, reactions = sum(row["towards_person"] for row in own), sum(row["reactions"] for row in own)
    if not of + reactions:
        return Goal("never a reaction towards the person", "-", "-", None)
    return Goal(
        "never a reaction towards the person",
        f"{against} of {of} contacts detected, {moved} of {reactions} reactions in the closed loop",
        f"at most {100 * share_below(against + moved, of + reactions):.1f} %", against + moved == 0,
    )  # fmt: skip


def pair(paired: list[Row], family: str, reference: str, measure: str) -> Row | None:
    """Return how `BASE` compares with a reference, None if it was not measured."""
    where = {"family": family, "contender": BASE, "reference": reference, "measure": measure}
    return next((row for row in paired if all(row[key] == value for key, value in where.items())), None)


def _times(part: float | None) -> str:
    return "0" if part is None else "more than all" if part == 0.0 else f"{1 / part:.3g}"


def _boards(paired: list[Row]) -> list[Goal]:
    wanted = (
        ("peak_estimate_n", "blind", PEAK_ESTIMATE, "peak of the estimate at least {:g} times smaller than of blind"),
        ("true_peak_20ms_n", "blind", TRUE_PEAK, "true 20 ms peak at least {:g} times smaller than of blind"),
        ("first_contact_s", "paper-off", SOONER, "first contact at least {:g} times sooner than paper-off"),
    )
    found = []
    for measure, reference, times, text in wanted:
        row = pair(paired, "static", reference, measure)
        found.append(Goal(text.format(times), "-", "-", None) if row is None else Goal(
            text.format(times), f"{_times(row['part'])} times ({row['trials']} trials)",
            f"{_times(row['high'])} to {_times(row['low'])} times",
            row["part"] is not None and row["part"] <= 1 / times,
        ))  # fmt: skip
    return found


def _person(avoidance: Row) -> list[Goal]:
    force = {
        cell["contender"]: cell["true_peak_20ms_n"]["p90"] for cell in avoidance["families"]
        if cell["family"] == "person" and cell["true_peak_20ms_n"]
    }  # fmt: skip
    found = []
    for reference in ("paper-off", "paper"):
        text = f"turn beside a person at least {100 * SHORTER:g} % shorter than {reference}'s, forces not larger"
        row = pair(avoidance["paired"], "person", reference, "cycle_time_s")
        if row is None or BASE not in force or reference not in force:
            found.append(Goal(text, "-", "-", None))
            continue
        shorter = [f"{100 * (1 - part):.0f}" if part is not None else "endlessly less" for part in
                   (row["part"], row["high"], row["low"])]  # fmt: skip
        found.append(Goal(
            text, f"{shorter[0]} % ({row['trials']} trials); {force[BASE]:.1f} N and {force[reference]:.1f} N",
            f"{shorter[1]} to {shorter[2]} %",
            row["part"] is not None and row["part"] <= 1 - SHORTER and force[BASE] <= force[reference],
        ))  # fmt: skip
    return found


def front_table(detection: Row, avoidance: Row) -> TextTable:
    """Return the table of the first page: blind, paper and pretouch; what was not measured is a dash."""
    cells = {(cell["family"], cell["contender"]): cell for cell in avoidance["families"]}
    shown = [name for name in _SHOWN if ("static", name) in cells and ("person", name) in cells]

    def contacts(name: str, which: str = "goal") -> list[Row]:
        rows = (find(detection["rows"], name, f"contacts: {which}", seen) for seen in (True, False))
        return [row for row in rows if row is not None]

    def delay(name: str) -> str:
        delays = [row["median_delay_s"] for row in contacts(name)]
        return " / ".join("none" if delay is None else f"{1000 * delay:.0f} ms" for delay in delays) or "-"

    def missed(rows: list[Row]) -> str:
        return f"{sum(row['missed'] for row in rows)} of {sum(row['contacts'] for row in rows)}" if rows else "-"

    def force(name: str) -> str:
        cell = cells["static", name]
        return "keeps away" if cell["first_contact_s"] is None else f"{_value(cell, 'true_peak_20ms_n')} N"

    def turn(name: str) -> str:
        return f"{_value(cells['person', name], 'cycle_time_s')} s"

    def alarms(name: str, near: str) -> str:
        row = find(detection["rows"], name, f"free: goal, {near}")
        return "-" if row is None else short(row["false_alarms_per_hour"])

    columns = (
        ("", str),
        ("force on a board\nin its way", force),
        ("a push is noticed after\n(seen / not seen)", delay),
        ("pushes not\nnoticed", lambda name: missed(contacts(name))),
        ("contacts of all\nkinds not noticed", lambda name: missed(contacts(name, "all"))),
        ("a turn beside\na person", turn),
        ("false alarms an hour,\nnobody near", lambda name: alarms(name, "nobody near")),
        ("the same, somebody\nstands near", lambda name: alarms(name, "somebody standing")),
    )
    return tabulated(
        "What happens when it touches something",
        columns,
        shown,
        _FRONT_NOTE,
        1,
    )


def _value(cell: Row, key: str) -> str:
    spread = cell[key]
    if spread is None:
        return "-"
    return ">" if spread["median"] is None else f"{spread['median']:.1f}"
