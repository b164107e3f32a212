"""Whether a recording holds forces, and whether it holds joint torques."""

from pathlib import Path

from pretouch.imported_data.csv import open_table
from pretouch.imported_data.joint_source import has_torques
from pretouch.imported_data.samples import check_exists, is_table
from pretouch.imported_data.source import Choice


def holds_force(place: Path, choice: Choice) -> bool:
    """Whether it has a force; RecordingError for what cannot be read."""
    check_exists(place)
    if is_table(place):
        return any(name.lower().startswith("force_x") for name in open_table(place, choice.columns).names)
    from pretouch.imported_data.joint_bag import kinds_in

    return "force" in kinds_in(place)


def holds_torques(place: Path, choice: Choice) -> bool:
    """Whether it surely has joint positions and torques; RecordingError for what cannot be read."""
    check_exists(place)
    if is_table(place):
        return has_torques(open_table(place, choice.columns).names)
    from pretouch.imported_data.joint_bag import kinds_in

    return "torques" in kinds_in(place)
