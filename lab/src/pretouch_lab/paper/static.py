"""Paper IV-A: the arm runs into a large static object, on a circle and on a line, from either side."""

from collections.abc import Callable
from itertools import product

import numpy as np

from pretouch.sim.paper_scenes import static_path, static_scene
from pretouch.sim.plant import Plant
from pretouch.traces import mean_over
from pretouch.types import ControlStep
from pretouch_lab.cell import Cell, Context, Grid
from pretouch_lab.experiment import Experiment, Picture, Sources
from pretouch_lab.rows import Row, peak, rounded
from pretouch_lab.summary import static_summary
from pretouch_lab.tables import shown_controllers, static_tables
from pretouch_lab.trial import Record, play

NAME = "static"
DEFAULT_RESTRICTIONS = "off"
"""The paper "purposefully allows contact"; at Table I's values its restrictions forbid it."""

TRAJECTORIES = ("circle", "line")
SIDES = ("-y", "+y")

_TIME_LIMIT_S = 40.0
_AFTER_DETECTION_S = 1.0


def cells(grid: Grid) -> list[Cell]:
    """All combinations of stiffness, trajectory, side and controller."""
    return [
        Cell(
            NAME,
            profile,
            {"trajectory": trajectory, "side": side, "stiffness_n_per_m": stiffness, "restrictions": restrictions},
        )
        for stiffness, trajectory, side, (profile, restrictions) in product(
            grid.stiffness, TRAJECTORIES, SIDES, grid.controllers(DEFAULT_RESTRICTIONS)
        )
    ]


def trial(cell: Cell, seed: int, context: Context) -> tuple[Row, Record]:
    """Run one trial; return its row of results and what it left behind."""
    trajectory, side = str(cell.where["trajectory"]), str(cell.where["side"])
    setup = context.setup(
        cell,
        seed,
        static_scene(trajectory, side, float(cell.where["stiffness_n_per_m"]), seed, context.placement),
        static_path(trajectory, side, context.placement),
    )
    record = play(setup, done_after_contact())
    row = {
        **cell.row(seed),
        **results(record, -1.0 if side == "+y" else 1.0, context.model.links),
    }
    return row, record


def done_after_contact() -> Callable[[ControlStep, Plant], bool]:
    """End a while after the first reaction that a true contact caused, or at the time limit."""
    detected: list[float] = []

    def done(step: ControlStep, plant: Plant) -> bool:
        if plant.touches and not detected and step.contact is not None:
            detected.append(step.stamp)
        over = bool(detected) and step.stamp >= detected[0] + _AFTER_DETECTION_S
        return over or step.stamp >= _TIME_LIMIT_S

    return done


def results(record: Record, push: float, links: tuple[str, ...]) -> Row:
    """Numbers of one trial; `push` is the sign of the force along y by which the object pushes the arm.

    The impact speed is the true closing speed of the point of the arm that touches first.
    """
    touch = record.first_contact()
    reactions = record.reactions()
    row: Row = {
        "contact": touch is not None,
        "touched_link": None,
        "impact_speed_m_s": None,
        "detection_delay_s": None,
        "filtered_at_detection_n": None,
        "raw_at_detection_n": None,
        "peak_estimate_n": None,
        "true_peak_20ms_n": None,
        "true_peak_n": None,
        "least_sensed_m": least_sensed(record),
        "false_detections": sum(touch is None or s.stamp < touch for s in reactions),
        "held": record.held(),
    }
    if touch is None:
        return row
    times, along = record.times(), push * record.forces()[:, 1]
    true = np.linalg.norm(record.true_force, axis=1)
    first = record.touches[0]
    row["touched_link"] = links[first.link]
    row["impact_speed_m_s"] = rounded(-push * float(first.velocity[1]), 4)
    row["peak_estimate_n"] = rounded(peak(along[(times >= touch) & np.isfinite(along)]))
    row["true_peak_n"] = rounded(peak(true))
    row["true_peak_20ms_n"] = rounded(peak(mean_over(true, 20)))
    detection = next((s for s in reactions if s.stamp >= touch), None)
    if detection is not None:
        row["detection_delay_s"] = rounded(detection.stamp - touch, 4)
        row["filtered_at_detection_n"] = rounded(push * float(detection.filtered_force[1]))
        row["raw_at_detection_n"] = rounded(push * float(detection.force[1]))
    return row


def least_sensed(record: Record) -> float | None:
    """Least distance [m] of the arm's surface from anything it sensed, None if it sensed nothing."""
    least = min((float(s.obstacles.body_distance.min(initial=np.inf)) for s in record.steps), default=np.inf)
    return rounded(least, 4) if np.isfinite(least) else None


def _cost(cell: Cell) -> float:
    return _TIME_LIMIT_S if cell.where["restrictions"] in ("hard", "slack") else 4.0


def _draw(sources: Sources) -> list[Picture]:
    from pretouch_lab.paper.figures.force_difference import force_difference_figure

    stiffness, mode, profiles = shown_controllers(sources.summary["cells"])
    traces = {}
    for trajectory, side, profile in product(TRAJECTORIES, SIDES, profiles):
        where: dict[str, str | float] = {
            "trajectory": trajectory, "side": side, "stiffness_n_per_m": stiffness, "restrictions": mode[profile],
        }  # fmt: skip
        trace = sources.trace(Cell(NAME, profile, where))
        if trace is not None:
            traces[trajectory, side, profile] = trace
    if not traces:
        return []
    figure = force_difference_figure(traces, profiles)
    return [Picture("static", "Force and contact thresholds at the static object", figure)]


EXPERIMENT = Experiment(NAME, cells, trial, _cost, static_summary, static_tables, _draw)
