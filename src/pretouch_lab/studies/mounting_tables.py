"""What misplaced units change, as a summary and as tables."""

from pretouch.text_table import TextTable
from pretouch_lab.rows import Row, cells_of, grouped, rounded
from pretouch_lab.tables import number, with_spread

NAME = "mounting"
ROOM = "room"
"""In place of the board's side: an empty room."""
FORCES = ("filtered_at_detection_n", "raw_at_detection_n", "peak_estimate_n", "true_peak_20ms_n")

_COMPARED = ("impact_speed_m_s", *FORCES, "touch_s", "travelled_m")
_MEASURES = (
    *_COMPARED, *(f"{name}_ratio" for name in _COMPARED), "detection_delay_s", "missed_fraction", "least_gap_m",
    "obstacle_fraction", "speed_scale",
)  # fmt: skip
_TOTALS = ("felt", "false_detections", "held", "refused", "drawn")
_ERROR = ("position_mm", "orientation_deg", "told")
_KEYS = ("trajectory", "side", "profile", "restrictions", *_ERROR)


def summarise(rows: list[Row]) -> Row:
    """Cells of all boards together, of both empty rooms together, and of each place.

    Ratios are those to the trial with the same seed at the same place whose units sit where they are believed to.
    """
    exact = {_twin(row): row for row in rows if (row["position_mm"], row["orientation_deg"]) == (0, 0)}
    compared = [row | _ratios(row, exact.get(_twin(row))) for row in rows]
    together = [row | {"trajectory": "all", "side": ROOM if row["side"] == ROOM else "boards"} for row in compared]
    cells = []
    for group in (together, compared):
        found = cells_of(group, _KEYS, _MEASURES, ("contact",), _TOTALS)
        for cell, (_, trials) in zip(found, grouped(group, _KEYS), strict=True):
            cells.append(cell | {"largest_true_20ms_n": max((_true(row) for row in trials), default=None)})
    return {"cells": cells}


def _true(row: Row) -> float:
    return row["true_peak_20ms_n"] or 0.0


def _twin(row: Row) -> tuple[object, ...]:
    return tuple(row[name] for name in ("trajectory", "side", "profile", "restrictions", "seed"))


def _ratios(row: Row, exact: Row | None) -> Row:
    return {
        f"{name}_ratio": rounded(row[name] / exact[name], 4) if exact and exact[name] and row[name] else None
        for name in _COMPARED
    }


def tables(part: Row) -> list[TextTable]:
    """What misplaced units change of the forces, of motion where nothing is near, and of how near the arm comes."""
    pooled = [cell for cell in part["cells"] if cell["trajectory"] == "all"]
    boards = [cell for cell in pooled if cell["side"] == "boards"]
    touching = [cell for cell in boards if cell["restrictions"] not in ("hard", "slack")]
    avoiding = [cell for cell in boards if cell["restrictions"] in ("hard", "slack")]
    rooms = [cell for cell in pooled if cell["side"] == ROOM]
    made = ((touching, _forces), (rooms, _free), (avoiding, _near))
    return [table(cells, len({(c["profile"], c["restrictions"]) for c in cells}) > 1) for cells, table in made if cells]


def error(cell: Row) -> str:
    """Name a cell's misplacement."""
    parts = [f"{cell['position_mm']:g} mm"] if cell["position_mm"] else []
    parts += [f"{cell['orientation_deg']:g} deg"] if cell["orientation_deg"] else []
    return "\n".join(parts) or "none"


def _names(cell: Row, many: bool) -> tuple[str, str]:
    controller = f"\n{cell['profile']}\n{cell['restrictions']}" if many else ""
    return error(cell) + controller, "yes" if cell["told"] == "told" else ""


def _forces(cells: list[Row], many: bool) -> TextTable:
    shown = ("impact_speed_m_s", *FORCES)
    rows = tuple(
        (
            *_names(cell, many),
            *(_with_ratio(cell, name, 3 if name == "impact_speed_m_s" else 1) for name in shown),
            f"{cell['largest_true_20ms_n']:.0f}",
            _percent(cell["missed_fraction"]),
            f"{cell['felt']}/{cell['contact_fraction'] * cell['trials']:.0f}",
            str(cell["false_detections"]),
        )
        for cell in cells
    )
    return TextTable(
        "Misplaced units, static object: medians of all four places, and ratios to units in their place",
        ("error", "told", "impact\n[m/s]", "filtered\n[N]", "raw\n[N]", "peak\n[N]", "true\n20 ms", "most\n[N]",
         "missed\n[%]", "felt", "false"),
        rows,
        "Each unit sits this far from where the controller believes it to be, in a direction of its own, or is turned"
        " by this angle about an axis of its own; told: the skin file says so as standard deviations. Columns as in the"
        " static tables; below, the median of the ratios trial by trial with their 10-90 %. Most: largest of the true"
        " 20 ms peaks. Missed: of the readings that show the board, those that the controller took for the arm or the"
        " room. Felt: contacts detected, of all contacts. False: detections before the contact.",
    )  # fmt: skip


def _free(cells: list[Row], many: bool) -> TextTable:
    rows = tuple(
        (
            *_names(cell, many),
            with_spread(_times(cell["obstacle_fraction"], 100), 1),
            with_spread(cell["speed_scale"], 2),
            with_spread(_times(cell["travelled_m_ratio"], 100), 0),
            str(cell["false_detections"]),
            f"{100 * cell['refused'] / cell['drawn']:.0f}",
        )
        for cell in cells
    )
    return TextTable(
        "Misplaced units, an empty room: what the arm takes itself for, medians and 10-90 %",
        ("error", "told", "obstacle\n[%]", "speed", "way\n[%]", "false", "refused\n[%]"),
        rows,
        "Twenty seconds on the circle and on the line with nothing near. Obstacle: control steps in which the"
        " controller believes that there is one: it is the arm or the floor. Speed: mean factor of eqs. 3 and 4. Way:"
        " travelled, of that with units in their place. False: detections. Refused: of all poses that were drawn,"
        " those that lie inside the unit's own link and were drawn again.",
    )


def _near(cells: list[Row], many: bool) -> TextTable:
    rows = tuple(
        (
            *_names(cell, many),
            f"{cell['contact_fraction'] * cell['trials']:.0f}/{cell['trials']}",
            with_spread(cell["least_gap_m"], 3),
            _percent(cell["missed_fraction"]),
            str(cell["false_detections"]),
        )
        for cell in cells
    )
    return TextTable(
        "Misplaced units, restrictions that avoid the object: how near the arm comes, medians and 10-90 %",
        ("error", "told", "hit", "least\n[m]", "missed\n[%]", "false"),
        rows,
        "Hard restrictions unless others are named. Hit: trials with contact. Least: true distance of the arm's surface"
        " from the board, in 40 s or until a second after the contact.",
    )


def _with_ratio(cell: Row, name: str, digits: int) -> str:
    ratio = cell[f"{name}_ratio"]
    below = "" if ratio is None else f"\n{ratio['median']:.2f}\n{ratio['p10']:.1f}-{ratio['p90']:.1f}"
    return number(cell[name], digits) + below


def _times(value: Row | None, factor: float) -> Row | None:
    return value and {key: factor * number for key, number in value.items()}


def _percent(value: Row | None) -> str:
    return "-" if value is None else f"{100 * value['median']:.1f}\n{100 * value['p90']:.0f}"
