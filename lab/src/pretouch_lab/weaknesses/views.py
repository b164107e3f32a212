"""An empty room: what of the arm itself and of the table the units see, what the filter leaves, and what that costs."""

from collections.abc import Callable
from dataclasses import replace
from itertools import chain, count
from textwrap import fill

import numpy as np

from pretouch.control.path import Circle, Path, WayPoints
from pretouch.params import PerceptionParams
from pretouch.perception.obstacles import placed_sensors
from pretouch.perception.scene_filter import Fixtures, expected_range, no_fixtures
from pretouch.profiles import Profile, profile
from pretouch.sensing.skin import Skin
from pretouch.sensing.unit import SensorUnit
from pretouch.sim.scene import SceneSpec, fixtures
from pretouch.text_table import Column, TextTable, tabulated
from pretouch.types import FloatArray
from pretouch_lab.cell import Cell, Context, Grid
from pretouch_lab.experiment import Experiment
from pretouch_lab.rows import Row, cells_of, grouped, rounded
from pretouch_lab.tables import median, number, plain
from pretouch_lab.trial import Record, play

NAME = "views"
SCENES = ("circle", "line", "low", "down")
"""Circle and line with the arm on its pedestal, the line close above a table, and this with a unit that looks down."""

_UNFILTERED = ":perception.self_margin_m=none"
_DURATION_S = 40.0
_HEIGHT_M = {"line": 0.5, "low": 0.1, "down": 0.1}
"""Height of the line in the base frame, where the table's surface is at 0 [m]."""
_NO_PEDESTAL_M = 0.001
"""Radius of the pedestal of an arm that stands on a table: nothing of it is to be seen [m]."""
_DOWN_ID = "hand_down"
_BEFORE_HAND_M = 0.1334
"""Place of the unit that looks down on the axis of the robot's hand [m]: 3 cm below the TCP, clear of the fingers."""


def cells(grid: Grid) -> list[Cell]:
    """A cell for each scene and controller; each controller that senses also without the filter."""
    seeing = {name: profile(name).perception for name in grid.profiles}
    filtered = [name for name, params in seeing.items() if params is not None and params.self_margin_m is not None]
    both = Grid((*grid.profiles, *(name + _UNFILTERED for name in filtered)), grid.restrictions)
    return [
        Cell(NAME, name, {"scene": where, "restrictions": mode})
        for where in SCENES
        for name, mode in both.controllers("slack")
    ]


def path(where: str) -> Path:
    """Return the paper's circle, or its line to and fro."""
    if where == "circle":
        return Circle()
    height = _HEIGHT_M[where]
    return WayPoints(np.array([(0.4, 0.5, height), (0.4, -0.5, height)]), closed=True)


def scene(where: str) -> SceneSpec:
    """Return an empty room: the arm on its pedestal, or mounted on a table."""
    on_table = where in ("low", "down")
    return SceneSpec(floor_height=0.0, pedestal_radius=_NO_PEDESTAL_M) if on_table else SceneSpec()


def skin(where: str, context: Context) -> Skin:
    """Return the units of the run; in the scene `down` one more in the robot's hand looks along its fingers."""
    if where != "down":
        return context.skin
    T = np.eye(4)
    T[2, 3] = _BEFORE_HAND_M
    names = chain([_DOWN_ID], (f"{_DOWN_ID}_{i}" for i in count(2)))
    free = next(name for name in names if name not in context.skin.ids)
    return Skin((*context.skin.units, SensorUnit(free, "panda_hand", T)), context.model)


def trial(cell: Cell, seed: int, context: Context) -> tuple[Row, Record]:
    """Run one trial; return its row of results and what it left behind."""
    where = str(cell.where["scene"])
    context = replace(context, skin=skin(where, context))
    setup = context.setup(cell, seed, scene(where), path(where))
    record = play(setup, lambda step, _: step.stamp >= _DURATION_S)
    scale = np.array([s.speed_scale for s in record.steps])
    row = {
        **cell.row(seed),
        **seen(record, context, fixtures(setup.scene), setup.profile),
        "travelled_m": rounded(record.steps[-1].path_phase),
        "speed_scale": rounded(float(np.median(scale))),
        "least_speed_scale": rounded(float(scale.min())),
        "obstacle_force_positive_n": _mean([s.thresholds.obstacle_positive for s in record.steps]),
        "obstacle_force_negative_n": _mean([s.thresholds.obstacle_negative for s in record.steps]),
        "largest_slack_m_s": rounded(max(float(s.qp.slack.max(initial=0.0)) for s in record.steps), 4),
        "contact": record.first_contact() is not None,
        "false_detections": len(record.reactions()),
        "held": record.held(),
    }
    return row, record


def _mean(forces: list[FloatArray]) -> list[float]:
    """Mean of forces (3,) [N], axis by axis."""
    return [rounded(v) for v in np.mean(forces, axis=0)]


def seen(record: Record, context: Context, room: Fixtures, params: Profile) -> Row:
    """Shares of the units' readings, over all control steps: with a target, predicted, and left as obstacles.

    Predicted is what the filter would leave out with the posture of the step, whether it is on or not: a return from
    its margin before the predicted one on. Cut is a view in which this begins within the distance at which an obstacle
    slows the arm: there the filter would leave out an obstacle that matters. An obstacle is what the controller took
    for one.
    """
    margin = next(m for m in (params.sight.self_margin_m, PerceptionParams().self_margin_m) if m is not None)
    shown = np.array([s.range_distance for s in record.steps])
    arm, either = (_expected(record, context, known) - margin for known in (no_fixtures(), room))
    targets = np.isfinite(shown)
    of_arm, predicted = targets & (shown >= arm), targets & (shown >= either)
    taken = np.zeros(shown.shape, dtype=np.bool_)
    for i, step in enumerate(record.steps):
        taken[i, step.obstacles.unit] = True
    return {
        "target_fraction": rounded(targets.mean(), 5),
        "arm_fraction": rounded(of_arm.mean(), 5),
        "room_fraction": rounded((predicted & ~of_arm).mean(), 5),
        "unpredicted_fraction": rounded((targets & ~predicted).mean(), 5),
        "cut_fraction": rounded((either < params.d_max_m).mean(), 5),
        "obstacle_fraction": rounded(taken.mean(), 5),
        "obstacle_fraction_of_units": dict(
            zip(context.skin.ids, (rounded(v, 5) for v in taken.mean(axis=0)), strict=True)
        ),
    }


def _expected(record: Record, context: Context, known: Fixtures) -> FloatArray:
    """Distance (S, K) [m] at which each unit would see the arm or the fixtures at each control step."""
    model, skin, near = context.model, context.skin, []
    for step in record.steps:
        kin = model.kinematics(step.q)
        near.append(expected_range(kin, placed_sensors(skin, kin), skin.cones, model.capsules, known))
    return np.array(near)


_MEASURES = (
    "target_fraction", "arm_fraction", "room_fraction", "unpredicted_fraction", "cut_fraction", "obstacle_fraction",
    "travelled_m", "speed_scale", "least_speed_scale", "obstacle_force_n", "way_fraction", "largest_slack_m_s",
)  # fmt: skip
_SIDES = ("obstacle_force_positive_n", "obstacle_force_negative_n")


def summarise(rows: list[Row]) -> Row:
    """Cells of the experiment; the free way is that of `blind` with the same seed in the same scene."""
    free = {(row["scene"], row["seed"]): row["travelled_m"] for row in rows if row["profile"] == "blind"}
    compared = []
    for row in rows:
        way = free.get((row["scene"], row["seed"]))
        sides = [row[name] for name in _SIDES]
        of_free = rounded(row["travelled_m"] / way, 4) if way else None
        compared.append(row | {"way_fraction": of_free, "obstacle_force_n": rounded(float(np.mean(sides)))})
    by, totals = ("scene", "profile", "restrictions"), ("false_detections", "held")
    cells = cells_of(compared, by, _MEASURES, ("contact",), totals)
    for cell, (_, group) in zip(cells, grouped(rows, by), strict=True):
        cell |= {name: _mean([np.array(row[name]) for row in group]) for name in _SIDES}
        units = group[0]["obstacle_fraction_of_units"]
        cell["obstacle_fraction_of_units"] = {
            unit: rounded(float(np.mean([row["obstacle_fraction_of_units"][unit] for row in group])), 5)
            for unit in units
        }
    return {"cells": cells}


def tables(part: Row) -> list[TextTable]:
    """Show what the units see and what it costs, then which unit and which axis it concerns."""
    cells = [cell for cell in part["cells"] if profile(cell["profile"]).perception is not None]
    many = len({cell["restrictions"] for cell in cells}) > 1
    return [_shares(cells, many), _sides(cells, many)]


_NAME_WIDTH = 17
"""Characters of the profile's column at most: the table keeps to 80."""


def _names(many: bool) -> tuple[Column, ...]:
    """Scene and profile, the profile with its restriction mode if there are many and without filter if it has none."""

    def controller(cell: Row) -> str:
        name = cell["profile"].removesuffix(_UNFILTERED)
        mode = [cell["restrictions"]] if many else []
        filtered = [] if name == cell["profile"] else ["no filter"]
        return "\n".join(fill(part, _NAME_WIDTH) for part in [*name.split(":"), *mode, *filtered])

    return ("scene", plain("scene")), ("profile", controller)


def _shares(cells: list[Row], many: bool) -> TextTable:
    columns = (
        *_names(many),
        ("target\n[%]", median("target_fraction", 1, 100)),
        ("arm\n[%]", median("arm_fraction", 1, 100)),
        ("room\n[%]", median("room_fraction", 1, 100)),
        ("else\n[%]", median("unpredicted_fraction", 2, 100)),
        ("cut\n[%]", median("cut_fraction", 1, 100)),
        ("obst.\n[%]", median("obstacle_fraction", 2, 100)),
        ("way\n[%]", median("way_fraction", 0, 100)),
        ("speed\nleast", lambda cell: f"{number(cell['speed_scale'], 2)}\n{number(cell['least_speed_scale'], 2)}"),
        ("false", plain("false_detections")),
        ("hit\n[%]", plain("contact_fraction", ".0f", 100)),
    )
    return tabulated(
        "An empty room: what the units see of the arm and of the floor, medians",
        columns,
        cells,
        "Of all readings: target: those with one; arm, room: those the model predicts to be the arm, or floor and"
        " pedestal; else: neither, what the filter leaves; obst.: those the controller took for obstacles, held over"
        " missed readings. Cut is the filter's price: of all views, with a target or not, those in which what is"
        " predicted, less the margin, is nearer than d_max of eq. 3; an object behind it that should slow the arm could"
        " not be distinguished from the arm or the room. It is counted whether the filter is on or not. Way: travelled"
        " in 40 s, of the way of blind. Speed: median and least factor of eqs. 3 and 4. False: contacts detected. Low:"
        " the arm stands on a table and moves 0.1 m above it; down: so too, with one more unit that looks down out of"
        " the robot's hand.",
    )


def _sides(cells: list[Row], many: bool) -> TextTable:
    def lowered(axis: int) -> Callable[[Row], str]:
        return lambda cell: "\n".join(f"{cell[name][axis]:.2f}" for name in reversed(_SIDES))

    def most(cell: Row) -> tuple[str, float]:
        unit, share = max(cell["obstacle_fraction_of_units"].items(), key=lambda item: item[1])
        return (unit if share else "-"), share

    columns = (
        *_names(many),
        *((f"-{axis}, +{axis}\n[N]", lowered(k)) for k, axis in enumerate("xyz")),
        ("unit", lambda cell: most(cell)[0]),
        ("obst.\n[%]", lambda cell: f"{100 * most(cell)[1]:.1f}"),
    )
    return tabulated(
        "An empty room: mean lowering of the thresholds, and the unit that shows most of it",
        columns,
        cells,
        "F_obs of eq. 11 for objects on the negative (above) and positive (below) side of each axis, of 4 N at most,"
        " mean over the time. Unit: the one with the most readings taken for obstacles, and their share of its own.",
    )


EXPERIMENT = Experiment(NAME, cells, trial, lambda _: _DURATION_S, summarise, tables)
