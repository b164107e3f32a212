"""From trials to tables: medians, spreads and ratios for each cell."""

from collections.abc import Iterable
from typing import Any

from pretouch.experiments.metrics import spread

_MEASURES = {
    "static": (
        "impact_speed_m_s", "detection_delay_s", "filtered_at_detection_n", "raw_at_detection_n", "peak_estimate_n",
        "true_peak_20ms_n", "true_peak_n",
    ),
    "avoidance": ("least_gap_m", "deviation_m", "least_speed_scale", "largest_slack_m_s", "travelled_m", "true_peak_n"),
    "dynamic": ("peak_estimate_n", "true_peak_20ms_n", "true_peak_n"),
}  # fmt: skip
_PLACE = ("trajectory", "side", "place")

Row = dict[str, Any]


def summarise(trials: list[Row]) -> dict[str, Any]:
    """Summaries of each experiment in a list of trials: its cells, and the ratios between profiles."""
    return {
        name: {"cells": _cells(name, rows), "ratios": _ratios(name, rows)}
        for name in _MEASURES
        if (rows := [t for t in trials if t["experiment"] == name])
    }


def _cells(name: str, rows: list[Row]) -> list[Row]:
    cells = []
    for key in _unique(_key(row) for row in rows):
        group = [row for row in rows if _key(row) == key]
        cell: Row = {**dict(key), "trials": len(group)}
        cell["contact_fraction"] = _fraction(_touched(row) for row in group)
        cell["false_detections"] = sum(row["false_detections"] for row in group)
        cell["held"] = sum(row["held"] for row in group)
        for measure in _MEASURES[name]:
            cell[measure] = spread([row[measure] for row in group if row[measure] is not None])
        if name == "static":
            cell["detected_fraction"] = _fraction(row["detection_delay_s"] is not None for row in group)
        if name == "dynamic":
            cell |= _pushes([contact for row in group for contact in row["contacts"]])
        cells.append(cell)
    return cells


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


def _ratios(name: str, rows: list[Row]) -> list[Row]:
    """Ratios blind / other profile of each measure, trial by trial with the same seed."""
    ratios = []
    for key in _unique(_key(row) for row in rows):
        place = dict(key)
        if place["profile"] == "blind":
            continue
        here = {row["seed"]: row for row in rows if _key(row) == key}
        blind = {
            row["seed"]: row
            for row in rows
            if row["profile"] == "blind" and all(row.get(p) == place.get(p) for p in _PLACE)
        }
        if not blind:
            continue
        ratio: Row = {**place, "of": f"blind/{place['profile']}"}
        for measure in _MEASURES[name]:
            pairs = [(blind[s][measure], here[s][measure]) for s in here if s in blind]
            ratio[measure] = spread([a / b for a, b in pairs if a is not None and b])
        ratios.append(ratio)
    return ratios


def _touched(row: Row) -> bool:
    return row["contact"] if "contact" in row else any(c["push_s"] > 0 for c in row["contacts"])


def _fraction(flags: Iterable[bool]) -> float:
    values = list(flags)
    return round(sum(values) / len(values), 4)


def _key(row: Row) -> tuple[tuple[str, str], ...]:
    return tuple((name, row[name]) for name in (*_PLACE, "profile", "restrictions") if row.get(name) is not None)


def _unique(keys: Iterable[Any]) -> list[Any]:
    return list(dict.fromkeys(keys))
