"""The static experiment with units that sit elsewhere than the skin file says: how good is good enough."""

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
from pretouch.text_table import TextTable
from pretouch_lab.bench.obstacle import Cuboid, least_distance
from pretouch_lab.experiment import Context, Experiment, controllers, main
from pretouch_lab.experiments import static
from pretouch_lab.options import Options
from pretouch_lab.run import Row
from pretouch_lab.table import Column, ratios, rounded, summary, table
from pretouch_lab.trial import Record, Setup, play

NAME = "mounting"
ROOM = "room"
"""In place of the board's side: an empty room."""

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


def cells(options: Options) -> list[Row]:
    """All places of the board and both paths in an empty room with each misplacement, for each profile that senses.

    Some misplacements again with restrictions that avoid the board.
    """
    every = [
        {
            "trajectory": trajectory,
            "side": side,
            "position_mm": error.position_mm,
            "orientation_deg": error.orientation_deg,
            "told": "told" if error.told else "untold",
            **controller,
        }
        for default, errors, sides in (
            (static.DEFAULT_RESTRICTIONS, (*UNTOLD, *TOLD), (*static.SIDES, ROOM)),
            (AVOIDING, AVOIDED, static.SIDES),
        )
        for controller in controllers(options, default)
        if profile(controller["profile"]).perception is not None
        for error, trajectory, side in product(errors, static.TRAJECTORIES, sides)
    ]
    return list({tuple(cell.values()): cell for cell in every}.values())


def trial(cell: Row, seed: int, context: Context) -> tuple[Row, Record]:
    """Run one trial; return what is measured and what it left behind."""
    trajectory, side = cell["trajectory"], cell["side"]
    error = Misplacement(cell["position_mm"], cell["orientation_deg"], cell["told"] == "told")
    believed, refused = misplaced(context.skin, context.model, error, seed)
    empty = side == ROOM
    scene = SceneSpec() if empty else static_scene(trajectory, side, _STIFFNESS_N_PER_M, seed)
    setup = context.setup(
        cell, seed, scene, _way(trajectory) if empty else static_path(trajectory, side), believed=believed
    )
    record = play(setup, (lambda step, _: step.stamp >= _ROOM_S) if empty else static.done_after_contact())
    row = {
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
    postures = np.array([s.q for s in record.steps[::_EVERY]])
    return rounded(least_distance(model, postures, lambda _: shape, record.hand_position[::_EVERY]), 4)


_COMPARED = ("true_peak_20ms_n", "travelled_m")
_SPREADS = (
    *(
        "least_gap_m",
        "impact_speed_m_s",
        "filtered_at_detection_n",
        *_COMPARED,
        *(f"{name}_ratio" for name in _COMPARED),
    ),
    *("missed_fraction", "obstacle_fraction", "speed_scale"),
)
_TOTALS = ("contact", "false_detections", "refused", "drawn")
_ERROR = (
    Column("error", "error"),
    Column("stated", "stated"),
    Column("profile\nmode", "profile", second="restrictions"),
)
_BOARDS = (
    *_ERROR,
    Column("hit", "contact", of="trials"),
    Column("least\n[m]", "least_gap_m", 3),
    Column("impact\n[m/s]", "impact_speed_m_s", 3),
    Column("filtered\n[N]", "filtered_at_detection_n", 1),
    Column("true\n20 ms", "true_peak_20ms_n", 1),
    Column("ratio", "true_peak_20ms_n_ratio", 2),
    Column("missed\n[%]", "missed_fraction", 1, 100.0),
    Column("false", "false_detections"),
)
_BOARDS_NOTE = (
    "Each unit sits this far from where the controller believes it to be, in a direction of its own, or is turned by"
    " this angle about an axis of its own; stated: the skin file says so as standard deviations. Hit: trials with"
    " contact. Least: true distance of the arm's surface from the board. Ratio: of the true force to that of the trial"
    " with units in their place. Missed: of the readings that show the board, those that the controller took for the"
    " arm or the room. False: detections before the contact."
)
_ROOMS = (
    *_ERROR,
    Column("obstacle\n[%]", "obstacle_fraction", 1, 100.0),
    Column("speed", "speed_scale", 2),
    Column("way\n[%]", "travelled_m_ratio", 0, 100.0),
    Column("false", "false_detections"),
    Column("refused\n[%]", "refused_fraction", 0, 100.0),
)
_ROOMS_NOTE = (
    "Twenty seconds on the circle and on the line with nothing near. Obstacle: control steps in which the controller"
    " believes that there is one: it is the arm or the floor. Speed: factor of eqs. 3 and 4. Way: travelled, of that"
    " with units in their place. Refused: of all poses that were drawn, those that lie inside the unit's own link."
)


def tables(rows: list[Row]) -> list[TextTable]:
    """Show what misplaced units change of the forces at the board, of how near the arm comes, and of free motion.

    Ratios are those to the trial with the same seed at the same place whose units sit where they are believed to.
    """
    same = ("trajectory", "side", "profile", "restrictions", "seed")
    every = [
        row | {"error": _error(row), "stated": "yes" if row["told"] == "told" else ""}
        for row in ratios(rows, {"position_mm": 0.0, "orientation_deg": 0.0}, same, _COMPARED)
    ]
    by = ("error", "stated", "profile", "restrictions")
    boards, rooms = (
        summary((r for r in every if (r["side"] == ROOM) is empty), by, _SPREADS, _TOTALS) for empty in (False, True)
    )
    rooms = [row | {"refused_fraction": row["refused"] / row["drawn"]} for row in rooms]
    made = (
        table("Misplaced units, static object: medians of all four places", _BOARDS, boards, _BOARDS_NOTE, 3),
        table("Misplaced units, an empty room: medians", _ROOMS, rooms, _ROOMS_NOTE, 3),
    )
    return [each for each in made if each.rows]


def _error(row: Row) -> str:
    parts = [f"{row['position_mm']:g} mm"] if row["position_mm"] else []
    parts += [f"{row['orientation_deg']:g} deg"] if row["orientation_deg"] else []
    return "\n".join(parts) or "none"


EXPERIMENT = Experiment(NAME, cells, trial, tables)
if __name__ == "__main__":
    main(NAME)
