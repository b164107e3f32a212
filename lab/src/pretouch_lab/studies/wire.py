"""The static experiment again, its readings over the wire: what losses, delays and the units' clocks change of it."""

from collections.abc import Callable
from itertools import product

import numpy as np

from pretouch.profiles import profile
from pretouch.serving.fleet import FleetParams
from pretouch.serving.network import network
from pretouch.sim.paper_scenes import static_path, static_scene
from pretouch.text_table import TextTable, tabulated
from pretouch_lab.cell import Cell, Context, Grid
from pretouch_lab.experiment import Experiment
from pretouch_lab.paper import static
from pretouch_lab.rows import Row, cells_of, rounded
from pretouch_lab.tables import median, number, plain, share
from pretouch_lab.trial import Record, play

NAME = "wire"

IN_PROCESS = "in process"
WAYS: dict[str, float | None] = {IN_PROCESS: None, "0 %": 0.0, "10 %": 0.1, "30 %": 0.3}
"""How readings come: within the process, or over the wire at a loss in either direction."""
TOLERANCE = 0.15
"""Change of a median force by the wire that is still accepted, as a fraction."""
FORCES = ("filtered_at_detection_n", "raw_at_detection_n", "peak_estimate_n", "true_peak_20ms_n")

_STIFFNESS_N_PER_M = 25_000.0
_BEGIN_S = 1.5
"""Ages count from here on [s]: the arm is under way, each unit has been heard."""


def cells(grid: Grid) -> list[Cell]:
    """All combinations of trajectory and side, each way of the readings, for each profile that senses."""
    return [
        Cell(NAME, name, {"trajectory": trajectory, "side": side, "readings": way, "restrictions": mode})
        for name, mode in grid.controllers(static.DEFAULT_RESTRICTIONS)
        if profile(name).perception is not None
        for trajectory, side, way in product(static.TRAJECTORIES, static.SIDES, WAYS)
    ]


def trial(cell: Cell, seed: int, context: Context) -> tuple[Row, Record]:
    """Run one trial; return its row of results and what it left behind."""
    trajectory, side = str(cell.where["trajectory"]), str(cell.where["side"])
    loss = WAYS[str(cell.where["readings"])]
    setup = context.setup(
        cell,
        seed,
        static_scene(trajectory, side, _STIFFNESS_N_PER_M, seed),
        static_path(trajectory, side),
        wire=None if loss is None else FleetParams(network(loss)),
    )
    record = play(setup, static.done_after_contact())
    row = {
        **cell.row(seed),
        **static.results(record, -1.0 if side == "+y" else 1.0, context.model.links),
        **coming_in(record),
    }
    return row, record


def coming_in(record: Record) -> Row:
    """How readings came in: their ages, and what the receiver counted."""
    ages = np.zeros(0) if record.reading_age is None else record.reading_age[record.times() >= _BEGIN_S].ravel()
    # sequence numbers begin anew with each session: those of units that kept theirs tell what is missing
    steady = [unit for unit in record.traffic if unit.sessions == 1 and unit.sample is not None]
    sent = sum(unit.sample.sequence for unit in steady if unit.sample)
    return {
        "age_median_s": rounded(float(np.median(ages)), 4) if ages.size else None,
        "age_p99_s": rounded(float(np.percentile(ages, 99)), 4) if ages.size else None,
        "lost": rounded(1 - sum(unit.accepted for unit in steady) / sent, 4) if sent else None,
        "sessions_left": sum(max(0, unit.sessions - 1) for unit in record.traffic),
    }


_KEYS = ("trajectory", "side", "profile", "restrictions", "readings")
_MEASURES = ("impact_speed_m_s", *FORCES, "age_median_s", "age_p99_s", "lost")


def summarise(rows: list[Row]) -> Row:
    """Medians of all places together and of each, and their ratios to those in process."""
    together = [{**row, "trajectory": "all", "side": "places"} for row in rows]
    found = [
        cell
        for group in (together, rows)
        for cell in cells_of(group, _KEYS, _MEASURES, ("contact",), ("false_detections", "held", "sessions_left"))
    ]
    return {"cells": [cell | _compared(cell, found) for cell in found]}


def _compared(cell: Row, cells: list[Row]) -> Row:
    """Ratios of a cell's median forces to those of its twin in process, and whether all are within the tolerance."""
    if cell["readings"] == IN_PROCESS:
        return {}
    twin = {key: cell[key] for key in _KEYS} | {"readings": IN_PROCESS}
    plain = next((c for c in cells if all(c[key] == value for key, value in twin.items())), None)
    if plain is None:
        return {}
    ratios = {
        force: rounded(cell[force]["median"] / plain[force]["median"])
        for force in FORCES
        if cell[force] and plain[force] and plain[force]["median"]
    }
    within = len(ratios) == len(FORCES) and all(abs(ratio - 1) <= TOLERANCE for ratio in ratios.values())
    return {"ratios": ratios, "within": within}


def tables(part: Row) -> list[TextTable]:
    """What the wire changes of the forces, and how readings came in."""
    cells = part["cells"]
    several = len({(cell["profile"], cell["restrictions"]) for cell in cells}) > 1

    def where(cell: Row) -> str:
        place = f"{cell['trajectory']}\n{cell['side']}"
        return f"{place}\n{cell['profile']}\n{cell['restrictions']}" if several else place

    names = ("where", where), ("readings", plain("readings"))
    forces = (
        *names,
        ("impact\n[m/s]", median("impact_speed_m_s", 3)),
        *(
            (label, _force(name))
            for name, label in zip(FORCES, ("filtered\n[N]", "raw\n[N]", "peak\n[N]", "true\n20 ms"), strict=True)
        ),
        ("15 %", lambda cell: {True: "within", False: "FAILS"}.get(cell.get("within"), "")),
    )
    coming = (
        *names,
        ("lost\n[%]", median("lost", 1, 100)),
        ("age\n[ms]", median("age_median_s", 0, 1000)),
        ("age 99 %\n[ms]", median("age_p99_s", 0, 1000)),
        ("left", plain("sessions_left")),
        ("held", share("held")),
        ("false", plain("false_detections")),
    )
    return [
        tabulated(
            "The static experiment over the wire: median forces, and their ratio to those in process",
            forces,
            cells,
            "Readings: within the process, or over UDP with this loss in either direction. Columns as in the static"
            f" tables. Within: all four medians differ by no more than {100 * TOLERANCE:.0f} % from those in process.",
        ),
        tabulated(
            "How readings came in",
            coming,
            [cell for cell in cells if cell["trajectory"] == "all"],
            "Lost: samples that the receiver found missing, of units that kept their session. Age: of a unit's newest"
            " reading at a control step. Left: sessions that a unit left because it heard no beacon for 2 s. Held:"
            " trials with a hold. False: detections before the contact.",
        ),
    ]


def _force(name: str) -> Callable[[Row], str]:
    def write(cell: Row) -> str:
        ratio = cell.get("ratios", {}).get(name)
        return number(cell[name], 1) if ratio is None else f"{number(cell[name], 1)}\n{ratio:.2f}"

    return write


EXPERIMENT = Experiment(NAME, cells, trial, lambda _: 7.0, summarise, tables, recorded=False)
