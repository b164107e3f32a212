"""Paper IV-C: thirty seconds with a person who pushes the moving arm three times from different directions."""

import numpy as np

from pretouch.sim.hand import Push, Pusher
from pretouch.sim.paper_scenes import dynamic_pushes
from pretouch.sim.scene import HandSpec, SceneSpec
from pretouch.text_table import TextTable
from pretouch.traces import mean_over
from pretouch.types import ControlStep, FloatArray
from pretouch_lab.experiment import Context, Drawing, Experiment, controllers, first_sensing
from pretouch_lab.run import Row
from pretouch_lab.table import Column, peak, rounded, summary, table
from pretouch_lab.trial import Record, play

_DURATION_S = 30.0
NOTICE_S = 0.3
"""Longest time from the release to a reaction to the push [s]."""
REBOUND_S = 3.0
"""Longest time from the release to a repeated reaction, the push's echo [s]."""


def trial(cell: Row, seed: int, context: Context) -> tuple[Row, Record]:
    """Run one trial; return its row and its record."""
    person, path = Pusher(context.model, dynamic_pushes(seed)), context.placement.path("circle", -1.0)
    setup = context.setup(cell, seed, SceneSpec(hand=HandSpec()), path, hand=person)
    record = play(setup, lambda step, _: step.stamp >= _DURATION_S)
    true = np.linalg.norm(record.true_force, axis=1)
    beginnings, spans = record.beginnings(), [span for span in person.contacts if span is not None]
    reactions = [step for step, _ in beginnings]
    missing = [None] * (len(person.pushes) - len(person.contacts))
    pushed = [s for s in record.steps if any(a <= s.stamp <= b for a, b in spans)]
    estimate = np.array([np.linalg.norm(s.force) for s in pushed])
    row = {
        "contact": bool(spans),
        **_at_detection(reactions, spans),
        "contacts": [
            _contact(record, beginnings, push, touched)
            for push, touched in zip(person.pushes, [*person.contacts, *missing], strict=True)
        ],
        "peak_estimate_n": rounded(peak(estimate[np.isfinite(estimate)])),
        "true_peak_20ms_n": rounded(peak(mean_over(true, 20))),
        "true_peak_n": rounded(peak(true)),
        "false_detections": sum(not any(a <= s.stamp <= b + REBOUND_S for a, b in spans) for s in reactions),
        "held": record.held(),
    }
    return row, record


def _at_detection(reactions: list[ControlStep], spans: list[tuple[float, float]]) -> dict[str, float | None]:
    """Return medians over detected pushes: delay [s], and norms of the filtered and the raw estimate [N]."""
    reached = [(s, next((a for a, b in spans if a <= s.stamp <= b + NOTICE_S), None)) for s in reactions]
    rows = [
        (s.stamp - touch, float(np.linalg.norm(s.filtered_force)), float(np.linalg.norm(s.force)))
        for s, touch in reached
        if touch is not None
    ]
    names = ("detection_delay_s", "filtered_at_detection_n", "raw_at_detection_n")
    medians = np.median(np.array(rows), axis=0).tolist() if rows else [None] * len(names)
    return {name: None if v is None else rounded(v, 4) for name, v in zip(names, medians, strict=True)}


def _contact(
    record: Record, beginnings: list[tuple[ControlStep, FloatArray]], push: Push, touched: tuple[float, float] | None
) -> Row:
    """Return the measures of the reaction to one push."""
    row: Row = {
        "detected": False,
        "delay_s": None,
        "direction_error_deg": None,
        "push_n": rounded(push.force),
        "push_s": rounded(push.duration),
        "reaction_towards_person": False,
    }
    if touched is None:
        return row | {"push_s": 0.0}
    touch, release = touched
    later = [t.time for t in record.touches if t.time > release]  # the floor, say: answered by itself
    end = min([release + REBOUND_S, *later])
    answers = [(s, v) for s, v in beginnings if touch <= s.stamp <= end]
    pushed = _mean_force(record, touch, release)
    row["reaction_towards_person"] = any(float(v @ pushed) < 0 for _, v in answers)
    if answers and answers[0][0].stamp <= release + NOTICE_S:
        first, velocity = answers[0]
        row |= {"detected": True, "delay_s": rounded(first.stamp - touch, 4)}
        angle = angle_deg(velocity, _mean_force(record, max(touch, first.stamp - 0.05), first.stamp))
        row["direction_error_deg"] = None if angle is None else rounded(angle, 2)
    return row


def angle_deg(a: FloatArray, b: FloatArray) -> float | None:
    """Angle between two vectors (3,) [deg], None if one of them is zero."""
    sizes = float(np.linalg.norm(a) * np.linalg.norm(b))
    return float(np.degrees(np.arccos(np.clip(a @ b / sizes, -1.0, 1.0)))) if sizes > 0 else None


def _mean_force(record: Record, start: float, end: float) -> FloatArray:
    """Mean true force (3,) [N] between two instants [s]."""
    during = (record.true_time >= start) & (record.true_time <= end)
    return np.asarray(record.true_force[during].mean(axis=0))


_COLUMNS = (
    Column("profile\nmode", "profile", second="restrictions"),
    Column("detected", "detected", of="pushes"),
    Column("delay\n[ms]", "delay_s", 0, 1000.0),
    Column("direction\n[deg]", "direction_error_deg", 1),
    Column("peak\n[N]", "peak_estimate_n", 1),
    Column("towards\nperson", "reaction_towards_person"),
    Column("false", "false_detections"),
)


def tables(rows: list[Row]) -> list[TextTable]:
    """Return a table of the reactions to the pushes of all trials."""
    by = ("profile", "restrictions")
    pushes = [row | contact | {"pushes": 1} for row in rows for contact in row["contacts"]]
    counts = ("pushes", "detected", "reaction_towards_person")
    of_pushes = summary(pushes, by, ("delay_s", "direction_error_deg"), counts)
    of_trials = summary(rows, by, ("peak_estimate_n",), ("false_detections",))
    note = (
        "Pushes of 15 to 30 N for 0.2 to 0.5 s. Direction: angle from true force to reaction. Peak: of the estimate."
        " Towards person: pushes with a reaction that began against the push."
    )
    groups = [one | other for one, other in zip(of_pushes, of_trials, strict=True)]
    return [table("A person pushes the moving arm: medians", _COLUMNS, groups, note)]


_FIGURE = Drawing("interaction", "Distances, force with thresholds, velocity over thirty seconds", first_sensing)
EXPERIMENT = Experiment("dynamic", lambda options: controllers(options, "slack"), trial, tables, _FIGURE, any_arm=True)
