"""Joint positions that another program recorded while an arm moved: a bag, an MCAP, a CSV or a Parquet file."""

import re
from pathlib import Path

import numpy as np

from pretouch.errors import RecordingError
from pretouch.imported_data.csv import UNITS, open_table
from pretouch.imported_data.renaming import listed
from pretouch.imported_data.samples import check_exists, is_table
from pretouch.imported_data.source import Series, check_reach, in_order
from pretouch.robot.model import RobotModel
from pretouch.traces import JointTrace
from pretouch.values import value

_NUMBERED = re.compile(r"q(\d{1,2})|(?!.*finger).*joint_?(\d{1,2})")
"""Names of joints by their numbers: q1, panda_joint1, left_joint_1."""
_LATE_S = 0.5
"""How far a stamp may lie before an earlier one [s]: messages overtake each other by less, two recordings by more."""


@value
class ImportedJoints:
    """Where an arm's joints were, as another program recorded it."""

    trace: JointTrace
    """By time, on the clock of the file, in the order of the model's joints."""
    said: str
    """Where they were taken from, as the end of a sentence."""
    notes: tuple[str, ...]
    """What was found on the way and a person should know, a sentence each."""


def read_joints(place: Path, model: RobotModel, topic: str = "") -> ImportedJoints:
    """Read the positions of an arm's joints.

    Args:
        place: a CSV or Parquet file with a column of time and one for each joint (time_s, q1_rad or panda_joint1_deg),
            an MCAP file or a bag with sensor_msgs/JointState.
        model: of the arm.
        topic: of the joint states; needed if there are several.

    Raises:
        RecordingError: for what cannot be read, and for what is not clear, with the way out.
    """
    place = Path(place)
    check_exists(place)
    said, series, notes = (_of_table if is_table(place) else _of_bag)(place, model, topic)
    series, more = _usable(place, series)
    check_reach(place, series.values, model)
    return ImportedJoints(JointTrace(series.time / 1e9, series.values), said, (*notes, *more))


def _places(place: Path, names: tuple[str, ...], model: RobotModel) -> dict[int, int]:
    """Where each joint of the model that is among names stands there: by its name, or else by its number."""
    ours = {name.lower(): j for j, name in enumerate(model.joints)}
    by_name = {ours[name.lower()]: i for i, name in enumerate(names) if name.lower() in ours}
    if len(by_name) == model.n:
        return by_name
    found: dict[int, int] = {}
    for i, name in enumerate(names):
        number = _NUMBERED.fullmatch(name.lower())
        j = int(number[1] or number[2]) - 1 if number else ours.get(name.lower(), -1)
        if j in found:
            raise RecordingError(
                f"{place} names joint {j + 1} twice, {names[found[j]]!r} and {name!r}: keep the one of this arm."
            )
        if 0 <= j < model.n:
            found[j] = i
    return found


def _of_table(place: Path, model: RobotModel, topic: str) -> tuple[str, Series, tuple[str, ...]]:
    if topic:
        raise RecordingError(f"{place} is a table and has no topics: leave out --topic.")
    opened = open_table(place, example="time_s,q1_rad,q2_rad and so on")
    names = opened.names
    parted = [_parted(name.lower()) for name in names]
    times = [i for i, (base, _) in enumerate(parted) if base == "time"]
    if len(times) != 1:
        raise RecordingError(
            f"{place} has {len(times)} columns of time (it has {listed(names)}): give one named time_s, time_ms,"
            " time_us or time_ns."
        )
    places = _places(place, tuple(base for base, _ in parted), model)
    missing = [name for j, name in enumerate(model.joints) if j not in places]
    if missing:
        raise RecordingError(
            f"{place} has no column for {listed(missing)} (it has {listed(names)}): add q1_rad to q{model.n}_rad, or"
            f" {model.joints[0]}_rad and so on."
        )
    used = [times[0], *(places[j] for j in range(model.n))]
    factors = {i: _factor(place, names[i], parted[i][1], "q" if k else "time") for k, i in enumerate(used)}
    table, time, notes = opened.read(factors)
    begin = round(float(table[0, 0]) * 1e9)
    return f"the columns {names[used[1]]} to {names[used[-1]]}", Series(begin + time, table[:, 1:]), tuple(notes)


def _parted(name: str) -> tuple[str, str]:
    """Part a column's name, in lower case, into what it is and its unit, '' if it tells none."""
    base, _, unit = name.rpartition("_")
    return (base, unit) if any(unit in units for units in UNITS.values()) else (name, "")


def _factor(place: Path, name: str, unit: str, quantity: str) -> float:
    """What brings a column to SI."""
    if unit in UNITS[quantity]:
        return UNITS[quantity][unit]
    base, what = (name.rpartition("_")[0], f"the unit {unit!r}") if unit else (name, "no unit")
    ways = " or ".join(f"{base}_{known}" for known in UNITS[quantity])
    raise RecordingError(f"The column {name!r} of {place} has {what}: write {ways}.")


def _of_bag(place: Path, model: RobotModel, topic: str) -> tuple[str, Series, tuple[str, ...]]:
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    from pretouch.imported_data.bag import JOINTS, JointPicker, Topic, believed, fill, one_topic, read_errors_said

    with read_errors_said(place):
        reader = AnyReader([place], default_typestore=get_typestore(Stores.ROS2_HUMBLE))
        reader.open()
    picked = JointPicker(model.n, lambda names: _places(place, names, model))
    try:
        there = [c for c in reader.connections if c.msgcount]
        connections = one_topic(place, there, JOINTS, "--topic", topic)
        states = Topic(connections[0].topic, model.n, picked)
        fill(place, reader, connections, [states])
    finally:
        reader.close()
    if not states.logged:
        raise RecordingError(
            f"{states.name} of {place} names the joints {picked.seen()}, but {', '.join(model.joints)} are needed."
        )
    headers, notes = believed([states])
    return f"the topic {states.name}", states.series(headers), notes


def _usable(place: Path, series: Series) -> tuple[Series, tuple[str, ...]]:
    """Leave out samples that are not numbers, and sort the others by time."""
    finite = np.isfinite(series.values).all(axis=1)
    without = int(np.count_nonzero(~finite))
    said = "1 sample is" if without == 1 else f"{without} samples are"
    notes = (f"Joints: {said} not finite numbers and left out.",) if without else ()
    series = Series(series.time[finite], series.values[finite])
    _check_overlap(place, series)
    series, more = in_order(series, "Joints")
    if len(series) < 2:
        why = " ".join(
            (f"{place} has {len(series)} sample{'' if len(series) == 1 else 's'} of all joints.", *notes, *more)
        )
        raise RecordingError(f"{why} Give a longer recording, with a time of its own for each sample.")
    return series, notes + more


def _check_overlap(place: Path, series: Series) -> None:
    """Refuse a file whose time begins anew: sorted, two motions would be one."""
    back = (np.maximum.accumulate(series.time) - series.time) / 1e9 if len(series) else np.zeros(1)
    if back.max() > _LATE_S:
        first = int(np.argmax(back > _LATE_S))
        raise RecordingError(
            f"The time in {place} goes back by {back[first]:.3g} s at sample {first + 1} of {len(series)}: give one"
            " recording of one arm, cut to a part in which time never goes back."
        )
