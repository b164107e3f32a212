"""From a calibration to a skin."""

from dataclasses import dataclass, replace

import numpy as np

from pretouch.calibration.mounting import moved_out
from pretouch.calibration.result import Calibration, UnitCalibration
from pretouch.errors import CalibrationError
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.sensing.unit import LARGEST_ORIENTATION_SIGMA, LARGEST_POSITION_SIGMA, SensorUnit, seat


@dataclass(frozen=True, eq=False)
class CalibratedSkin:
    """A skin, and what became of each unit: ids."""

    skin: Skin
    located: tuple[str, ...]
    """Units whose place was found."""
    kept: tuple[str, ...]
    """Units that stay where the skin before had them, found wanting or not calibrated."""
    left_out: tuple[str, ...]
    """Units that were found wanting, and that no skin had before."""


def skin_of(calibration: Calibration, model: RobotModel, keep: Skin | None = None) -> CalibratedSkin:
    """Make a skin of all units whose place can be trusted; the others stay as in the skin before, where it has them.

    Raises CalibrationError if the skin has no unit.
    """
    found = {unit.id: unit for unit in calibration.units}
    located = {
        name: _sensor_unit(unit, model, calibration.orientation_floor) for name, unit in found.items() if unit.accepted
    }
    old = {unit.id: unit for unit in keep.mounted} if keep else {}
    for name, unit in located.items():
        if name in old:
            # where a unit is says nothing of its sensors
            located[name] = replace(unit, touch=old[name].touch, sensor=old[name].sensor)
    names = [*old, *(name for name in found if name not in old)]
    units = {name: located.get(name) or old.get(name) for name in names}
    there = [unit for unit in units.values() if unit is not None]
    if not there:
        raise CalibrationError("No unit was located reliably, so no skin can be made: see the findings of each unit.")
    return CalibratedSkin(
        Skin(there, model),
        tuple(name for name in names if name in located),
        tuple(name for name in names if name in old and name not in located),
        tuple(name for name in names if units[name] is None),
    )


def _sensor_unit(unit: UnitCalibration, model: RobotModel, orientation_floor: float) -> SensorUnit:
    """Return a unit of a skin; one that lies inside its link's capsules is moved out, as its findings say.

    Its orientation's standard deviation is about each axis: of the fit's worst one, and how well the board is glued on.
    """
    place = unit.place
    if place is None:
        raise CalibrationError(f"Unit {unit.id} was not located: leave it out.")
    T = place.T_link_sensor.copy()
    link = model.link_index(place.link)
    below = seat(model, link, T[:3, 3])
    sigma = place.position_sigma
    if below is not None and below.height < 0:
        out = moved_out(model, link, T[:3, 3])
        if out is None:
            raise CalibrationError(f"Unit {unit.id} lies inside {place.link}: there is no surface near it.")
        sigma = float(np.hypot(sigma, np.linalg.norm(out - T[:3, 3])))
        T[:3, 3] = out
    return SensorUnit(
        unit.id, place.link, T, min(sigma, LARGEST_POSITION_SIGMA),
        min(float(np.hypot(place.orientation_sigma, orientation_floor)), LARGEST_ORIENTATION_SIGMA),
    )  # fmt: skip
