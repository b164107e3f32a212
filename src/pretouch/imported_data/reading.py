"""Opening of logs of other programs, and joint positions for a calibration."""

from pathlib import Path

from pretouch import extras
from pretouch.errors import RecordingError
from pretouch.imported_data.log import BAGS, PARQUET, TABLES, Choice, Log, LogFile, check_reach
from pretouch.robot.model import RobotModel
from pretouch.traces import JointTrace


def open_log(place: Path, choice: Choice) -> LogFile:
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
    if folder and not (place / "metadata.yaml").is_file():
        raise RecordingError(f"The folder {place} has no metadata.yaml: give the folder of a ROS 2 bag, or a file.")
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
