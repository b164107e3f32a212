"""Recordings of arms that we know nothing of: read, and brought to our units, sign and frame."""

import os
from pathlib import Path

import numpy as np

from pretouch import extras
from pretouch.errors import RecordingError
from pretouch.imported_data.source import Choice, Series, Source, check_reach, in_order, interpolated
from pretouch.robot.model import RobotModel
from pretouch.robot.named import robot_named
from pretouch.types import BoolArray, FloatArray
from pretouch.values import value

POSTURE_GAP_S = 0.2
"""Time between two joint positions within which the posture is taken to move evenly [s]."""
BAGS = (".mcap", ".db3", ".bag")
TABLES = (".csv", ".tsv", ".txt")
PARQUET = ".parquet"
_EE_FRAMES = ("_k", "_ee", "_tcp", "_hand", "link8", "tool0", "_flange")


@value
class ImportedData:
    """Force, and perhaps postures, of an imported recording, as our controller would be given them."""

    place: Path
    said: str
    """What was read, and what was assumed of it, as a sentence."""
    force: Series
    """(N, 3) force on the robot by the environment [N], base frame, NaN where there is no estimate."""
    joints: Series | None
    """(M, n) joint positions [rad]."""
    model: RobotModel | None
    """The arm, if the posture is needed."""
    notes: tuple[str, ...]

    @property
    def rate(self) -> float:
        """Median rate of the force [Hz]."""
        return float(1e9 / np.median(np.diff(self.force.time)))


def read_imported(place: Path, choice: Choice) -> ImportedData:
    """Read a bag, MCAP or CSV file as the choice says. RecordingError for what cannot be used, with the way out."""
    source = _read(place, choice)
    model = _model(place, source, choice) if choice.posture else None
    force, notes = in_order(source.force, "Force")
    joints = source.joints
    if joints is not None:
        joints, more = in_order(joints, "Joints")
        notes += more
    if len(force) < 2:
        why = " ".join((f"{place} has {len(force)} sample{'' if len(force) == 1 else 's'} of the force.", *notes))
        raise RecordingError(f"{why} Give a longer recording, with a time of its own for each sample.")
    ours, said = _ours(force, choice)
    notes += said
    if choice.frame == "ee" and joints is not None and model is not None:
        ours = _in_base(model, joints, Series(force.time, ours))
    looks_ee = choice.frame == "base" and source.frame_id.lower().endswith(_EE_FRAMES)
    if looks_ee:
        notes += (f"The force's frame_id is {source.frame_id!r}: if that is the end-effector's, add --frame ee.",)
    return ImportedData(
        place, _said(source, choice, model), Series(force.time, ours), joints, model, source.notes + notes
    )


def _read(place: Path, choice: Choice) -> Source:
    check_exists(place)
    if is_table(place):
        from pretouch.imported_data.csv import read_csv

        return read_csv(place, choice)
    from pretouch.imported_data.bag import read_bag

    return read_bag(place, choice)


def check_exists(place: Path) -> None:
    """Refuse a recording that is not there, or not of a known format."""
    if not os.path.exists(place):
        raise RecordingError(f"The recording {place} does not exist: check its name.")
    if not (place.is_dir() or place.is_file()):  # as a pipe or a device, which may have no end
        raise RecordingError(f"{place} is no file: give a recording that is one.")
    if place.is_dir() and not (place / "metadata.yaml").is_file():
        raise RecordingError(f"The folder {place} has no metadata.yaml: give the folder of a ROS 2 bag, or a file.")
    ending = place.suffix.lower()
    if place.is_dir() or ending in BAGS:
        extras.BAGS.need("A bag or MCAP file")
    elif not is_table(place):
        known = ", ".join((*BAGS, *TABLES, PARQUET))
        raise RecordingError(
            f"{place} has an unknown format: give a file that ends in {known}, or the folder of a bag."
        )


def is_table(place: Path) -> bool:
    """Whether a recording is a table, not a bag."""
    return not place.is_dir() and place.suffix.lower() in (*TABLES, PARQUET)


def _model(place: Path, source: Source, choice: Choice) -> RobotModel:
    arm = source.arm if choice.arm == "auto" else choice.arm
    model = RobotModel(robot_named("panda" if arm == "auto" else arm))
    if source.joints is None:
        raise RecordingError(f"{place} has no joint positions: add q1_rad to q{model.n}_rad, or leave out --frame ee.")
    given = source.joints.values
    if given.shape[1] != model.n:
        raise RecordingError(
            f"{place} has {given.shape[1]} joints, and {model.description.name} has {model.n}: choose another --arm."
        )
    check_reach(place, given, model)
    return model


def _ours(force: Series, choice: Choice) -> tuple[FloatArray, tuple[str, ...]]:
    """Bring forces to our sign (N, 3) [N], NaN where there is none, and say how many those are."""
    unusable = ~np.all(np.isfinite(force.values), axis=1)
    zero = ~np.any(force.values, axis=1)
    ours = force.values[:, :3] * (-1.0 if choice.sign == "by-robot" else 1.0)
    notes: list[str] = []
    if unusable.any():
        notes.append(f"Force: {_samples(unusable)} not finite and count as no estimate.")
    if zero.any() and choice.zeros_missing:
        notes.append(f"Force: {_samples(zero)} all zeros and count as no estimate (--zeros kept).")
    elif zero.any():
        notes.append(f"Force: {_samples(zero)} all zeros, which on a Franka arm means no estimate (--zeros missing).")
    none = unusable | (zero & choice.zeros_missing)
    return np.where(none[:, None], np.nan, ours), tuple(notes)


def _samples(flags: BoolArray) -> str:
    count = int(flags.sum())
    return "1 sample is" if count == 1 else f"{count} samples are"


def _in_base(model: RobotModel, joints: Series, force: Series) -> FloatArray:
    """Turn forces (N, 3) [N] from the end-effector's frame to the base's; NaN where the posture is not known."""
    turned = np.full_like(force.values, np.nan)
    for i, q in enumerate(interpolated(joints, force.time, POSTURE_GAP_S)):
        if np.isfinite(q).all():
            turned[i] = model.kinematics(q).rotation[model.ee] @ force.values[i]
    return turned


def _said(source: Source, choice: Choice, model: RobotModel | None) -> str:
    sign, other = ("by the robot", "on-robot") if choice.sign == "by-robot" else ("on the robot", "by-robot")
    frame, another = ("base", "ee") if choice.frame == "base" else ("end-effector's", "base")
    arm = f" The arm is assumed to be {model.description.name} (--arm)." if model else ""
    return (
        f"Force from {source.said}, assumed to be the force {sign} (otherwise --sign {other}) in the {frame} frame"
        f" (otherwise --frame {another}).{arm}"
    )
