"""The static experiment with units that sit elsewhere than the skin file says: how good is good enough."""

from itertools import product

import numpy as np

from pretouch.control.path import Circle, Path, WayPoints
from pretouch.perception.obstacles import placed_sensors
from pretouch.perception.scene_filter import expected_range
from pretouch.profiles import profile
from pretouch.robot.model import RobotModel
from pretouch.sim.misplacement import Misplacement, misplaced
from pretouch.sim.paper_scenes import static_path, static_scene
from pretouch.sim.scene import Box, SceneSpec, fixtures
from pretouch_lab.benchmarks.avoidance.obstacle import Cuboid, nearest
from pretouch_lab.cell import Cell, Context, Grid
from pretouch_lab.experiment import Experiment, Picture, Sources
from pretouch_lab.paper import static
from pretouch_lab.rows import Row, rounded
from pretouch_lab.studies.mounting_tables import NAME, ROOM, summarise, tables
from pretouch_lab.trial import Record, Setup, play

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
        expected = expected_range(kin, placed_sensors(skin, kin), skin.cones, model.capsules, room)
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


def _draw(sources: Sources) -> list[Picture]:
    from pretouch_lab.paper.figures.mounting import mounting_figure

    figure = mounting_figure(sources.summary["cells"])
    return [Picture("mounting", "Force and free motion against errors of the units' places", figure)] if figure else []


EXPERIMENT = Experiment(NAME, cells, trial, _cost, summarise, tables, _draw, recorded=False)
