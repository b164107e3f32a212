"""What misplaced units change, as a summary and as tables."""

from collections.abc import Callable

from pretouch.text_table import Column, TextTable, tabulated
from pretouch_lab.rows import Row, cells_of, grouped, rounded
from pretouch_lab.tables import hits, number, plain, ranged, with_spread

NAME = "mounting"
ROOM = "room"
"""In place of the board's side: an empty room."""
FORCES = ("filtered_at_detection_n", "raw_at_detection_n", "peak_estimate_n", "true_peak_20ms_n")

_COMPARED = ("impact_speed_m_s", *FORCES, "touch_s", "travelled_m")
_MEASURES = (
    *_COMPARED, *(f"{name}_ratio" for name in _COMPARED), "detection_delay_s", "missed_fraction", "least_gap_m",
    "obstacle_fraction", "speed_scale",
)  # fmt: skip
_TOTALS = ("detected", "false_detections", "held", "refused", "drawn")
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


def _names(many: bool) -> tuple[Column, ...]:
    def misplaced(cell: Row) -> str:
        return error(cell) + (f"\n{cell['profile']}\n{cell['restrictions']}" if many else "")

    return ("error", misplaced), ("stated", lambda cell: "yes" if cell["told"] == "told" else "")


def _forces(cells: list[Row], many: bool) -> TextTable:
    columns = (
        *_names(many),
        ("impact\n[m/s]", _with_ratio("impact_speed_m_s", 3)),
        *(
            (label, _with_ratio(name, 1))
            for name, label in zip(FORCES, ("filtered\n[N]", "raw\n[N]", "peak\n[N]", "true\n20 ms"), strict=True)
        ),
        ("most\n[N]", plain("largest_true_20ms_n", ".0f")),
        ("missed\n[%]", _missed),
        ("detected", lambda cell: f"{cell['detected']}/{cell['contact_fraction'] * cell['trials']:.0f}"),
        ("false", plain("false_detections")),
    )
    return tabulated(
        "Misplaced units, static object: medians of all four places, and ratios to units in their place",
        columns,
        cells,
        "Each unit sits this far from where the controller believes it to be, in a direction of its own, or is turned"
        " by this angle about an axis of its own; stated: the skin file says so as standard deviations. Columns as"
        " in the static tables; below, the median of the ratios trial by trial with their 10-90 %. Most: largest of the"
        " true 20 ms peaks. Missed: of the readings that show the board, those that the controller took for the arm or"
        " the room. Detected: of all contacts. False: detections before the contact.",
    )


def _free(cells: list[Row], many: bool) -> TextTable:
    columns = (
        *_names(many),
        ("obstacle\n[%]", lambda cell: with_spread(_times(cell["obstacle_fraction"], 100), 1)),
        ("speed", ranged("speed_scale", 2)),
        ("way\n[%]", lambda cell: with_spread(_times(cell["travelled_m_ratio"], 100), 0)),
        ("false", plain("false_detections")),
        ("refused\n[%]", lambda cell: f"{100 * cell['refused'] / cell['drawn']:.0f}"),
    )
    return tabulated(
        "Misplaced units, an empty room: what the arm takes itself for, medians and 10-90 %",
        columns,
        cells,
        "Twenty seconds on the circle and on the line with nothing near. Obstacle: control steps in which the"
        " controller believes that there is one: it is the arm or the floor. Speed: mean factor of eqs. 3 and 4. Way:"
        " travelled, of that with units in their place. False: detections. Refused: of all poses that were drawn,"
        " those that lie inside the unit's own link and were drawn again.",
    )


def _near(cells: list[Row], many: bool) -> TextTable:
    columns = (
        *_names(many),
        ("hit", hits),
        ("least\n[m]", ranged("least_gap_m", 3)),
        ("missed\n[%]", _missed),
        ("false", plain("false_detections")),
    )
    return tabulated(
        "Misplaced units, restrictions that avoid the object: how near the arm comes, medians and 10-90 %",
        columns,
        cells,
        "Hard restrictions unless others are named. Hit: trials with contact. Least: true distance of the arm's surface"
        " from the board, in 40 s or until a second after the contact.",
    )


def _with_ratio(name: str, digits: int) -> Callable[[Row], str]:
    def write(cell: Row) -> str:
        ratio = cell[f"{name}_ratio"]
        below = "" if ratio is None else f"\n{ratio['median']:.2f}\n{ratio['p10']:.1f}-{ratio['p90']:.1f}"
        return number(cell[name], digits) + below

    return write


def _times(value: Row | None, factor: float) -> Row | None:
    return value and {key: factor * number for key, number in value.items()}


def _missed(cell: Row) -> str:
    value = cell["missed_fraction"]
    return "-" if value is None else f"{100 * value['median']:.1f}\n{100 * value['p90']:.0f}"
