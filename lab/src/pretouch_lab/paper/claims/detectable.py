"""The smallest push, step and ramp that is detected: near and far from an object, at rest and moving.

Known forces act on an arm that does not answer them; detectors are held against the recorded estimate afterwards.
"""

from dataclasses import dataclass, replace
from itertools import product
from typing import cast

import numpy as np

from pretouch.control.path import Circle, Path, line
from pretouch.profiles import Profile
from pretouch.sensing.skin import Skin
from pretouch.sim.scene import SceneSpec
from pretouch.types import BoolArray, FloatArray
from pretouch_lab.cell import Cell, Context, Grid
from pretouch_lab.experiment import Experiment
from pretouch_lab.paper.claims.detectable_views import detectable_tables, draw_detectable
from pretouch_lab.paper.claims.detectors import TABLE_I, Detector, Windowed, filtered, fixed, raw, raw_twice, windowed
from pretouch_lab.paper.claims.forces import Event, Shape, apply
from pretouch_lab.rows import Row, rounded, spread
from pretouch_lab.trial import Setup, play

NAME = "detectable"
PROFILE = "blind:detect.f_base_n=1000"
"""No force is a contact to this controller, so the arm goes on as if nothing had happened."""

SPEEDS_M_S = {"rest": 0.0, "slow": 0.06, "moving": 0.3}
"""Speed on the circle; slow is about what eq. 3 leaves of 0.3 m/s when an object is about to touch."""
FORCES_N = (0.0, 4.0, 6.0, 8.0, 10.0, 12.0, 14.0, 17.0, 20.0, 25.0, 30.0)
"""Sizes of pushes and steps; a push of nothing tells how often a detector fires by chance."""
RATES_N_S = (5.0, 10.0, 15.0, 20.0, 30.0, 45.0, 60.0)
SIZES: dict[Shape, tuple[float, ...]] = {"push": FORCES_N, "step": FORCES_N, "ramp": RATES_N_S}

DIRECTIONS = ("axis", "diagonal")
DETECTED_FRACTION = 0.9
"""Fraction of events from which on a size counts as detected."""
_LATE_S = 0.1
"""A push or step may be detected until this long after its end: the estimate lags [s]."""
_READY_S = 1.5
"""From then on the arm moves as it will, its window full [s]."""
_GAP_S = (1.4, 1.9)
"""Time between two events [s]: the window of 1 s holds nothing of the last one."""
_DIAGONALS = 6


@dataclass(frozen=True)
class Judge:
    """A detector with its threshold and an object near or not."""

    name: str
    object: str
    """`near` an object on both sides, `far` from any, or `any` where the detector does not care."""
    detector: Detector
    f_base_n: float
    f_obs_n: float


JUDGES = (
    *(
        Judge(name, near, detector, TABLE_I.f_base_n, f_obs)
        for name, detector in (("filtered", filtered), ("raw", raw), ("raw twice", raw_twice))
        for near, f_obs in (("far", 0.0), ("near", TABLE_I.f_d_n))
    ),
    *(Judge(f"fixed {threshold:g} N", "any", fixed, threshold, 0.0) for threshold in (12.0, 15.0, 20.0, 25.0)),
)


def cells(_grid: Grid) -> list[Cell]:
    """Every motion with every size of every shape; no profile, restriction or object of the grid matters here."""
    return [
        Cell(NAME, PROFILE, {"motion": motion, "shape": shape, "size": size})
        for motion, (shape, sizes) in product(SPEEDS_M_S, SIZES.items())
        for size in sizes
    ]


def plan(shape: Shape, size: float, seed: int) -> tuple[Event, ...]:
    """Twelve events: along the base axes both ways and along six of the twelve diagonals between two axes.

    The seed decides the order, the diagonals and the time between events, the same for all sizes.
    """
    rng = np.random.default_rng([seed, 22])
    axes, steps = np.vstack([np.eye(3), -np.eye(3)]), (-1.0, 0.0, 1.0)
    between = np.array([d for d in product(steps, repeat=3) if np.count_nonzero(d) == 2]) / np.sqrt(2)
    directions = rng.permutation(np.vstack([axes, rng.permutation(between)[:_DIAGONALS]]))
    events: list[Event] = []
    for direction, gap in zip(directions, rng.uniform(*_GAP_S, len(directions)), strict=True):
        events.append(Event(shape, size, (events[-1].end if events else _READY_S) + gap, direction))
    return tuple(events)


def path(motion: str, seed: int) -> Path:
    """Return the paper's circle, begun where the seed says, or at rest just that place."""
    circle = Circle(start_angle=np.random.default_rng([seed, 23]).uniform(0, 2 * np.pi))
    if SPEEDS_M_S[motion] > 0:
        return circle
    # an open path is at rest where it ends: one of a millimetre is over before the first event
    start, end = circle.point(0.0), circle.point(0.001)
    return line((start[0], start[1], start[2]), (end[0], end[1], end[2]))


def _profile(cell: Cell, context: Context) -> Profile:
    found, speed = context.profile(cell), SPEEDS_M_S[str(cell.where["motion"])]
    return replace(found, task=replace(found.task, speed_m_s=speed)) if speed > 0 else found


def trial(cell: Cell, seed: int, context: Context) -> tuple[Row, None]:
    """Run one trial; return its row of results. Its course is not kept."""
    events = plan(cast(Shape, cell.where["shape"]), float(cell.where["size"]), seed)
    setup = Setup(
        model=context.model,
        skin=Skin([], context.model),
        profile=_profile(cell, context),
        scene=SceneSpec(),
        path=path(str(cell.where["motion"]), seed),
        seed=seed,
        world=context.world,
        recording=context.recording,
        prepare=lambda plant, _: apply(plant, events),
    )
    record = play(setup, lambda step, _: step.stamp >= events[-1].end + 2 * _LATE_S)
    course = windowed(record.forces())
    row = {
        **cell.row(seed),
        "answers": answers(course, record.times()[-len(course.force) :], events),
        "held": record.held(),
    }
    return row, None


def answers(course: Windowed, times: FloatArray, events: tuple[Event, ...]) -> list[Row]:
    """Say how each judge answered the events along axes and those along diagonals.

    `times` (S,) are the instants of the course [s]. `firing` counts the events that began while the detector was
    firing: these it cannot tell.
    """
    found = []
    for judge, direction in product(JUDGES, DIRECTIONS):
        detected = judge.detector(course, judge.f_base_n, judge.f_obs_n)
        chosen = [event for event in events if _direction(event) == direction]
        replies = [(event, answered(detected, times, event)) for event in chosen]
        at = [(event, time) for event, time in replies if time is not None]
        found.append(
            {
                "detector": judge.name,
                "object": judge.object,
                "direction": direction,
                "events": len(chosen),
                "firing": sum(_firing(detected, times, event) for event in chosen),
                "detected": len(at),
                "delay_s": _median([time - event.start for event, time in at]),
                "reached_n": _median([event.reached_n(time) for event, time in at]),
            }
        )
    return found


def _direction(event: Event) -> str:
    return "axis" if np.count_nonzero(event.direction) == 1 else "diagonal"


def _firing(detected: BoolArray, times: FloatArray, event: Event) -> bool:
    """Whether the detector fired at the last sample before an event."""
    return bool(detected[np.searchsorted(times, event.start, side="right") - 1])


def answered(detected: BoolArray, times: FloatArray, event: Event) -> float | None:
    """Instant [s] at which a detector first fires (S,) at an event, None if it does not or was firing before."""
    last = event.start + event.rise_s if event.shape == "ramp" else event.end + _LATE_S
    during = detected & (times > event.start) & (times <= last)
    return None if _firing(detected, times, event) or not during.any() else float(times[during.argmax()])


def _median(values: list[float]) -> float | None:
    return rounded(float(np.median(values)), 4) if values else None


def summarise(rows: list[Row]) -> Row:
    """Put together what all seeds found: fractions detected by size, and the smallest size detected from there on."""
    names = ("motion", "shape", "detector", "object", "direction")
    found: dict[tuple[str, ...], dict[float, list[Row]]] = {}
    for row in rows:
        for answer in row["answers"]:
            place = tuple((row | answer)[name] for name in names)
            found.setdefault(place, {}).setdefault(row["size"], []).append(answer)
    cells = []
    for place, by_size in found.items():
        sizes = [_size(size, by_size[size]) for size in sorted(by_size)]
        smallest = smallest_detected(sizes)
        cells.append({**dict(zip(names, place, strict=True)), "smallest_detected": smallest, "sizes": sizes})
    return {"cells": cells, "trials": len(rows), "held": sum(row["held"] for row in rows)}


def _size(size: float, group: list[Row]) -> Row:
    counts = {name: sum(answer[name] for answer in group) for name in ("events", "firing", "detected")}
    measured = {
        name: spread([answer[name] for answer in group if answer[name] is not None])
        for name in ("delay_s", "reached_n")
    }
    return {"size": size, **counts, "fraction": rounded(counts["detected"] / counts["events"], 4), **measured}


def smallest_detected(sizes: list[Row]) -> float | None:
    """Return the size from which on at least nine of ten events are detected, None if those of the largest are not."""
    smallest = None
    for entry in sorted(sizes, key=lambda entry: -entry["size"]):
        if entry["detected"] < DETECTED_FRACTION * entry["events"]:
            break
        smallest = entry["size"]
    return smallest


def _cost(cell: Cell) -> float:
    """Simulated time of a trial, about [s]."""
    return plan(cast(Shape, cell.where["shape"]), float(cell.where["size"]), 0)[-1].end


EXPERIMENT = Experiment(NAME, cells, trial, _cost, summarise, detectable_tables, draw_detectable, recorded=False)
