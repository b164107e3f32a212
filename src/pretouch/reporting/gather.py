"""One pass over a recording, in batches so that an hour of it fits into memory as arrays."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby, islice
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pretouch.reporting.course import MODES, NO_READING, OUTCOMES, Course, Truth
from pretouch.robot.model import RobotModel
from pretouch.types import Contact, FloatArray, Inputs, IntArray, RangeReadings

if TYPE_CHECKING:
    from pretouch.recording.reader import Kept, Recorded, Run

_BATCH = 4096
"""Cycles that are held as objects at a time."""

Block = dict[str, NDArray[Any]]


@dataclass(frozen=True)
class _Layout:
    """Columns of the arrays: all units and links of all runs, by name."""

    units: tuple[str, ...]
    links: tuple[str, ...]
    joints: int

    @classmethod
    def of(cls, runs: Sequence["Run"]) -> "_Layout":
        return cls(
            tuple(dict.fromkeys(unit for run in runs for unit in run.skin.ids)),
            tuple(dict.fromkeys(link for run in runs for link in run.model.links)),
            max((run.model.n for run in runs), default=0),
        )


def gather(recorded: "Recorded") -> Course:
    """Read all cycles of a recording."""
    layout = _Layout.of(recorded.runs)
    blocks, reasons, contacts, truths = [_empty(layout)], [], [], []
    done = 0
    for batch in _batches(recorded):
        run = recorded.runs[batch[0].run]
        blocks.append(_block(batch, run, layout))
        reasons += [kept.step.reason for kept in batch]
        contacts += _contacts(batch, done)
        truths.append(_truth(batch, run))
        done += len(batch)
    joined = {name: np.concatenate([block[name] for block in blocks]) for name in blocks[0]}
    return Course(
        runs=tuple(recorded.runs), units=layout.units, links=layout.links, reason=tuple(reasons),
        contacts=tuple(contacts), truth=_joined(truths), **joined,
    )  # fmt: skip


def _batches(recorded: "Recorded") -> Iterator[list["Kept"]]:
    """Cycles of one run each, no more than `_BATCH` at a time."""
    for _, cycles in groupby(recorded, key=lambda kept: kept.run):
        while batch := list(islice(cycles, _BATCH)):
            yield batch


def _contacts(batch: list["Kept"], before: int) -> list[tuple[int, Contact, float]]:
    return [
        (before + i, kept.step.contact, float(np.linalg.norm(kept.step.reaction_velocity)))
        for i, kept in enumerate(batch)
        if kept.step.contact is not None
    ]


def _empty(layout: _Layout) -> Block:
    """Arrays of no cycles, of the right widths and types."""
    u, n = len(layout.units), layout.joints
    widths = {
        "ee_position": 3, "path_position": 3, "force": 3, "filtered": 3, "upper": 3, "lower": 3, "sigma": 3,
        "nearest_point": 3, "body_distance": u, "range_distance": u, "reading_stamp": u, "reading_distance": u,
        "link_distance": len(layout.links), "q_margin": n, "q_margin_measured": n, "command": n, "speed_limit": n,
    }  # fmt: skip
    block: Block = {name: np.empty((0, width)) for name, width in widths.items()}
    block |= {
        name: np.empty(0)
        for name in ("time", "speed", "speed_scale", "ee_distance", "slack", "robot_stamp", "evidence")
    }
    block |= {name: np.empty(0, np.int64) for name in ("run", "mode", "restricted", "outcome")}
    block |= {name: np.empty(0, np.bool_) for name in ("armed", "given", "force_missing")}
    return block | {"reading_status": np.empty((0, u), np.int64)}


def _block(batch: list["Kept"], run: "Run", layout: _Layout) -> Block:
    """Arrays of a batch of one run."""
    steps = [kept.step for kept in batch]
    place = np.array([layout.units.index(unit) for unit in run.skin.ids], dtype=np.int64)
    q, q_commanded = np.array([s.q for s in steps]), np.array([s.q_commanded for s in steps])
    command = np.array([s.command for s in steps])
    parts = np.array([s.thresholds.parts for s in steps])
    joints = {
        "q_margin": _margin(q_commanded, run.model),
        "q_margin_measured": _margin(q, run.model),
        "command": command,
        "speed_limit": _speed_limit(q_commanded, command, run.model),
    }
    return {
        "time": np.array([s.stamp for s in steps]),
        "run": np.full(len(batch), batch[0].run),
        "mode": np.array([MODES.index(s.mode) for s in steps]),
        "ee_position": np.array([s.ee_position for s in steps]),
        "path_position": np.array([s.path_position for s in steps]),
        "speed": np.linalg.norm([s.ee_velocity for s in steps], axis=1),
        "speed_scale": np.array([s.speed_scale for s in steps], dtype=np.float64),
        "force": np.array([s.force for s in steps]),
        "filtered": np.array([s.filtered_force for s in steps]),
        "upper": parts[:, 0],
        "lower": parts[:, 1],
        "sigma": parts[:, 3],
        "evidence": np.array([s.evidence for s in steps], dtype=np.float64),
        "armed": np.array([s.armed for s in steps]),
        "range_distance": _spread([s.range_distance for s in steps], place, len(layout.units)),
        "restricted": np.array([len(s.restricted) for s in steps]),
        "outcome": np.array([OUTCOMES.index(s.qp.outcome) for s in steps]),
        "slack": np.array([np.max(s.qp.slack, initial=0.0) for s in steps]),
        **{name: _padded(values, layout.joints) for name, values in joints.items()},
        **_near(batch, run, layout, place),
        **_given([kept.inputs for kept in batch], place, len(layout.units)),
    }


def _near(batch: list["Kept"], run: "Run", layout: _Layout, place: IntArray) -> Block:
    """What was sensed, as the least distance of each step by unit and by link, and the nearest point."""
    seen = [kept.step.obstacles for kept in batch]
    row = np.repeat(np.arange(len(seen)), [len(o.unit) for o in seen])
    unit = np.concatenate([o.unit for o in seen])
    link = np.concatenate([o.link for o in seen])
    body = np.concatenate([o.body_distance for o in seen])
    ee = np.concatenate([o.ee_distance for o in seen])
    point = np.concatenate([o.point for o in seen]).reshape(-1, 3)
    names = np.array([layout.links.index(name) for name in run.model.links], dtype=np.int64)
    by_unit = np.full((len(seen), len(layout.units)), np.nan)
    by_link = np.full((len(seen), len(layout.links)), np.nan)
    own = unit < len(place)  # what outside sources see is of no unit
    np.fmin.at(by_unit, (row[own], place[unit[own]]), body[own])
    np.fmin.at(by_link, (row, names[link]), body)
    nearest, where = np.full(len(seen), np.nan), np.full((len(seen), 3), np.nan)
    farthest_first = np.argsort(-ee, kind="stable")  # of several entries for a row the last one stays
    farthest_first = farthest_first[np.isfinite(ee[farthest_first])]
    nearest[row[farthest_first]], where[row[farthest_first]] = ee[farthest_first], point[farthest_first]
    return {"body_distance": by_unit, "link_distance": by_link, "ee_distance": nearest, "nearest_point": where}


def _given(inputs: Sequence[Inputs | None], place: IntArray, units: int) -> Block:
    """What the steps were given; inputs that a controller could not use may hold anything."""
    nothing = np.full(len(place), np.nan)
    none = np.full(len(place), NO_READING)
    readings = [_readings(i, len(place)) for i in inputs]
    return {
        "given": np.array([i is not None for i in inputs]),
        "robot_stamp": np.array([np.nan if i is None else float(i.robot.stamp) for i in inputs]),
        "force_missing": np.array([i is not None and i.robot.wrench is None for i in inputs]),
        "reading_stamp": _spread([r.stamp if r else nothing for r in readings], place, units),
        "reading_distance": _spread([r.distance if r else nothing for r in readings], place, units),
        "reading_status": _spread([r.status if r else none for r in readings], place, units, NO_READING),
    }


def _readings(inputs: Inputs | None, count: int) -> RangeReadings | None:
    """Readings that fit a skin of `count` units, or None."""
    if inputs is None:
        return None
    fit = all(np.shape(part) == (count,) for part in (inputs.readings.stamp, inputs.readings.distance,
                                                      inputs.readings.status))  # fmt: skip
    return inputs.readings if fit else None


def _spread(rows: Sequence[NDArray[Any]], place: IntArray, width: int, nothing: Any = np.nan) -> NDArray[Any]:
    """Rows (S, K) of a skin's units, each unit in the column of its name."""
    spread = np.full((len(rows), width), nothing)
    spread[:, place] = np.array(rows).reshape(len(rows), len(place))
    return spread


def _padded(values: FloatArray, width: int) -> FloatArray:
    """Columns of NaN added on the right, up to a width."""
    return np.pad(values, ((0, 0), (0, width - values.shape[1])), constant_values=np.nan)


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


def _truth(batch: list["Kept"], run: "Run") -> Truth | None:
    """What is known of the true forces during a batch, None if nothing is."""
    known = [kept.truth for kept in batch if kept.truth is not None]
    if not known:
        return None
    touches = [(time, run.model.links[link], velocity) for truth in known for time, link, velocity in truth.touches]
    force = np.concatenate([truth.force for truth in known]).reshape(-1, 3)
    return Truth(np.concatenate([truth.time for truth in known]), force, tuple(touches))


def _joined(truths: list[Truth | None]) -> Truth | None:
    known = [truth for truth in truths if truth is not None]
    if not known:
        return None
    return Truth(
        np.concatenate([truth.time for truth in known]),
        np.concatenate([truth.force for truth in known]),
        tuple(touch for truth in known for touch in truth.touches),
    )
