"""The approaches of a hand as a summary and as tables: eq. 11 against what a skin gives, and where it leaks."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from pretouch.contact.moving_thresholds import thresholds_of
from pretouch.contact.thresholds import obstacle_force
from pretouch.profiles import profile
from pretouch.sim.scene import HandSpec
from pretouch.text_table import TextTable, tabulated
from pretouch_lab.paper.claims.approach import DIRECTIONS
from pretouch_lab.rows import Row, rounded, spread
from pretouch_lab.tables import median, number, share

PROFILE = "paper"
DISTANCES_M = (0.8, 0.6, 0.4, 0.3, 0.2, 0.15, 0.1)
"""True distances of the hand's centre from the end-effector's origin at which the thresholds are read off [m]."""
BOUNDS = tuple((bound, axis) for bound in ("upper", "lower") for axis in range(3))
"""The six thresholds: an object on the negative side of an axis lowers the upper one, on the positive the lower."""


def expected(direction: str) -> tuple[str, int]:
    """Threshold that an object purely on this side should lower: upper or lower, and of which axis."""
    shown = DIRECTIONS[direction]
    return ("lower" if shown.startswith("+") else "upper"), "xyz".index(shown[1])


def equation_11(true_distance: float) -> float:
    """F_obs [N] of a fist with its centre at a distance [m], if the point of it that is nearest were sensed."""
    p = thresholds_of(profile(PROFILE).detect)
    return float(obstacle_force(np.array(true_distance - HandSpec.radius), p.f_d_n, p.d_max_m, p.d_min_m))


def summarise(rows: list[Row]) -> Row:
    """Cells: the band at each distance, and which bounds were lowered at the nearest point."""
    groups: dict[str, list[Row]] = {}
    for row in rows:
        groups.setdefault(row["from"], []).append(row)
    return {"cells": [_cell(direction, groups[direction]) for direction in DIRECTIONS if direction in groups]}


def _cell(direction: str, group: list[Row]) -> Row:
    nearest = [row["nearest"] for row in group]
    return {
        "from": direction,
        "profile": group[0]["profile"],
        "trials": len(group),
        "contacts": sum(row["contact"] for row in group),
        "seen": sum(row["seen"] for row in group),
        "false_detections": sum(row["false_detections"] for row in group),
        "seen_from_m": spread([row["seen_from_m"] for row in group if row["seen_from_m"] is not None]),
        "nearest_m": spread([place["true_m"] for place in nearest]),
        "expected": _name(*expected(direction)),
        "lowered_n": _each_bound(nearest, "lowered_n"),
        "trials_lowered": {
            _name(b, axis): sum(place[f"{b}_lowered_n"][axis] > 0 for place in nearest) for b, axis in BOUNDS
        },
        "curve": [
            _place(d, [row["at"][i] for row in group if row["at"][i] is not None]) for i, d in enumerate(DISTANCES_M)
        ],
    }


def _name(bound: str, axis: int) -> str:
    return f"{bound}_{'xyz'[axis]}"


def _each_bound(places: list[Row], what: str) -> Row:
    """Spread over trials of one number of each of the six thresholds."""
    return {_name(b, axis): spread([place[f"{b}_{what}"][axis] for place in places]) for b, axis in BOUNDS}


def _place(distance: float, places: list[Row]) -> Row:
    return {
        "distance_m": distance,
        "equation_11_n": rounded(equation_11(distance)),
        "trials": len(places),
        "seen": sum(place["sensed_m"] is not None for place in places),
        "sensed_m": spread([place["sensed_m"] for place in places if place["sensed_m"] is not None]),
        "width_n": _each_bound(places, "n"),
        "lowered_n": _each_bound(places, "lowered_n"),
    }


def tables(part: Row) -> list[TextTable]:
    """The expected threshold against distance, then all six at the nearest point."""
    return [_against_distance(part), _leakage(part)]


def _against_distance(part: Row) -> TextTable:
    def at(i: int) -> Callable[[Row], str]:
        return lambda cell: number(cell["curve"][i]["lowered_n"][cell["expected"]], 2)

    columns = (
        ("from", lambda cell: DIRECTIONS[cell["from"]]),
        ("seen", share("seen")),
        ("seen\nfrom [m]", median("seen_from_m", 2)),
        *((f"{d:g} m", at(i)) for i, d in enumerate(DISTANCES_M)),
    )
    made = tabulated(
        "A hand comes to a standing arm: how far the threshold on its side gives way [N]",
        columns,
        part["cells"],
        "Medians of F_obs on the hand's side, by the distance of its centre from the end-effector's origin."
        " Eq. 11: if the nearest point of the fist were sensed. Seen: trials in which any unit saw the"
        " hand, and the greatest distance at which one did. Dash: the hand did not come through there, the arm or the"
        " floor is in the way.",
    )
    exact = ("eq. 11", "", "", *(f"{equation_11(d):.2f}" for d in DISTANCES_M))
    return replace(made, rows=(exact, *made.rows))


def _leakage(part: Row) -> TextTable:
    def of(name: str) -> Callable[[Row], str]:
        return lambda cell: (
            number(cell["lowered_n"][name], 1)
            + ("*" if name == cell["expected"] else "")
            + f"\n{cell['trials_lowered'][name]}/{cell['trials']}"
        )

    columns = (
        ("from", lambda cell: DIRECTIONS[cell["from"]]),
        ("at [m]", median("nearest_m", 2)),
        *((f"{'T_u' if b == 'upper' else 'T_l'} {'xyz'[axis]}", of(_name(b, axis))) for b, axis in BOUNDS),
    )
    return tabulated(
        "The hand at its nearest: how far each of the six thresholds gives way [N]",
        columns,
        part["cells"],
        "Medians of F_obs; below, in how many trials the threshold gave way. Starred: the one on the hand's side. The"
        " others leak: eq. 11 takes a point for an object on one side of every axis, however little it is off it; the"
        " place of the unit that sees it decides which side.",
    )
