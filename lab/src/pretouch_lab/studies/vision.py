"""What a depth camera beside the arm adds to the skin, and where either is worse: seven units, a camera, or both."""

from dataclasses import dataclass
from itertools import product

import numpy as np

from pretouch.control.path import Circle, Path
from pretouch.profiles import profile
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.sim.paper_scenes import static_path, static_scene
from pretouch.sim.pushes import Visitor
from pretouch.sim.scene import HandSpec, SceneSpec
from pretouch.text_table import TextTable, tabulated
from pretouch.types import FloatArray
from pretouch_lab.benchmarks.avoidance.measures import contact
from pretouch_lab.benchmarks.avoidance.obstacle import Ball, Cuboid, Shape
from pretouch_lab.benchmarks.avoidance.truth import truth_of
from pretouch_lab.cell import Cell, Context, Grid
from pretouch_lab.depth_camera import looking
from pretouch_lab.experiment import Experiment
from pretouch_lab.paper.avoidance import visits
from pretouch_lab.rows import Row, cells_of, rounded
from pretouch_lab.tables import median, plain, share
from pretouch_lab.trial import Record, play

NAME = "vision"
DEFAULT_RESTRICTIONS = "slack"
SCENES = ("room", "board", "hand")
SENSING = ("skin", "camera", "both")
VIEWS = {"front": (1.6, 0.0, 1.0), "behind": (0.5, 1.6, 0.5)}
"""Where the camera is [m]: in front of the arm, above the obstacle's path; or on the other side of the arm than the
board and the person's hand, so that the arm hides them."""
NO_VIEW = "none"
_OWN_PROFILE = "pretouch"
"""Run beside those asked for: a profile that takes outside points."""

_LOOKS_AT_M = (0.4, 0.0, 0.3)
_SIDE = "-y"
_STIFFNESS_N_PER_M = 25_000.0
_DURATION_S = 20.0
_NEAR_M = 0.6
"""Distance between arm and object within which it should be seen [m]."""
_CLOSE_M = 0.15
"""Distance within which not to see it leaves little time [m]."""
_SAME_M = 0.15
"""A sensed point this near to the object's surface shows it [m]."""
_FALSE_M = 0.3
"""A point of nothing counts where it is this near to the arm [m]: from there on it slows it."""


@dataclass(frozen=True)
class Scene:
    """Where the arm goes, and what is there."""

    spec: SceneSpec
    path: Path
    object: Cuboid | float | None
    """A board, the radius of a person's hand [m], or nothing."""

    def shape(self, hand: FloatArray) -> Shape | None:
        """Return the object's surface, with a hand's centre at (3,) [m]."""
        return Ball(hand, self.object) if isinstance(self.object, float) else self.object


def cells(grid: Grid) -> list[Cell]:
    """Each scene with the skin alone, for each profile that senses; with a camera for those that take its points.

    `pretouch` is among them whatever is asked for.
    """
    modes = Grid(tuple(dict.fromkeys((*grid.profiles, _OWN_PROFILE))), grid.restrictions)
    return [
        Cell(NAME, name, {"scene": scene, "sensing": sensing, "view": view, "restrictions": mode})
        for (name, mode), scene, sensing in product(modes.controllers(DEFAULT_RESTRICTIONS), SCENES, SENSING)
        if (profile(name).perception if sensing == "skin" else profile(name).sight.outside)
        for view in ((NO_VIEW,) if sensing == "skin" else VIEWS)
    ]


def scene_of(name: str, seed: int) -> Scene:
    """Return an empty room, the board of the static experiment, or the hand of the avoidance experiment, at one side.

    In the room and with the hand the arm follows the circle; it begins away from the board.
    """
    if name == "board":
        spec = static_scene("circle", _SIDE, _STIFFNESS_N_PER_M, seed)
        (board,) = spec.boxes
        shape = Cuboid(np.array(board.center), np.array(board.half_size))
        return Scene(spec, static_path("circle", _SIDE), shape)
    hand = HandSpec()
    return Scene(SceneSpec(hand=hand), Circle(), hand.radius) if name == "hand" else Scene(SceneSpec(), Circle(), None)


def trial(cell: Cell, seed: int, context: Context) -> tuple[Row, Record]:
    """Run one trial; return its row of results and what it left behind."""
    name, sensing, view = (str(cell.where[key]) for key in ("scene", "sensing", "view"))
    scene, model = scene_of(name, seed), context.model
    setup = context.setup(
        cell,
        seed,
        scene.spec,
        scene.path,
        skin=Skin([], model) if sensing == "camera" else context.skin,
        hand=Visitor(model, visits("inside", seed)[:1]) if name == "hand" else None,
        camera=None if view == NO_VIEW else looking(np.array(VIEWS[view]), np.array(_LOOKS_AT_M)),
    )
    record = play(setup, lambda step, _: step.stamp >= _DURATION_S)
    row = cell.row(seed)
    return row | results(record, scene, model, setup.profile.d_max_m), record


def results(record: Record, scene: Scene, model: RobotModel, d_max: float) -> Row:
    """Numbers of one trial; `d_max` [m] is the distance at which an object is near (Table I)."""
    steps = record.steps
    row: Row = {"way_m": rounded(steps[-1].path_phase), "held": record.held(), "contact": False}
    row |= dict.fromkeys((*_MEASURES[1:],), None)
    shapes = [scene.shape(hand) for hand in record.hand_position]
    of_it = [_distances(step.obstacles.point, shape) < _SAME_M for step, shape in zip(steps, shapes, strict=True)]
    near = [step.obstacles.body_distance < _FALSE_M for step in steps]
    row["false_fraction"] = rounded(
        float(np.mean([bool((close & ~true).any()) for close, true in zip(near, of_it, strict=True)])), 4
    )
    if scene.object is None:
        return row
    truth = truth_of(record, model, [shape for shape in shapes if shape is not None])
    row |= {key: value for key, value in contact(record, truth, d_max).items() if key in ("contact", *_MEASURES)}
    shown, times = np.array([bool(true.any()) for true in of_it]), record.times()
    within = truth.distance < _NEAR_M
    if within.any():
        row["seen_fraction"] = rounded(shown[within].mean(), 4)
        row["unseen_close_s"] = rounded(float((~shown & (truth.distance < _CLOSE_M)).sum()) * (times[1] - times[0]))
    if shown.any():
        first = int(np.argmax(shown))
        row["first_seen_m"] = rounded(truth.distance[first], 4)
        touch = record.first_contact()
        row["seen_before_s"] = None if touch is None else rounded(touch - times[first])
    return row


def _distances(points: FloatArray, shape: Shape | None) -> FloatArray:
    """Distance (K,) [m] of points (K, 3) from an object's surface; infinite where there is none."""
    return np.full(len(points), np.inf) if shape is None else np.abs(shape.closest(points)[0])


_MEASURES = (
    "way_m", "false_fraction", "first_seen_m", "seen_before_s", "seen_fraction", "unseen_close_s", "impact_speed_m_s",
    "true_peak_20ms_n", "least_distance_m",
)  # fmt: skip


def summarise(rows: list[Row]) -> Row:
    """Spreads over the seeds of each cell, and in how many trials the arm touched the object, or held."""
    by = ("scene", "sensing", "view", "restrictions", "profile")
    return {"cells": cells_of(rows, by, _MEASURES, totals=("contact", "held"))}


def tables(part: Row) -> list[TextTable]:
    """One table: what was seen, what was touched, and what it cost."""
    columns = (
        ("profile", plain("profile")),
        ("scene", plain("scene")),
        ("senses", plain("sensing")),
        ("view", plain("view")),
        ("first\n[m]", median("first_seen_m", 2)),
        ("seen\n[%]", median("seen_fraction", 0, 100)),
        ("unseen\n[s]", median("unseen_close_s", 2)),
        ("hit", share("contact")),
        ("before\n[s]", median("seen_before_s", 1)),
        ("speed\n[m/s]", median("impact_speed_m_s", 3)),
        ("peak\n[N]", median("true_peak_20ms_n", 0)),
        ("way\n[m]", median("way_m", 2)),
        ("false\n[%]", median("false_fraction", 1, 100)),
        ("held", share("held")),
    )
    return [
        tabulated(
            "Seven units, a depth camera, or both: medians",
            columns,
            part["cells"],
            "Front: the camera looks at approaching obstacles. Behind: the arm is between. First: true distance of the"
            f" object from the arm when it is first seen. Seen: share of the time with the object within {_NEAR_M:g} m"
            f" in which a sensed point shows it. Unseen: time within {_CLOSE_M:g} m in which none does. Before: from"
            " first seen to the first touch. Speed, peak: of that touch, and the largest true force, 20 ms mean. Way:"
            f" along the path in {_DURATION_S:g} s. False: share of the steps with a point within {_FALSE_M:g} m of the"
            " arm where nothing is. Held: trials with a HOLD after the start.",
            names=4,
        )
    ]


EXPERIMENT = Experiment(NAME, cells, trial, lambda _: _DURATION_S, summarise, tables, recorded=False)
