"""The static experiment with units that sit elsewhere than the skin file says: how good is good enough."""

from collections.abc import Callable
from itertools import product

import numpy as np

from pretouch.control.path import Circle, Path, WayPoints
from pretouch.perception.obstacles import placed_sensors
from pretouch.perception.scene_filter import expected_range
from pretouch.profiles import profile
from pretouch.robot.model import RobotModel
from pretouch.sim.paper_scenes import static_path, static_scene
from pretouch.sim.random_skin import Misplacement, misplaced
from pretouch.sim.scene import Box, SceneSpec, fixtures
from pretouch.text_table import TextTable, tabulated
from pretouch_lab.benchmarks.avoidance.obstacle import Cuboid, nearest
from pretouch_lab.cell import Cell, Context, Grid
from pretouch_lab.experiment import Experiment
from pretouch_lab.paper import static
from pretouch_lab.rows import Row, cells_of, grouped, rounded
from pretouch_lab.tables import hits, median, number, plain
from pretouch_lab.trial import Record, Setup, play

NAME = "mounting"
ROOM = "room"
"""In place of the board's side: an empty room."""
FORCES = ("filtered_at_detection_n", "raw_at_detection_n", "peak_estimate_n", "true_peak_20ms_n")

_POSITIONS_MM = (2.0, 5.0, 10.0, 20.0, 30.0, 50.0)
_ORIENTATIONS_DEG = (1.0, 2.0, 5.0, 10.0, 20.0)
_CALIBRATED = ((1.0, 0.1), (3.0, 0.5))
"""What a calibration by the units' IMUs leaves."""
_LARGE = ((10.0, 0.0), (50.0, 0.0), (0.0, 5.0), (0.0, 20.0))
AVOIDING = "hard"
"""Restrictions that keep the arm off the board, in trials that ask how near it comes."""

_STIFFNESS_N_PER_M = 25_000.0
_ROOM_S = 20.0
_EVERY = 5
"""Control steps between two at which the distance to the board is worked out."""


EXACT = Misplacement()
UNTOLD = (
    EXACT,
    *(Misplacement(position_mm=e) for e in _POSITIONS_MM),
    *(Misplacement(orientation_deg=a) for a in _ORIENTATIONS_DEG),
    *(Misplacement(*both) for both in _CALIBRATED),
)
TOLD = tuple(Misplacement(*both, told=True) for both in (*_CALIBRATED, *_LARGE))
AVOIDED = (EXACT, *(Misplacement(*both, told=told) for both in (*_CALIBRATED, *_LARGE) for told in (False, True)))


def cells(grid: Grid) -> list[Cell]:
    """All places of the board and both paths in an empty room with each misplacement, for each profile that senses.

    Some misplacements again with restrictions that avoid the board.
    """
    sides = (*static.SIDES, ROOM)
    wanted = [
        _cell(name, mode, trajectory, side, error)
        for default, errors, of in (
            (static.DEFAULT_RESTRICTIONS, (*UNTOLD, *TOLD), sides),
            (AVOIDING, AVOIDED, static.SIDES),
        )
        for name, mode in grid.controllers(default)
        if profile(name).perception is not None
        for error, trajectory, side in product(errors, static.TRAJECTORIES, of)
    ]
    return list({cell.name: cell for cell in wanted}.values())


def _cell(name: str, mode: str, trajectory: str, side: str, error: Misplacement) -> Cell:
    return Cell(NAME, name, {
        "trajectory": trajectory, "side": side, "position_mm": error.position_mm,
        "orientation_deg": error.orientation_deg, "told": "told" if error.told else "untold", "restrictions": mode,
    })  # fmt: skip


def trial(cell: Cell, seed: int, context: Context) -> tuple[Row, Record]:
    """Run one trial; return its row of results and what it left behind."""
    trajectory, side = str(cell.where["trajectory"]), str(cell.where["side"])
    error = Misplacement(
        float(cell.where["position_mm"]), float(cell.where["orientation_deg"]), cell.where["told"] == "told"
    )
    believed, refused = misplaced(context.skin, context.model, error, seed)
    empty = side == ROOM
    scene = SceneSpec() if empty else static_scene(trajectory, side, _STIFFNESS_N_PER_M, seed)
    setup = context.setup(
        cell, seed, scene, _way(trajectory) if empty else static_path(trajectory, side), believed=believed
    )
    record = play(setup, (lambda step, _: step.stamp >= _ROOM_S) if empty else static.done_after_contact())
    row = {
        **cell.row(seed),
        **static.results(record, -1.0 if side == "+y" else 1.0, context.model.links),
        "touch_s": record.first_contact(),
        "missed_fraction": None if empty else missed(record, setup),
        "least_gap_m": None if empty else least_gap(record, context.model, scene.boxes[0]),
        **(free_motion(record) if empty else dict.fromkeys(("obstacle_fraction", "speed_scale", "travelled_m"))),
        "refused": refused,
        "drawn": refused + len(believed),
    }
    row["detected"] = row["detection_delay_s"] is not None
    return row, record


def _way(trajectory: str) -> Path:
    """Return the paper's circle, or its line to and fro."""
    if trajectory == "circle":
        return Circle()
    return WayPoints(np.array([(0.4, 0.5, 0.5), (0.4, -0.5, 0.5)]), closed=True)


def free_motion(record: Record) -> Row:
    """What the arm does in an empty room, where all it takes for an obstacle is itself or the floor."""
    return {
        "obstacle_fraction": rounded(float(np.mean([len(s.obstacles.unit) > 0 for s in record.steps])), 5),
        "speed_scale": rounded(float(np.mean([s.speed_scale for s in record.steps]))),
        "travelled_m": rounded(record.steps[-1].path_phase),
    }


def missed(record: Record, setup: Setup) -> float | None:
    """Share of the readings with the board in them, up to the contact, that the controller took for no obstacle.

    A reading shows the board if it is nearer than what the filter expects of the arm and the room, less its margin,
    from where the unit truly sits.
    """
    touch = record.first_contact()
    steps = [s for s in record.steps if touch is None or s.stamp < touch]
    room, model, skin = fixtures(setup.scene), setup.model, setup.skin
    shown, left_out, margin = 0, 0, setup.profile.sight.self_margin_m or 0.0
    for step in steps:
        kin = model.kinematics(step.q)
        expected = expected_range(kin, placed_sensors(skin.arrays, kin), skin.cones, model.capsules, room)
        board = np.flatnonzero(step.range_distance < expected - margin)
        shown += len(board)
        left_out += len(np.setdiff1d(board, step.obstacles.unit))
    return rounded(left_out / shown, 5) if shown else None


def least_gap(record: Record, model: RobotModel, box: Box) -> float:
    """Least true distance [m] between the arm's surface and a box; negative if they meet."""
    shape = Cuboid(np.array(box.center), np.array(box.half_size))
    steps = record.steps[::_EVERY]
    return rounded(min(nearest(model.kinematics(s.q), model.body, shape).distance for s in steps), 4)


def _cost(cell: Cell) -> float:
    if cell.where["side"] == ROOM:
        return _ROOM_S
    return 40.0 if cell.where["restrictions"] in ("hard", "slack") else 7.0


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
    """What misplaced units change of the forces at the board, of how near the arm comes, and where nothing is near."""
    pooled = [cell for cell in part["cells"] if cell["trajectory"] == "all"]
    rooms = [cell for cell in pooled if cell["side"] == ROOM]
    boards = [cell for cell in pooled if cell["side"] == "boards"]
    made = (
        tabulated("Misplaced units, static object: medians of all four places", _BOARDS, boards, _BOARDS_NOTE),
        tabulated("Misplaced units, an empty room: medians", _ROOMS, rooms, _ROOMS_NOTE),
    )
    return [table for table in made if table.rows]


def _error(cell: Row) -> str:
    parts = [f"{cell['position_mm']:g} mm"] if cell["position_mm"] else []
    parts += [f"{cell['orientation_deg']:g} deg"] if cell["orientation_deg"] else []
    return "\n".join(parts) or "none"


def _percent(name: str, digits: int) -> Callable[[Row], str]:
    return lambda cell: number(cell[name], digits, 100.0)


_NAMES = (
    ("error", _error),
    ("stated", lambda cell: "yes" if cell["told"] == "told" else ""),
    ("profile\nmode", lambda cell: f"{cell['profile']}\n{cell['restrictions']}"),
)
_BOARDS = (
    *_NAMES,
    ("hit", hits),
    ("least\n[m]", median("least_gap_m", 3)),
    ("impact\n[m/s]", median("impact_speed_m_s", 3)),
    ("filtered\n[N]", median("filtered_at_detection_n", 1)),
    ("true\n20 ms", median("true_peak_20ms_n", 1)),
    ("ratio", median("true_peak_20ms_n_ratio", 2)),
    ("most\n[N]", plain("largest_true_20ms_n", ".0f")),
    ("missed\n[%]", _percent("missed_fraction", 1)),
    ("false", plain("false_detections")),
)
_BOARDS_NOTE = (
    "Each unit sits this far from where the controller believes it to be, in a direction of its own, or is turned by"
    " this angle about an axis of its own; stated: the skin file says so as standard deviations. Hit: trials with"
    " contact. Least: true distance of the arm's surface from the board. Ratio: of the true force to that of the trial"
    " with units in their place. Most: largest of the true 20 ms peaks. Missed: of the readings that show the board,"
    " those that the controller took for the arm or the room. False: detections before the contact."
)
_ROOMS = (
    *_NAMES,
    ("obstacle\n[%]", _percent("obstacle_fraction", 1)),
    ("speed", median("speed_scale", 2)),
    ("way\n[%]", _percent("travelled_m_ratio", 0)),
    ("false", plain("false_detections")),
    ("refused\n[%]", lambda cell: f"{100 * cell['refused'] / cell['drawn']:.0f}"),
)
_ROOMS_NOTE = (
    "Twenty seconds on the circle and on the line with nothing near. Obstacle: control steps in which the controller"
    " believes that there is one: it is the arm or the floor. Speed: factor of eqs. 3 and 4. Way: travelled, of that"
    " with units in their place. Refused: of all poses that were drawn, those that lie inside the unit's own link."
)


EXPERIMENT = Experiment(NAME, cells, trial, _cost, summarise, tables, recorded=False)
