"""What a reader takes from an imported recording, and what a person says of it that it does not say itself."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from pretouch.errors import RecordingError
from pretouch.robot.model import RobotModel
from pretouch.types import FloatArray, IntArray
from pretouch.values import value

Sign = Literal["auto", "on-robot", "by-robot"]
Frame = Literal["base", "ee"]
Zeros = Literal["auto", "missing", "kept"]
OUT_OF_RANGE_RAD = 0.5
"""Joint positions this far beyond the arm's range [rad] are of another unit or arm."""


@dataclass(frozen=True)
class Choice:
    """What an imported recording does not say of itself."""

    wrench: str = ""
    """Topic of the force; needed if there are several."""
    joints: str = ""
    """Topic of the joint positions; needed if there are several."""
    sign: Sign = "auto"
    """Whether forces and external torques are on the robot by the environment, as ours, or by the robot, as the
    vendor's O_F_ext_hat_K; auto: on the robot, but for torques by the name that Franka gives them."""
    frame: Frame = "base"
    """Frame the force is given in: the arm's base or its end-effector."""
    zeros: Zeros = "auto"
    """Whether a wrench of zeros only means that there is no estimate; auto: where the force is by the robot."""
    arm: str = "auto"
    """The arm, by its name or the folder it was imported to; auto: by the names of its joints, otherwise a Panda."""
    torques: str = ""
    """Topic of the joint torques; needed if it is not clear."""
    columns: tuple[tuple[str, str], ...] = ()
    """Columns of other names: theirs and ours. `*` stands for the number of a joint."""
    gains: tuple[float, ...] = ()
    """Torque of each joint by its motor's current [Nm/A]."""
    payload_kg: float = 0.0
    """Load at the end-effector that measured torques carry and the model does not [kg]."""

    @property
    def posture(self) -> bool:
        """Whether the joint positions are needed."""
        return self.frame == "ee"

    @property
    def zeros_missing(self) -> bool:
        """Whether a wrench of zeros only is none."""
        return self.zeros == "missing" or (self.zeros == "auto" and self.sign == "by-robot")


@value
class Series:
    """N samples of something, with their instants."""

    time: IntArray
    """(N,) [ns], of any clock."""
    values: FloatArray
    """(N, m)."""

    def __len__(self) -> int:
        return len(self.time)


@value
class Source:
    """What stands in an imported recording, in SI units but in its own sign and frame."""

    said: str
    """Where the force was taken from, as the end of a sentence."""
    force: Series
    """(N, 3 or 6) force [N] and perhaps torque [Nm], NaN where there is none."""
    frame_id: str
    """Frame the recording names for the force, or ''."""
    joints: Series | None
    """(M, n) joint positions [rad]."""
    arm: str
    """The arm that its joints' names tell of, or auto."""
    notes: tuple[str, ...]
    """What was found on the way and a person should know, a sentence each."""


def in_order(series: Series, what: str) -> tuple[Series, tuple[str, ...]]:
    """Sort samples by time and leave out doubles, the last of each counting; `what` they are begins the sentences."""
    notes: list[str] = []
    steps = np.diff(series.time)
    backwards = int(np.count_nonzero(steps < 0))
    if backwards:
        order = np.argsort(series.time, kind="stable")
        series = Series(series.time[order], series.values[order])
        steps = np.diff(series.time)
        notes.append(f"{what}: the time went backwards {_times(backwards)}; the samples were sorted.")
    last = np.append(steps > 0, True)[: len(series)]
    doubles = int(np.count_nonzero(~last))
    if doubles:
        series = Series(series.time[last], series.values[last])
        notes.append(f"{what}: a stamp was repeated {_times(doubles)}; the later sample counts.")
    return series, tuple(notes)


def _times(count: int) -> str:
    return "once" if count == 1 else f"{count} times"


def newest(time: IntArray, ticks: IntArray) -> IntArray:
    """Index (S,) of the newest sample at each tick, -1 before the first; both times [ns] of one clock, sorted."""
    return np.searchsorted(time, ticks, side="right") - 1


def interpolated(series: Series, ticks: IntArray, longest_s: float) -> FloatArray:
    """Values (S, m) at each tick [ns], linear between samples that are at most so far apart [s], or else NaN.

    The last value is held for as long; before the first there is none.
    """
    found = np.full((len(ticks), series.values.shape[1]), np.nan)
    if not len(series):
        return found
    left = newest(series.time, ticks)
    right = np.minimum(left + 1, len(series) - 1)
    gap = np.where(left == right, ticks - series.time[left], series.time[right] - series.time[left])
    inside = (left >= 0) & (gap <= 1e9 * longest_s)
    i, j = left[inside], right[inside]
    share = (ticks[inside] - series.time[i]) / np.maximum(gap[inside], 1)
    found[inside] = series.values[i] + share[:, None] * (series.values[j] - series.values[i])
    return found


def check_reach(place: Path, q: FloatArray, model: RobotModel) -> None:
    """Refuse positions (N, n) [rad] that an arm cannot have: their unit or the arm is another one."""
    beyond = (q < model.q_min - OUT_OF_RANGE_RAD) | (q > model.q_max + OUT_OF_RANGE_RAD)
    if beyond.any():
        i, j = np.argwhere(beyond)[0]
        raise RecordingError(
            f"{model.joints[j]} in {place} is at {q[i, j]:.4g} rad, out of its range of {model.q_min[j]:.2f} to"
            f" {model.q_max[j]:.2f} rad: check the unit and the arm."
        )
