"""Paper V-C, threshold close-up: a person stands on one side of the circle and pushes the arm from the other."""

import numpy as np

from pretouch.control.path import Circle
from pretouch.sim.hand import FACES, Push, Pusher, against
from pretouch.sim.scene import Box, HandSpec, SceneSpec
from pretouch.text_table import TextTable
from pretouch.types import ControlStep
from pretouch_lab.experiment import Context, Drawing, Experiment, controllers, first_sensing
from pretouch_lab.experiments.dynamic import NOTICE_S, REBOUND_S
from pretouch_lab.run import Row
from pretouch_lab.table import Column, medians, rounded
from pretouch_lab.trial import Record, play

_DURATION_S = 12.0
_REACH_M = 0.25
"""Largest y of the end-effector on the circle [m]."""
_BEYOND_M = (0.3, 0.4)
"""Range of the distance from there to the body's surface [m]."""
_BODY_HALF_SIZE_M = (0.2, 0.12, 0.75)
"""Half the size of a person's trunk and legs, on the floor [m]."""
_BODY_STIFFNESS_N_PER_M = 25_000.0
"""Contact stiffness of a chest [N/m] (ISO/TS 15066, annex A)."""
_ASIDE_M = 0.05
"""Largest shift of the body along x by the seed [m]."""
_START_S = (5.0, 7.0)
"""Range of the time at which the person reaches for the arm [s]."""
_FACE = FACES[0]
"""Right face of the robot's hand, pushed along +y of the base."""
_FORCE_N = (15.0, 30.0)
_LASTING_S = (0.2, 0.5)
_Y = 1


def interaction(seed: int) -> tuple[Box, Push]:
    """Draw the place of the body at +y, and the push of the hand from -y."""
    rng = np.random.default_rng([seed, 61])
    face = _REACH_M + rng.uniform(*_BEYOND_M)
    center = (
        0.5 + _ASIDE_M * rng.uniform(-1, 1),
        face + _BODY_HALF_SIZE_M[1],
        SceneSpec.floor_height + _BODY_HALF_SIZE_M[2],
    )
    inwards = against(_FACE, rng)
    push = Push(rng.uniform(*_START_S), inwards, rng.uniform(*_FORCE_N), rng.uniform(*_LASTING_S))
    return Box("body", center, _BODY_HALF_SIZE_M, _BODY_STIFFNESS_N_PER_M), push


def trial(cell: Row, seed: int, context: Context) -> tuple[Row, Record]:
    """Run one trial; return its row and its record."""
    body, push = interaction(seed)
    person = Pusher(context.model, (push,))
    setup = context.setup(cell, seed, SceneSpec(boxes=(body,), hand=HandSpec()), Circle(), hand=person)
    record = play(setup, lambda step, _: step.stamp >= _DURATION_S)
    touched = person.contacts[0] if person.contacts else None
    row = {
        "body_m": rounded(body.center[_Y] - body.half_size[_Y]),
        "push_n": rounded(push.force),
        "push_s": rounded(push.duration),
        **results(record, touched),
    }
    return row, record


def results(record: Record, touched: tuple[float, float] | None) -> Row:
    """Return the measures of a trial; `touched` is touch and release [s] of the push, None without contact."""
    touch, release = touched or (np.inf, np.inf)
    before = [s for s in record.steps if s.armed and s.stamp < touch]
    answer = next((s for s in record.reactions() if touch <= s.stamp <= release + NOTICE_S), None)
    return {
        "contact": touched is not None,
        "both_lowered": any(map(lowered_on_both_sides, before)),
        "both_lowered_at_touch": lowered_on_both_sides(before[-1]) if touched and before else None,
        "detected": answer is not None,
        "detection_delay_s": None if answer is None else rounded(answer.stamp - touch, 4),
        "filtered_at_detection_n": None if answer is None else rounded(float(answer.filtered_force[_Y])),
        "raw_at_detection_n": None if answer is None else rounded(float(answer.force[_Y])),
        "false_detections": sum(not touch <= s.stamp <= release + REBOUND_S for s in record.reactions()),
        "held": record.held(),
    }


def lowered_on_both_sides(step: ControlStep) -> bool:
    """Return True if objects on both sides narrow the band along y from above and from below."""
    return bool(step.thresholds.obstacle_positive[_Y] > 0 and step.thresholds.obstacle_negative[_Y] > 0)


_COLUMNS = (
    Column("profile\nmode", "profile", second="restrictions"),
    Column("both\never", "both_lowered", of="trials"),
    Column("both at\ntouch", "both_lowered_at_touch", of="contact"),
    Column("detected", "detected", of="contact"),
    Column("delay\n[ms]", "detection_delay_s", 0, 1000.0),
    Column("filtered\n[N]", "filtered_at_detection_n", 1),
    Column("false", "false_detections"),
)


def tables(rows: list[Row]) -> list[TextTable]:
    """Return a table of the trials with a band narrowed from both sides, and of detected pushes."""
    note = (
        "Both: trials in which objects narrowed the band along y from above and below at once, at any time before the"
        " push, and at its touch. Detected: of the pushes that touched. Filtered (eq. 8): along y, at detection."
    )
    title = "A person stands at +y and pushes the arm from -y: medians"
    return [medians(title, _COLUMNS, rows, ("profile", "restrictions"), note)]


_FIGURE = Drawing("close-up", "Distances and thresholds with objects on both sides", first_sensing)
EXPERIMENT = Experiment("between", lambda options: controllers(options, "slack"), trial, tables, _FIGURE)
