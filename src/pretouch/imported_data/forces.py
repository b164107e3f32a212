"""Forces of an arm that we know nothing of: read, and brought to our sign and frame."""

import numpy as np

from pretouch.imported_data.log import Choice, ImportedRecording, LogFile, Note, check_reach
from pretouch.robot.model import RobotModel
from pretouch.types import BoolArray, FloatArray
from pretouch.values import value

_EE_FRAMES = ("_k", "_ee", "_tcp", "_hand", "link8", "tool0", "_flange")


@value
class ForceRecording(ImportedRecording):
    """An external force, as our controller would be given it. N samples."""

    source: str
    """The topic or column that it was taken from."""
    in_ee: bool
    """Whether it was taken to be in the end-effector's frame, and turned by the arm's posture."""
    force: FloatArray
    """(N, 3) on the robot by the environment [N], base frame, NaN where there is no estimate."""
    moving: BoolArray | None = None
    """(N,) whether a joint turns; None where that is not known."""


def read_force(file: LogFile, choice: Choice) -> ForceRecording:
    """Read a force. RecordingError for what cannot be used, with the way out."""
    by_robot, in_ee = choice.sign == "by-robot", choice.frame == "ee"
    log = file.force(in_ee).in_order()
    values = np.hstack([log.arrays[kind] for kind in ("force", "torque") if kind in log.arrays])
    force, notes = (-1.0 if by_robot else 1.0) * log.arrays["force"], list(log.notes)
    unusable, zero = ~np.isfinite(values).all(axis=1), ~np.any(values, axis=1)
    missing = choice.zeros == "missing" or (choice.zeros == "auto" and by_robot)
    if unusable.any():
        notes.append(Note("no_estimate", {"count": int(unusable.sum())}))
    if zero.any():
        notes.append(Note("zeros_missing" if missing else "zeros_kept", {"count": int(zero.sum())}))
    force = np.where((unusable | (zero & missing))[:, None], np.nan, force)
    if in_ee:
        check_reach(log.place, log.arrays["q"], log.model)
        force = _in_base(log.model, log.arrays["q"], force)
    elif log.frame_id.lower().endswith(_EE_FRAMES):
        notes.append(Note("looks_ee", {"frame": log.frame_id}))
    time = log.time - log.time[0]
    source, first = log.sources["force"], log.time[0] / 1e9
    return ForceRecording(log.place, log.model, by_robot, first, time / 1e9, tuple(notes), source, in_ee, force)


def _in_base(model: RobotModel, q: FloatArray, force: FloatArray) -> FloatArray:
    """Turn forces (N, 3) [N] from the end-effector's frame to the base's; NaN where the posture is not known."""
    turned = np.full_like(force, np.nan)
    for i in np.flatnonzero(np.isfinite(q).all(axis=1)):
        turned[i] = model.kinematics(q[i]).rotation[model.ee] @ force[i]
    return turned
