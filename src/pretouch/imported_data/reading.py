"""Logs of other programs, opened, and what is read of them: a force, or joint positions for a calibration."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pretouch import extras
from pretouch.errors import RecordingError
from pretouch.imported_data.log import BAGS, PARQUET, TABLES, Choice, ImportedRecording, Log, Note, check_reach
from pretouch.robot.model import RobotModel
from pretouch.traces import JointTrace
from pretouch.types import FloatArray
from pretouch.values import value

if TYPE_CHECKING:
    from pretouch.imported_data.bags import Bag
    from pretouch.imported_data.tables import Table

EE_FRAMES = ("_k", "_ee", "_tcp", "_hand", "link8", "tool0", "_flange")


@value
class ForceRecording(ImportedRecording):
    """An external force, as our controller would be given it. N samples."""

    source: str
    """The topic or column that it was taken from."""
    in_ee: bool
    """True if it was taken to be in the end-effector's frame, and turned by the arm's posture."""
    force: FloatArray
    """(N, 3) on the robot by the environment [N], base frame, NaN where there is no estimate."""


def open_log(place: Path, choice: Choice) -> "Bag | Table":
    """Open a log. RecordingError for what cannot be opened, and from what reads it, with the way out."""
    try:
        folder, file = place.is_dir(), place.is_file()
        exists = place.exists()
    except OSError:  # as of a name that is too long
        folder = file = exists = False
    if not exists:
        raise RecordingError(f"The recording {place} does not exist: check its name.")
    if not (folder or file):  # as a pipe or a device, which may have no end
        raise RecordingError(f"{place} is no file: give a recording that is one.")
    if folder and not any(file.name == "metadata.yaml" or file.suffix in BAGS for file in place.iterdir()):
        raise RecordingError(
            f"The folder {place} has no metadata.yaml and no bag: give that of a ROS 2 bag, or a file."
        )
    ending = place.suffix.lower()
    if folder or ending in BAGS:
        from pretouch.imported_data.bags import Bag

        return Bag(place, choice)
    if ending not in (*TABLES, PARQUET):
        formats = ", ".join((*BAGS, *TABLES, PARQUET))
        raise RecordingError(
            f"{place} has an unknown format: give a file that ends in {formats}, or the folder of a bag."
        )
    if ending == PARQUET:
        extras.PARQUET.need("A Parquet file")
    from pretouch.imported_data.tables import Table

    return Table(place, choice)


def read_joints(place: Path, model: RobotModel, topic: str = "") -> tuple[JointTrace, Log]:
    """Read the positions of an arm's joints, on the clock of the file, and return them with the log they are of.

    Args:
        place: a CSV or Parquet file with a column of time and one for each joint (time_s, q1_rad or panda_joint1_deg),
            an MCAP file or a bag with sensor_msgs/JointState.
        model: of the arm.
        topic: of the joint states; needed if there are several.

    Raises:
        RecordingError: for what cannot be read, and for what is not clear, with the way out.
    """
    log = open_log(Path(place), Choice(joints=topic, arm=model)).positions().in_order("q")
    check_reach(log.place, log.arrays["q"], model)
    return JointTrace(log.time / 1e9, log.arrays["q"]), log


def read_force(file: "Bag | Table", choice: Choice) -> ForceRecording:
    """Read a force. RecordingError for what cannot be used, with the way out."""
    by_robot, in_ee = choice.sign == "by-robot", choice.frame == "ee"
    log = file.force(in_ee).in_order()
    values = np.hstack([log.arrays[kind] for kind in ("force", "torque") if kind in log.arrays])
    force, notes = (-1.0 if by_robot else 1.0) * log.arrays["force"], list(log.notes)
    unusable, zero = np.asarray(~np.isfinite(values).all(axis=1)), np.asarray(~np.any(values, axis=1))
    missing = choice.zeros == "missing" or (choice.zeros == "auto" and by_robot)
    notes += log.counted("no_estimate", unusable) + log.counted("zeros_missing" if missing else "zeros_kept", zero)
    force = np.where((unusable | (zero & missing))[:, None], np.nan, force)
    if in_ee:
        check_reach(log.place, log.arrays["q"], log.model)
        force = _in_base(log.model, log.arrays["q"], force)
    elif log.frame_id.lower().endswith(EE_FRAMES):
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
