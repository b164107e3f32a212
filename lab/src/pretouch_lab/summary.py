"""From trials to tables: medians, spreads and ratios for each cell."""

from collections.abc import Iterable
from typing import Any

from pretouch_lab.rows import Row, spread

_STATIC = (
    "impact_speed_m_s", "detection_delay_s", "filtered_at_detection_n", "raw_at_detection_n", "peak_estimate_n",
    "true_peak_20ms_n", "true_peak_n",
)  # fmt: skip
_AVOIDANCE = (
    "least_gap_m", "deviation_m", "least_speed_scale", "largest_slack_m_s", "travelled_m", "true_peak_n",
)  # fmt: skip
_DYNAMIC = ("peak_estimate_n", "true_peak_20ms_n", "true_peak_n")
_PLACE = ("trajectory", "side", "place", "stiffness_n_per_m")


def static_summary(rows: list[Row]) -> Row:
    """Cells and ratios of the static experiment, for each place of the object and for all places together."""
    together = ("stiffness_n_per_m",)
    return {
        "cells": [_static_cell(*item) for item in _groups(rows, _PLACE)],
        "ratios": _ratios(rows, _PLACE, _STATIC),
        "pooled_cells": [_static_cell(*item) for item in _groups(rows, together)],
        "pooled_ratios": _ratios(rows, together, _STATIC),
    }


def _static_cell(key: Row, group: list[Row]) -> Row:
    cell = _cell(key, group, (*_STATIC, "least_sensed_m"))
    cell["detected_fraction"] = _fraction(row["detection_delay_s"] is not None for row in group)
    return cell


def avoidance_summary(rows: list[Row]) -> Row:
    """Cells and ratios of the avoidance experiment."""
    return {
        "cells": [_cell(*item, _AVOIDANCE) for item in _groups(rows, _PLACE)],
        "ratios": _ratios(rows, _PLACE, ("deviation_m", "travelled_m")),
    }


def dynamic_summary(rows: list[Row]) -> Row:
    """Cells and ratios of the dynamic experiment, the pushes of all trials together."""
    cells = []
    for key, group in _groups(rows, _PLACE):
        cells.append(_cell(key, group, _DYNAMIC) | _pushes([contact for row in group for contact in row["contacts"]]))
    return {"cells": cells, "ratios": _ratios(rows, _PLACE, _DYNAMIC)}


def _cell(key: Row, group: list[Row], measures: tuple[str, ...]) -> Row:
    return {
        **key,
        "trials": len(group),
        "contact_fraction": _fraction(_touched(row) for row in group),
        "false_detections": sum(row["false_detections"] for row in group),
        "held": sum(row["held"] for row in group),
        **{measure: spread([row[measure] for row in group if row[measure] is not None]) for measure in measures},
    }


def _pushes(contacts: list[Row]) -> Row:
    return {
        "pushes": len(contacts),
        "detected": sum(c["detected"] for c in contacts),
        "delay_s": spread([c["delay_s"] for c in contacts if c["delay_s"] is not None]),
        "direction_error_deg": spread(
            [c["direction_error_deg"] for c in contacts if c["direction_error_deg"] is not None]
        ),
        "reactions_towards_person": sum(c["reaction_towards_person"] for c in contacts),
    }


def _ratios(rows: list[Row], place: tuple[str, ...], measures: tuple[str, ...]) -> list[Row]:
    """Ratios blind / other profile of each measure, trial by trial with the same seed at the same place."""
    blind = {_twin(row): row for row in rows if row["profile"] == "blind"}
    ratios = []
    for key, group in _groups(rows, place):
        pairs = [(blind[_twin(row)], row) for row in group if _twin(row) in blind]
        if key["profile"] == "blind" or not pairs:
            continue
        ratio: Row = {**key, "of": f"blind/{key['profile']}"}
        for measure in measures:
            values = [(without[measure], row[measure]) for without, row in pairs]
            ratio[measure] = spread([a / b for a, b in values if a is not None and b])
        ratios.append(ratio)
    return ratios


def _twin(row: Row) -> tuple[Any, ...]:
    return tuple(row.get(name) for name in (*_PLACE, "seed"))


def _touched(row: Row) -> bool:
    return row["contact"] if "contact" in row else any(c["push_s"] > 0 for c in row["contacts"])


def _fraction(flags: Iterable[bool]) -> float:
    values = list(flags)
    return round(sum(values) / len(values), 4)


def _groups(rows: list[Row], place: tuple[str, ...]) -> list[tuple[Row, list[Row]]]:
    """Rows of the same place and controller together, each group with what they share."""
    groups: dict[tuple[Any, ...], tuple[Row, list[Row]]] = {}
    for row in rows:
        key = {name: row[name] for name in (*place, "profile", "restrictions") if row.get(name) is not None}
        groups.setdefault(tuple(key.items()), (key, []))[1].append(row)
    return list(groups.values())
