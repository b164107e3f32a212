"""Joint positions, velocities and torques in a table: q1_rad, dq1_rad_s, tau_ext1_Nm, and Franka's names."""

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from pretouch.errors import RecordingError
from pretouch.imported_data.csv import UNITS, open_table
from pretouch.imported_data.renaming import listed
from pretouch.imported_data.source import Choice
from pretouch.types import FloatArray, IntArray
from pretouch.values import value

TORQUES = ("tau_ext", "tau", "current")
"""Kinds of torques; of those that a recording holds the first is used."""
_ANGLE, _TORQUE = {"rad": 1.0, "deg": math.pi / 180}, {"nm": 1.0, "mnm": 1e-3, "knm": 1e3}
_SPEED = {f"{unit}_s": factor for unit, factor in _ANGLE.items()}
_KINDS = {
    "q": _ANGLE, "dq": _SPEED, "dq_d": _SPEED, "tau_ext": _TORQUE, "tau": _TORQUE, "current": {"a": 1.0, "ma": 1e-3},
}  # fmt: skip
_SHOWN = {
    "q": "q1_rad", "dq": "dq1_rad_s", "dq_d": "dq_d1_rad_s", "tau_ext": "tau_ext1_Nm", "tau": "tau1_Nm",
    "current": "current1_A",
}  # fmt: skip
_OURS = re.compile(r"(dq_d|qd_d|dq|qd|q|tau_ext|tau|current)(\d{1,2})(?:_(.*))?")
_LIBFRANKA = re.compile(r"(state\.)?(dq_d|dq|q|tau_j|tau_ext_hat_filtered)(?:\[(\d)\]|_(\d))")
"""Names in the logs of libfranka, and of arrays of a `franka::RobotState` that panda-py logs."""
_OF_LIBFRANKA = {"tau_j": "tau", "tau_ext_hat_filtered": "tau_ext"}
_OF_IDENTIFY = {"qd": "dq", "qd_d": "dq_d"}


@value
class JointSource:
    """What stands in a recording of an arm's joints, in SI units. N samples of n joints."""

    said: str
    """Where it was taken from, as the end of a sentence."""
    time: IntArray
    """(N,) instants [ns], of any clock."""
    joints: dict[str, FloatArray]
    """(N, n) of each kind that is there: q, dq, dq_d, tau_ext, tau [rad, rad/s, Nm] and current [A]."""
    by_robot: bool
    """Whether the name of the external torques tells that they are by the robot on its environment."""
    arm: str
    """The arm that its joints' names tell of, or auto."""
    notes: tuple[str, ...]
    names: tuple[str, ...] = ()
    """Of the joints, where it has them."""

    def ordered(self, joints: tuple[str, ...]) -> "JointSource":
        """Return it with its joints in the order of a model's, if its names end in theirs."""
        ends = [[i for i, name in enumerate(self.names) if name.endswith(joint)] for joint in joints]
        if len(self.names) != len(joints) or any(len(found) != 1 for found in ends):
            return self
        order = [found[0] for found in ends]
        return replace(self, joints={kind: values[:, order] for kind, values in self.joints.items()}, names=joints)

    @property
    def torque(self) -> str:
        """Which of `TORQUES` is used."""
        return next(kind for kind in TORQUES if kind in self.joints)


class _Key:
    """What a column holds."""

    def __init__(self, kind: str, joint: int, factor: float, by_robot: bool = False) -> None:
        self.kind, self.joint, self.factor, self.by_robot = kind, joint, factor, by_robot


def has_torques(names: list[str]) -> bool:
    """Whether among columns there are joint positions and torques."""
    kinds = {kind for name in names if (kind := _kind(name))}
    return "q" in kinds and bool(kinds & set(TORQUES))


def _kind(name: str) -> str:
    """Kind of a column by its name, '' for another one."""
    if found := _LIBFRANKA.fullmatch(name.lower()):
        return _OF_LIBFRANKA.get(found[2], found[2])
    found = _OURS.fullmatch(name.lower())
    return _OF_IDENTIFY.get(found[1], found[1]) if found else ""


def read_joint_table(place: Path, choice: Choice) -> JointSource:
    """Read a CSV or Parquet file; RecordingError for columns that are missing, with those that are there."""
    if choice.torques or choice.joints:
        raise RecordingError(f"{place} is a table and has no topics: leave out --torques and --joints.")
    opened = open_table(place, choice.columns)
    keys = _keys(place, opened.names)
    time_at, time_factor = _time(place, opened.names)
    kinds: dict[str, list[int]] = {}
    for i, key in keys.items():
        kinds.setdefault(key.kind, []).append(i)
    used = next((kind for kind in TORQUES if kind in kinds), "")
    for kind, shown in (("q", "q1_rad"), (used, "tau_ext1_Nm or tau1_Nm")):
        if kind not in kinds:
            raise RecordingError(
                f"{place} has no column {shown} (it has {listed(opened.names)}): add them, or say which by --columns."
            )
    wanted = ["q", *(kind for kind in ("dq", "dq_d") if kind in kinds), used]
    order = {kind: sorted(kinds[kind], key=lambda i: keys[i].joint) for kind in wanted}
    for kind, places in order.items():
        numbers = [keys[i].joint for i in places]
        if numbers != list(range(1, len(order["q"]) + 1)):
            raise RecordingError(
                f"{place} has the columns {_SHOWN[kind]} of joints {', '.join(map(str, numbers))}, and positions of"
                f" {len(order['q'])} joints: give one of each for every joint from 1 on."
            )
    factors = {time_at: time_factor} | {i: keys[i].factor for places in order.values() for i in places}
    table, time, notes = opened.read(factors)
    parts = np.split(table[:, 1:], len(order), axis=1)
    first = opened.names[order[used][0]]
    return JointSource(
        f"the columns {opened.names[order['q'][0]]} and {first} ...", round(float(table[0, 0]) * 1e9) + time,
        dict(zip(order, parts, strict=True)), keys[order[used][0]].by_robot, "auto", tuple(notes),
    )  # fmt: skip


def _keys(place: Path, names: list[str]) -> dict[int, _Key]:
    """What the columns hold; of two for the same the first one counts if they are a log's, with its commands."""
    lower = [name.lower() for name in names]
    logs = [_LIBFRANKA.fullmatch(name) for name in lower]
    first = 1 if any(found and "0" in (found[3], found[4]) for found in logs) else 0
    keys: dict[int, _Key] = {}
    seen: dict[tuple[str, int], int] = {}
    for i, (name, log) in enumerate(zip(lower, logs, strict=True)):
        found = _OURS.fullmatch(name)
        if log:
            kind = _OF_LIBFRANKA.get(log[2], log[2])
            key = _Key(kind, int(log[3] or log[4]) + first, 1.0, log[2] == "tau_ext_hat_filtered")
        elif found:
            kind, unit = _OF_IDENTIFY.get(found[1], found[1]), found[3] or ""
            if unit not in _KINDS[kind]:
                what = f"the unit {unit!r}" if unit else "no unit"
                ways = " or ".join(f"{names[i][: found.end(2)]}_{shown}" for shown in _KINDS[kind])
                raise RecordingError(f"The column {names[i]!r} of {place} has {what}: write {ways}.")
            key = _Key(kind, int(found[2]), _KINDS[kind][unit])
        else:
            continue
        other = seen.setdefault((key.kind, key.joint), i)
        if other != i and not log:
            raise RecordingError(f"{place} has two columns of one thing, {names[other]!r} and {names[i]!r}: keep one.")
        if other == i:
            keys[i] = key
    return keys


def _time(place: Path, names: list[str]) -> tuple[int, float]:
    """Which column is the time, and what brings it to seconds."""
    units = UNITS["time"]
    found = [(i, units[n[5:]]) for i, n in enumerate(map(str.lower, names)) if n[:5] == "time_" and n[5:] in units]
    if not found and any(_LIBFRANKA.fullmatch(name.lower()) for name in names):
        # libfranka logs milliseconds: of `duration` up to 0.8, of `time` with the names of its newer logs
        log = "time" if any(name.startswith("state.") for name in names) else "duration"
        found = [(names.index(log), 1e-3)] if log in names else []
    if len(found) != 1:
        raise RecordingError(
            f"{place} has {len(found)} columns of time (it has {listed(names)}): give one named time_s, time_ms,"
            " time_us or time_ns."
        )
    return found[0]
