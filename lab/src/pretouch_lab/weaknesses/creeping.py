"""A hand held still in the way: whether the arm stops before it, creeps up to it or runs into it, and goes on."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from pretouch.control.path import WayPoints
from pretouch.sim.plant import TOUCH_N, Plant
from pretouch.sim.pushes import Visit, Visitor
from pretouch.sim.scene import HandSpec, SceneSpec
from pretouch.text_table import TextTable, tabulated
from pretouch.traces import mean_over
from pretouch.types import ControlStep, FloatArray, Mode
from pretouch_lab.cell import Cell, Context, Grid
from pretouch_lab.experiment import Experiment, Picture, Sources
from pretouch_lab.paper.avoidance import gaps
from pretouch_lab.rows import Row, cells_of, grouped, peak, rounded
from pretouch_lab.tables import median, plain
from pretouch_lab.trial import Record, play

NAME = "creeping"
_MODES = ("off", "slack", "hard", "floor")

_ARRIVES_S, _LEAVES_S = 3.0, 33.0
"""The hand stays as long as an arm at 0.02 m/s, the limit of mode `floor`, needs for the 0.6 m of d_notice [s]."""
_LOOKS_S = (2, 5, 10, 20, 30)
"""Times after the hand's arrival at which its distance is taken [s]."""
_COURSE_S = np.arange(0.0, 30.5, 0.5)
"""Times after the hand's arrival at which the figure has its distance [s]."""
_LAST_S = 10.0
"""The speed of the creeping is that of the last of this before the hand leaves [s]."""
_TIME_LIMIT_S = 45.0
_PLACE_M = (0.4, -0.4, 0.557)
"""Centre of the person's hand [m]: on the course of the side of the robot's hand, where its unit looks ahead."""
_SPREAD_M = (0.02, 0.03, 0.02)
_RECOVERED = 0.9
_APART_S = 0.5
"""Touches nearer in time than this are one contact that bounces [s]."""


def cells(grid: Grid) -> list[Cell]:
    """One cell for each controller; all restriction modes if the run names none."""
    modes = replace(grid, restrictions=grid.restrictions or _MODES)
    return [Cell(NAME, profile, {"restrictions": mode}) for profile, mode in modes.controllers("slack")]


def path() -> WayPoints:
    """Return the paper's line, to and fro, begun in its middle: the arm turns at the far end as the hand comes."""
    return WayPoints(np.array([(0.4, 0.0, 0.5), (0.4, 0.5, 0.5), (0.4, -0.5, 0.5)]), closed=True)


def visit(seed: int) -> Visit:
    """Hold a hand into the line for thirty seconds, at a place that the seed varies by a few centimetres."""
    rng = np.random.default_rng([seed, 41])
    return Visit(_ARRIVES_S, _LEAVES_S, np.array(_PLACE_M) + np.array(_SPREAD_M) * rng.uniform(-1, 1, 3))


def trial(cell: Cell, seed: int, context: Context) -> tuple[Row, Record]:
    """Run one trial; return its row of results and what it left behind."""
    hand = HandSpec()
    setup = context.setup(cell, seed, SceneSpec(hand=hand), path(), hand=Visitor(context.model, (visit(seed),)))
    full_speed = setup.profile.task.speed_m_s
    record = play(setup, _done(full_speed))
    gap, towards = gaps(record, context.model, hand.radius), speed_towards(record)
    row = cell.row(seed)
    return row | results(record, gap, towards, full_speed), record


def _done(full_speed: float) -> Callable[[ControlStep, Plant], bool]:
    """End when the arm is back at speed after the hand has left, or at the time limit."""
    return lambda step, _: step.stamp >= _TIME_LIMIT_S or (step.stamp > _LEAVES_S and _recovered(step, full_speed))


def _recovered(step: ControlStep, full_speed: float) -> bool:
    """Whether the arm follows its path at 90 % of full speed [m/s]: that of a reaction does not count."""
    return step.mode is Mode.TRACK and bool(np.linalg.norm(step.ee_velocity) >= _RECOVERED * full_speed)


def speed_towards(record: Record) -> FloatArray:
    """Speed (S,) [m/s] of the end-effector towards the person's hand at each control step."""
    ahead = record.hand_position - np.array([s.ee_position for s in record.steps])
    velocity = np.array([s.ee_velocity for s in record.steps])
    return np.asarray((velocity * ahead).sum(axis=1) / np.linalg.norm(ahead, axis=1))


def results(record: Record, gap: FloatArray, towards: FloatArray, full_speed: float) -> Row:
    """Numbers of one trial from the distance (S,) [m] to the hand and the speed (S,) [m/s] towards it."""
    times, true = record.times(), np.linalg.norm(record.true_force, axis=1)
    there = (times >= _ARRIVES_S) & (times <= _LEAVES_S)
    back = next((s.stamp for s in record.steps if s.stamp > _LEAVES_S and _recovered(s, full_speed)), None)
    touches = np.array([-np.inf, *(touch.time for touch in record.touches)])
    course = {float(k): rounded(gap[np.searchsorted(times, _ARRIVES_S + k - 1e-9)], 4) for k in _COURSE_S}
    return {
        **{f"distance_{k}s_m": course[k] for k in _LOOKS_S},
        "course_m": list(course.values()),
        "least_distance_m": rounded(gap[there].min(), 4),
        "creep_m_s": rounded(float(np.median(towards[there & (times >= _LEAVES_S - _LAST_S)])), 4),
        "contact": bool((true > TOUCH_N).any()),
        "contacts": int((np.diff(touches) > _APART_S).sum()),
        "true_peak_n": rounded(peak(true)),
        "true_peak_20ms_n": rounded(peak(mean_over(true, 20))),
        "recovery_s": None if back is None else rounded(back - _LEAVES_S),
        "held": record.held(),
    }


_MEASURES = (
    *(f"distance_{k}s_m" for k in _LOOKS_S), "least_distance_m", "creep_m_s", "true_peak_n", "true_peak_20ms_n",
    "recovery_s",
)  # fmt: skip


def summarise(rows: list[Row]) -> Row:
    """Cells of the experiment, each with the median course of the distance, every half second."""
    by = ("profile", "restrictions")
    cells = cells_of(rows, by, _MEASURES, ("contact",), ("contacts", "held"))
    for cell, (_, group) in zip(cells, grouped(rows, by), strict=True):
        cell["course_m"] = [rounded(v, 4) for v in np.median([row["course_m"] for row in group], axis=0)]
    return {"cells": cells}


def tables(part: Row) -> list[TextTable]:
    """Show how near the arm came, when, and what followed."""
    columns = (
        ("profile", plain("profile")),
        ("mode", plain("restrictions")),
        *((f"{k} s\n[m]", median(f"distance_{k}s_m", 2)) for k in _LOOKS_S),
        ("least\n[m]", median("least_distance_m", 3)),
        ("creep\n[m/s]", median("creep_m_s", 3)),
        ("hit\n[%]", plain("contact_fraction", ".0f", 100)),
        ("hits", lambda cell: f"{cell['contacts'] / cell['trials']:.1f}"),
        ("true\n[N]", median("true_peak_20ms_n", 0)),
        ("back\n[s]", median("recovery_s", 1)),
        ("held", plain("held")),
    )
    table = tabulated(
        "A hand held still in the way of the line for 30 s: medians",
        columns,
        part["cells"],
        "2 s to 30 s: distance of the arm's surface from the hand so long after the hand came. Least: the least in"
        " these 30 s, negative in contact. Creep: median speed of the end-effector towards the hand in the last"
        " 10 s. Hit: trials with contact; hits: contacts a trial. True: peak of the true force, 20 ms mean. Back:"
        " from the hand's departure until 90 % of full speed. Held: trials in which the arm held.",
    )
    return [table]


_LINES = {"off": ("-", "o"), "slack": ("--", "s"), "hard": (":", "^"), "floor": ("-.", "v")}


def _draw(sources: Sources) -> list[Picture]:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7, 4.2), layout="constrained")
    axes = figure.subplots()
    for cell in sources.summary["cells"]:
        style, marker = _LINES[cell["restrictions"]]
        blind = cell["profile"] == "blind"
        axes.plot(
            _COURSE_S, cell["course_m"], ls=style, marker="x" if blind else marker, markevery=4, ms=5, lw=1.2,
            color="tab:gray" if blind else None, label=f"{cell['profile']}, {cell['restrictions']}",
        )  # fmt: skip
    axes.axhline(0.0, color="black", lw=0.8)
    axes.set(
        xlabel="time since the hand came [s]",
        ylabel="distance of arm and hand [m]",
        title="A hand held still in the way for 30 s: medians",
    )
    axes.grid(alpha=0.3)
    axes.legend()
    return [Picture("creeping", "Distance of the arm from a hand that is held still in its way", figure)]


EXPERIMENT = Experiment(NAME, cells, trial, lambda _: 35.0, summarise, tables, _draw)
