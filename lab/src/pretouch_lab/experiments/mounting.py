"""The static experiment with misplaced units: required accuracy of their mounting."""

from itertools import product

from pretouch.profiles import profile
from pretouch.sim.paper_scenes import static_path, static_scene
from pretouch.sim.scene import SceneSpec
from pretouch.text_table import TextTable
from pretouch_lab.bench.scenes import path_of
from pretouch_lab.domain_randomisation import Misplacement, misplaced
from pretouch_lab.experiment import Context, Experiment, controllers
from pretouch_lab.experiments import static
from pretouch_lab.options import TrialOptions
from pretouch_lab.run import Row
from pretouch_lab.table import Column, medians, ratios, rounded
from pretouch_lab.trial import Record, play

ROOM = "room"
"""Value in place of the board's side: an empty room."""
_CALIBRATED = (3.0, 0.5)
"""Errors after a calibration by the units' IMUs [mm], [deg]."""
_LARGE = ((50.0, 0.0), (0.0, 20.0))
UNDECLARED = (
    Misplacement(),
    *(Misplacement(position_mm=size) for size in (5.0, 10.0, 20.0, 50.0)),
    *(Misplacement(orientation_deg=size) for size in (1.0, 2.0, 5.0, 20.0)),
    Misplacement(*_CALIBRATED),
)
DECLARED = tuple(Misplacement(*both, declared=True) for both in (_CALIBRATED, *_LARGE))
AVOIDED = (Misplacement(), *(Misplacement(*both) for both in _LARGE))
"""Misplacements that are also played with restrictions that keep the arm off the board."""
_STIFFNESS_N_PER_M = 25_000.0
_ROOM_S = 20.0


def cells(options: TrialOptions) -> list[Row]:
    """Return all places of the board, and an empty room, with each misplacement, for each profile with proximity."""
    every = [
        {
            "trajectory": trajectory,
            "side": side,
            "position_mm": error.position_mm,
            "orientation_deg": error.orientation_deg,
            "told": "told" if error.declared else "untold",
            **controller,
        }
        for mode, errors, sides in (
            (static.DEFAULT_RESTRICTIONS, (*UNDECLARED, *DECLARED), (*static.SIDES, ROOM)),
            ("hard", AVOIDED, static.SIDES),
        )
        for controller in controllers(options, mode)
        if profile(controller["profile"]).perception is not None
        for error, trajectory, side in product(errors, static.TRAJECTORIES, sides)
    ]
    return list({tuple(cell.values()): cell for cell in every}.values())


def trial(cell: Row, seed: int, context: Context) -> tuple[Row, Record]:
    """Run one trial; return its row and its record."""
    trajectory, side = cell["trajectory"], cell["side"]
    error = Misplacement(cell["position_mm"], cell["orientation_deg"], cell["told"] == "told")
    believed, _ = misplaced(context.skin, context.model, error, seed)
    if side == ROOM:
        setup = context.setup(cell, seed, SceneSpec(), path_of(trajectory), believed=believed)
        record = play(setup, lambda step, _: step.stamp >= _ROOM_S)
    else:
        scene = static_scene(trajectory, side, _STIFFNESS_N_PER_M, seed)
        setup = context.setup(cell, seed, scene, static_path(trajectory, side), believed=believed)
        record = play(setup, static.done_after_contact())
    row = static.results(record, -1.0 if side == "+y" else 1.0, context.model.links)
    return row | {"travelled_m": rounded(record.steps[-1].path_phase) if side == ROOM else None}, record


_ERROR = (
    Column("error", "error"),
    Column("stated", "stated"),
    Column("profile\nmode", "profile", second="restrictions"),
)
_BOARDS = (
    *_ERROR,
    Column("hit", "contact", of="trials"),
    Column("detected", "detected", of="contact"),
    Column("impact\n[m/s]", "impact_speed_m_s", 3),
    Column("filtered\n[N]", "filtered_at_detection_n", 1),
    Column("true\n20 ms", "true_peak_20ms_n", 1),
    Column("ratio", "true_peak_20ms_n_ratio", 2),
    Column("false", "false_detections"),
)
_BOARDS_NOTE = (
    "Each unit is displaced by this distance in a random direction, or turned by this angle about a random axis, and"
    " the controller does not know it. Stated: the skin file declares the errors as standard deviations. Hit: trials"
    " with contact. Ratio: true force over that of the trial with units in their places. False: detections before the"
    " contact."
)
_ROOMS = (*_ERROR, Column("way\n[%]", "travelled_m_ratio", 0, 100.0), Column("false", "false_detections"))
_ROOMS_NOTE = (
    "Twenty seconds on the circle and on the line with nothing near: every obstacle of the controller is the arm or the"
    " floor. Way: distance along the path over that with units in their places."
)


def tables(rows: list[Row]) -> list[TextTable]:
    """Return tables of the effects of misplaced units on forces at the board, and on free motion.

    The reference of a ratio is the trial with the same seed and place whose units are not misplaced.
    """
    same = ("trajectory", "side", "profile", "restrictions", "seed")
    compared = ratios(rows, {"position_mm": 0.0, "orientation_deg": 0.0}, same, ("true_peak_20ms_n", "travelled_m"))
    every = [
        row
        | {
            "error": _error(row),
            "stated": "yes" if row["told"] == "told" else "",
            "detected": row["detection_delay_s"] is not None,
        }
        for row in compared
    ]
    by = ("error", "stated", "profile", "restrictions")
    boards, rooms = ([row for row in every if (row["side"] == ROOM) is empty] for empty in (False, True))
    both = (
        medians("Misplaced units, static object: medians of all four places", _BOARDS, boards, by, _BOARDS_NOTE, 3),
        medians("Misplaced units, an empty room: medians", _ROOMS, rooms, by, _ROOMS_NOTE, 3),
    )
    return [each for each in both if each.rows]


def _error(row: Row) -> str:
    parts = [f"{row['position_mm']:g} mm"] if row["position_mm"] else []
    parts += [f"{row['orientation_deg']:g} deg"] if row["orientation_deg"] else []
    return "\n".join(parts) or "none"


EXPERIMENT = Experiment("mounting", cells, trial, tables)
