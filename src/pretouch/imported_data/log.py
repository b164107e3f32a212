"""A log of another program: what stands in it by kind, in SI units but in its own sign and frame."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from pretouch.errors import RecordingError
from pretouch.robot.description import robot_named
from pretouch.robot.model import RobotModel
from pretouch.traces import spans
from pretouch.types import BoolArray, FloatArray, IntArray
from pretouch.values import value

TORQUES = ("tau_ext", "tau", "current")
"""Kinds of joint torques; of those that a log holds the first is used."""
BAGS = (".mcap", ".db3", ".bag")
TABLES = (".csv", ".tsv", ".txt")
PARQUET = ".parquet"
_LATE_S = 0.5
"""How far a stamp may lie before an earlier one [s]: messages overtake each other by less, two recordings by more."""
_COUNTERS_S = tuple(2**bits * tick for bits in (16, 24, 32) for tick in (1e-9, 1e-6, 1e-5, 1e-4, 1e-3))
"""Times after which counters of 16, 24 and 32 bits begin anew [s]."""
_CLOCKS_S = (1.0, 60.0, 3600.0, 43_200.0, 86_400.0, 604_800.0)
"""Times after which clocks without a date do [s], as the seconds of a minute or of a week."""
_WRAP_S = 0.1
"""Longest time without a sample over which a clock that begins anew goes on [s]."""
_REPEATED_S, _TURNED_RAD = 0.5, 0.1
"""Time for which values that repeat to the last digit are no measurement [s], and how far from its neighbours in time
a posture is which the arm did not have [rad]."""
_MOVING_RAD_S = 0.02
"""Speed of a joint at which its position cannot stay the same [rad/s]."""
_OUT_OF_RANGE_RAD = 0.5
"""Joint positions this far beyond the arm's range [rad] are of another unit or arm."""
_TWO_TURNS_RAD = 12.5
"""Range from which a joint may turn without end [rad]: `pretouch robot import` gives an endless one two turns."""
GAP_S = 0.1
"""Time without a sample after which a recording begins anew [s]."""
_NUMBERED = re.compile(r"(.*?)(\d{1,2})(\D*)")


@dataclass(frozen=True, kw_only=True)
class Choice:
    """Facts that a log does not contain: options of `pretouch detect`."""

    sign: Literal["auto", "on-robot", "by-robot"] = "auto"
    """Sign of force and external torques: on the robot (by its environment), or by the robot, as Franka's
    O_F_ext_hat_K; auto: on the robot, but for torques by the name tau_ext_hat_filtered."""
    frame: Literal["base", "ee"] = "base"
    """Frame of the force; ee, the end-effector's, needs joint positions of a Panda or FR3."""
    zeros: Literal["auto", "missing", "kept"] = "auto"
    """Meaning of six zeros: a missing estimate, or a force of zero; auto: missing with --sign by-robot."""
    wrench: str = ""
    """Topic of the force, if there are several."""
    joints: str = ""
    """Topic of the joint positions, if there are several."""
    stamps: Literal["auto", "headers", "recording"] = "auto"
    """Times of the messages of a bag: of their headers, or of the recording; auto: of the headers, if they go on."""
    torques: str = ""
    """Topic of the joint torques: JointState with efforts, FrankaState or FrankaRobotState; by default the one that the
    recording has."""
    arm: str | RobotModel = "auto"
    """The arm, or its name or the folder it was imported to; auto: by the names of its joints, otherwise a Panda."""
    gravity: tuple[float, ...] = ()
    """Direction of gravity in the arm's base frame, of any length: 0,0,1 for an arm that hangs; by default the arm's
    own, or the one that measured torques tell."""
    columns: str = ""
    """Columns of other names, THEIRS=OURS separated by commas: tau_J_0=tau1_Nm; tau_J_*=tau*_Nm is all joints."""
    gains: tuple[float, ...] = ()
    """Torque of each joint by its motor's current, gear and sign included [Nm/A]: for current1_A."""
    payload: float = 0.0
    """Load at the end-effector that the arm's model does not have [kg]: for measured torques."""


@value
class Note:
    """Remark for a person on a log or a result: a code with its numbers and names."""

    code: str
    values: Mapping[str, float | str]


@value
class Log:
    """N samples of what a log holds."""

    place: Path
    model: RobotModel
    """The arm whose joints these are."""
    time: IntArray
    """(N,) [ns], of any clock."""
    rows: IntArray
    """(N,) numbers of the lines, rows or messages."""
    row: str
    """Name of one of them, as `line {}`."""
    arrays: dict[str, FloatArray]
    """By kind, NaN where there is no value: `force` (N, 3) [N], `torque` (N, 3) [Nm]; of the n joints of the model, in
    its order, `q`, `dq`, `dq_d`, `tau_ext`, `tau` (N, n) [rad, rad/s, Nm] and `current` [A]."""
    sources: dict[str, str]
    """Topic or first column that the values come from, by kind."""
    frame_id: str = ""
    """Frame that the log names for the force."""
    by_robot: bool = False
    """True if the name of the external torques tells that they are by the robot on its environment."""
    notes: tuple[Note, ...] = ()

    def __len__(self) -> int:
        return len(self.time)

    @property
    def usual_s(self) -> float:
        """Median time between two samples whose times are not the same [s]."""
        steps = np.diff(self.time)
        return float(np.median(steps[steps > 0])) / 1e9 if (steps > 0).any() else 0.0

    def noted(self, *notes: Note) -> "Log":
        """Return it with further notes."""
        return replace(self, notes=(*self.notes, *notes))

    def counted(self, code: str, which: BoolArray, **more: float) -> list[Note]:
        """Note how many samples (N,) are of a kind, and the first of them; nothing where there is none."""
        count = int(np.count_nonzero(which))
        return [Note(code, {"count": count, "first": self._where(int(np.argmax(which))), **more})] if count else []

    def at(self, rows: IntArray) -> "Log":
        """Return some of its samples."""
        arrays = {kind: values[rows] for kind, values in self.arrays.items()}
        return replace(self, time=self.time[rows], rows=self.rows[rows], arrays=arrays)

    def without(self, code: str, which: BoolArray) -> "Log":
        """Return it without some of its samples (N,), and note how many these are."""
        return self.at(np.flatnonzero(~which)).noted(*self.counted(code, which)) if which.any() else self

    def forward(self) -> "Log":
        """Return it with the wraps of its clock undone. RecordingError where its time goes back: it begins anew."""
        time, period = unwrapped(self.time)
        back = _back(time) > _LATE_S
        if back.any():
            i = int(np.argmax(back))
            raise RecordingError(
                f"{self.place}, {self._where(i)}: the time goes back by {_back(time)[i]:.3g} s: give one recording, cut"
                " to a part in which time never goes back."
            )
        wraps = np.append(False, np.diff(time) != np.diff(self.time))
        return replace(self, time=time).noted(*self.counted("wraps", wraps, period=period))

    def in_order(self, *kinds: str) -> "Log":
        """Return its measurements by time, the later of two at one instant counting, all of them finite in some kinds.

        Left out are also values that are none: zeros of all joints, and what repeats itself while the arm moves. Raises
        RecordingError if its time goes back or stands still, or fewer than two samples are left.
        """
        log = self.forward()
        for code, mask in (("zeros", Log._zeros), ("repeats", Log._repeats)):
            for kind in sorted({*(kinds or self.arrays)} & {"force", "q", *TORQUES}):
                log = log.without(code, mask(log, kind))
        if kinds:
            finite = np.isfinite(np.hstack([log.arrays[kind] for kind in kinds]))
            log = log.without("not_finite", np.asarray(~finite.all(axis=1)))
        if notes := log.counted("sorted", np.append(False, np.diff(log.time) < 0)[: len(log)]):
            log = log.at(np.argsort(log.time, kind="stable")).noted(*notes)
        doubles = np.append(np.diff(log.time) == 0, False)[: len(log)]
        most = _LATE_S / max(log.usual_s, 1e-9)
        for begin, end in spans(doubles):
            if end - begin > most:
                raise RecordingError(
                    f"{self.place}, {log._where(begin)}: the time stands still for {end - begin + 1} samples: give a"
                    " time of its own for each."
                )
        log = log.without("repeated", doubles)
        if len(log) < 2:
            lost = [f", {n.values['count']} {n.code.replace('_', ' ')}" for n in log.notes if "count" in n.values]
            raise RecordingError(
                f"{self.place} has {len(self)} samples, and {len(log)} of them {'is' if len(log) == 1 else 'are'}"
                f" usable{''.join(lost)}: give a longer recording, of finite numbers and with a time of its own for"
                " each sample."
            )
        return log

    def _where(self, i: int) -> str:
        return self.row.format(self.rows[i])

    def _zeros(self, kind: str) -> BoolArray:
        """Mask of samples (N,) in which all joints are at zero, where they cannot have been, or have no torque."""
        values = self.arrays[kind]
        zero = np.asarray(~values.any(axis=1))
        if kind == "q":
            for begin, end in spans(zero):
                beside = np.abs(values[[i for i in (begin - 1, end) if 0 <= i < len(self)]])
                zero[begin:end] = not len(beside) or (beside.max(axis=1) > _TURNED_RAD).any()
        return zero if kind in ("q", "tau", "current") else np.zeros(len(self), np.bool_)

    def _repeats(self, kind: str) -> BoolArray:
        """Mask of samples (N,) that repeat the one before, to the last digit and for long, and cannot have."""
        values, q, dq = self.arrays[kind], self.arrays.get("q"), self.arrays.get("dq")
        same = np.append(False, (values[1:] == values[:-1]).all(axis=1) & values[1:].any(axis=1))[: len(self)]
        least = _REPEATED_S / max(self.usual_s, 1e-9)
        for begin, end in spans(same):
            beside = slice(begin - 1, end + (kind == "q"))  # where it goes on, the arm is elsewhere
            turned = q is None or bool((np.ptp(q[beside], axis=0) > _TURNED_RAD).any())
            moving = kind == "q" and dq is not None and bool((np.abs(dq[begin]) > _MOVING_RAD_S).any())
            same[begin:end] = end - begin >= least and (turned or moving)
        return same


@value
class ImportedRecording:
    """Data of an arm from a log. N samples in the order of time."""

    place: Path
    model: RobotModel
    by_robot: bool
    """True if force or torques were taken to be by the robot, or to brake it, and turned round."""
    first_s: float
    """Instant of the first sample on the recording's clock [s]."""
    time: FloatArray
    """(N,) since then [s]."""
    notes: tuple[Note, ...]

    @property
    def rate(self) -> float:
        """Median rate of the samples [Hz]."""
        return float(1.0 / np.median(np.diff(self.time)))


def arm_of(names: Sequence[str], choice: Choice) -> RobotModel:
    """Return the arm of a choice; for auto the one that the names of joints tell of, otherwise a Panda."""
    if isinstance(arm := choice.arm, RobotModel):
        return arm
    name = ("fr3" if "fr3" in " ".join(names) else "panda") if arm == "auto" else arm
    return RobotModel(robot_named(name, choice.gravity))


def joint_places(place: Path, names: Sequence[str], model: RobotModel) -> list[int]:
    """Find each joint of a model among names: by its name, as the end of a name, or by its number.

    Numbers, from 0 or 1 on, count where names differ in them alone, as q1 to q7 do. RecordingError where that is not
    clear.
    """
    lower = [name.lower() for name in names]
    for alike in (str.__eq__, str.endswith):
        by_name = [[i for i, name in enumerate(lower) if alike(name, joint.lower())] for joint in model.joints]
        if all(len(places) == 1 for places in by_name):
            return [places[0] for places in by_name]
    groups: dict[tuple[str, str], dict[int, int]] = {}
    for i, name in enumerate(lower):
        if (parts := _NUMBERED.fullmatch(name)) and "finger" not in name:
            groups.setdefault((parts[1], parts[3]), {})[int(parts[2])] = i
    whole = [group for group in groups.values() if sorted(group) in (list(range(model.n)), list(range(1, model.n + 1)))]
    if (own := groups.get(("q", ""))) in whole:  # of a table that holds other numbered joints too
        whole = [own]
    if len(whole) != 1:
        what = f"{len(whole)} arms of" if whole else "not"
        raise RecordingError(
            f"{place} names the joints {listed(names)}, which are {what} the {model.n} joints of"
            f" {model.description.name} ({', '.join(model.joints)}): name them so, or q1 to q{model.n} in a table, or"
            " choose another --arm, a name or the folder that `pretouch robot import` wrote."
        )
    return [place for _, place in sorted(whole[0].items())]


def check_reach(place: Path, q: FloatArray, model: RobotModel) -> None:
    """Refuse positions (N, n) [rad] that an arm cannot have: their unit or the arm is another one."""
    low, high = model.q_min - _OUT_OF_RANGE_RAD, model.q_max + _OUT_OF_RANGE_RAD
    beyond = (q < low) | (q > high)
    # a joint with a range of two turns may have none, as the last one of a UR3: alone it may count more of them
    endless = model.q_max - model.q_min > _TWO_TURNS_RAD
    if np.count_nonzero(endless & beyond.any(axis=0)) < 2:
        beyond &= ~endless
    if not beyond.any():
        return
    i, j = np.argwhere(beyond)[0]
    turned = np.deg2rad(q[np.isfinite(q).all(axis=1)])
    degrees = np.abs(turned).max() > np.deg2rad(7.0) and ((turned >= low) & (turned <= high)).all()
    raise RecordingError(
        f"{model.joints[j]} in {place} is at {q[i, j]:.4g} rad, out of its range of {model.q_min[j]:.2f} to"
        f" {model.q_max[j]:.2f} rad: "
        + (
            "as degrees all are within: name the columns q1_deg and so on."
            if degrees
            else "check the unit and the arm."
        )
    )


def unwrapped(time: IntArray) -> tuple[IntArray, float]:
    """Let instants (N,) [ns] of a clock that begins anew at its end go on; also returned is after what time it does.

    That is 0.0 s where it does not, or does so otherwise than a clock that is too small.
    """
    steps = np.diff(time)
    back = steps < -1e9 * _LATE_S
    if not back.any():
        return time, 0.0
    for period_s in (*_COUNTERS_S, *_CLOCKS_S):
        period = round(1e9 * period_s)
        between, least = steps[back] + period, 0 if time.min() >= 0 else -period // 2  # of a counter with a sign
        within = time.min() >= least and time.max() < least + period
        alike = within and between.min() >= 0 and between.max() <= 1e9 * _WRAP_S
        # two recordings that each lasted a minute begin at zero
        if alike and (period_s in _COUNTERS_S or time[0] > 1e9 * _WRAP_S):
            return time + period * np.append(0, np.cumsum(back)), period_s
    return time, 0.0


def goes_on(time: IntArray) -> bool:
    """Return True if instants (N,) [ns], their wraps undone, are those of one recording."""
    forward, _ = unwrapped(time)
    return len(time) < 2 or bool(_back(forward).max() <= _LATE_S and np.median(np.diff(forward)) > 0)


def _back(time: IntArray) -> FloatArray:
    """How far instants (N,) [ns] lie before an earlier one [s]."""
    return np.asarray((np.maximum.accumulate(time) - time) / 1e9)


def gaps(time: FloatArray, longer_s: float = GAP_S) -> list[Note]:
    """Say what gaps longer than so much there are between instants (N,) [s]."""
    steps = np.diff(time)
    some = steps[steps > longer_s]
    sizes = {"count": len(some), "longer_s": longer_s, "seconds": float(some.sum())}
    return [Note("gaps", sizes)] if len(some) else []


def pieces(time: FloatArray, gap_s: float = GAP_S) -> list[slice]:
    """Stretches without a gap of instants (N,) [s]."""
    ends = np.flatnonzero(np.diff(time) > gap_s) + 1
    return [slice(int(a), int(b)) for a, b in zip([0, *ends], [*ends, len(time)], strict=True)]


def listed(names: Sequence[str]) -> str:
    """Names, as a part of a sentence."""
    return ", ".join(repr(name) for name in names[:8]) + (", ..." if len(names) > 8 else "") or "none"
