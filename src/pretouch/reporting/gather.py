"""One pass over a recording, in batches so that an hour of it fits into memory as arrays."""

from collections.abc import Iterator, Sequence
from itertools import groupby, islice
from typing import TYPE_CHECKING

import numpy as np

from pretouch.explanation import answers
from pretouch.recording.run_record import Columns, TrueForces, columns_of, contacts_of
from pretouch.reporting.course import NO_READING, OUTCOMES, Course
from pretouch.robot.model import RobotModel
from pretouch.types import FloatArray, Inputs, RangeReadings

if TYPE_CHECKING:
    from pretouch.recording.reader import Kept, Recorded, Run

_BATCH = 4096
"""Cycles that are held as objects at a time."""


def gather(recorded: "Recorded") -> Course:
    """Read all cycles of a recording: of one arm and one skin, which runs do not change."""
    blocks, events, reasons, contacts, truths = [], [], [], [], []
    done = 0
    for batch in _batches(recorded):
        run = recorded.runs[batch[0].run]
        blocks.append(_block(batch, run))
        events += [kept.step.event for kept in batch]
        reasons += [kept.step.reason for kept in batch]
        contacts += contacts_of([kept.step for kept in batch], done)
        truths.append(_truth(batch, run))
        done += len(batch)
    joined = {name: np.concatenate([block[name] for block in blocks]) for name in blocks[0]}
    return Course(
        runs=tuple(recorded.runs), units=recorded.runs[0].skin.ids, links=recorded.runs[0].model.links,
        event=tuple(events),
        reason=tuple(reasons), contacts=tuple(contacts), truth=_joined(truths), **joined,
    )  # fmt: skip


def _batches(recorded: "Recorded") -> Iterator[list["Kept"]]:
    """Cycles of one run each, no more than `_BATCH` at a time."""
    for _, cycles in groupby(recorded, key=lambda kept: kept.run):
        while batch := list(islice(cycles, _BATCH)):
            yield batch


def _block(batch: list["Kept"], run: "Run") -> Columns:
    """Arrays of a batch of one run."""
    steps = [kept.step for kept in batch]
    q, q_commanded = np.array([s.q for s in steps]), np.array([s.q_commanded for s in steps])
    command = np.array([s.command for s in steps])
    return {
        **columns_of(steps),
        "run": np.full(len(batch), batch[0].run),
        "answering": np.array([answers(s) for s in steps]),
        "detectable_n": np.array([s.detectable_n for s in steps]),
        "restricted": np.array([len(s.restricted) for s in steps]),
        "outcome": np.array([OUTCOMES.index(s.qp.outcome) for s in steps]),
        "slack": np.array([np.max(s.qp.slack, initial=0.0) for s in steps]),
        "q_margin": _margin(q_commanded, run.model),
        "q_margin_measured": _margin(q, run.model),
        "command": command,
        "speed_limit": _speed_limit(q_commanded, command, run.model),
        **_near(batch, run),
        **_given([kept.inputs for kept in batch], len(run.skin)),
    }


def _near(batch: list["Kept"], run: "Run") -> Columns:
    """What was sensed, as the least distance of each step by unit and by link, and the nearest point."""
    seen = [kept.step.obstacles for kept in batch]
    row = np.repeat(np.arange(len(seen)), [len(o.unit) for o in seen])
    unit = np.concatenate([o.unit for o in seen])
    link = np.concatenate([o.link for o in seen])
    body = np.concatenate([o.body_distance for o in seen])
    ee = np.concatenate([o.ee_distance for o in seen])
    point = np.concatenate([o.point for o in seen]).reshape(-1, 3)
    by_unit = np.full((len(seen), len(run.skin)), np.nan)
    by_link = np.full((len(seen), len(run.model.links)), np.nan)
    own = unit < len(run.skin)  # what outside sources see is of no unit
    np.fmin.at(by_unit, (row[own], unit[own]), body[own])
    np.fmin.at(by_link, (row, link), body)
    nearest, where = np.full(len(seen), np.nan), np.full((len(seen), 3), np.nan)
    farthest_first = np.argsort(-ee, kind="stable")  # of several entries for a row the last one stays
    farthest_first = farthest_first[np.isfinite(ee[farthest_first])]
    nearest[row[farthest_first]], where[row[farthest_first]] = ee[farthest_first], point[farthest_first]
    return {"body_distance": by_unit, "link_distance": by_link, "ee_distance": nearest, "nearest_point": where}


def _given(inputs: Sequence[Inputs | None], units: int) -> Columns:
    """What the steps were given; inputs that a controller could not use may hold anything."""
    nothing, none = np.full(units, np.nan), np.full(units, NO_READING)
    readings = [_readings(i, units) for i in inputs]
    return {
        "given": np.array([i is not None for i in inputs]),
        "robot_stamp": np.array([np.nan if i is None else float(i.robot.stamp) for i in inputs]),
        "force_missing": np.array([i is not None and i.robot.wrench is None for i in inputs]),
        "reading_stamp": np.array([r.stamp if r else nothing for r in readings]),
        "reading_distance": np.array([r.distance if r else nothing for r in readings]),
        "reading_status": np.array([r.status if r else none for r in readings]),
    }


def _readings(inputs: Inputs | None, count: int) -> RangeReadings | None:
    """Readings that fit a skin of `count` units, or None."""
    if inputs is None:
        return None
    fit = all(np.shape(part) == (count,) for part in (inputs.readings.stamp, inputs.readings.distance,
                                                      inputs.readings.status))  # fmt: skip
    return inputs.readings if fit else None


def _margin(q: FloatArray, model: RobotModel) -> FloatArray:
    """Distance (S, n) of positions from the nearer limit of each joint [rad]."""
    return np.minimum(q - model.q_min, model.q_max - q)


def _speed_limit(q: FloatArray, command: FloatArray, model: RobotModel) -> FloatArray:
    """What an arm allows its joints at positions (S, n) in the direction of the commands (S, n) [rad/s]."""
    limit = np.broadcast_to(model.description.qd_max, q.shape)
    envelope = model.description.envelope
    if envelope is None:
        return limit
    ahead = np.where(command > 0, envelope.q_upper - q, q - envelope.q_lower)
    falling = np.sqrt(envelope.slope * np.maximum(ahead, 0.0)) - envelope.offset
    return np.minimum(limit, np.maximum(falling, 0.0))


def _truth(batch: list["Kept"], run: "Run") -> TrueForces | None:
    """What is known of the true forces during a batch, None if nothing is."""
    known = [kept.truth for kept in batch if kept.truth is not None]
    if not known:
        return None
    touches = [(time, run.model.links[link], velocity) for truth in known for time, link, velocity in truth.touches]
    force = np.concatenate([truth.force for truth in known]).reshape(-1, 3)
    return TrueForces(np.concatenate([truth.time for truth in known]), force, tuple(touches))


def _joined(truths: list[TrueForces | None]) -> TrueForces | None:
    known = [truth for truth in truths if truth is not None]
    if not known:
        return None
    return TrueForces(
        np.concatenate([truth.time for truth in known]),
        np.concatenate([truth.force for truth in known]),
        tuple(touch for truth in known for touch in truth.touches),
    )
