"""What goes wrong with a calibration's data: each function returns other data, with one fault more."""

from dataclasses import replace

import numpy as np

from pretouch.calibration.data import CalibrationData, UnitData
from pretouch.traces import ImuTrace, JointTrace


def unit_of(data: CalibrationData, unit: str) -> UnitData:
    return next(one for one in data.units if one.id == unit)


def swapped(data: CalibrationData, first: str, second: str) -> CalibrationData:
    """Two units sit where the other one is said to."""
    mine, others = unit_of(data, first).imu, unit_of(data, second).imu
    return _with_trace(_with_trace(data, first, others), second, mine)


def slipped(before: CalibrationData, after: CalibrationData, unit: str, at: float) -> CalibrationData:
    """From an instant of its clock [s], a unit measures as in other data, of the same run on another skin."""
    early, late = unit_of(before, unit).imu, unit_of(after, unit).imu
    return _with_trace(before, unit, _joined(_kept(early, early.stamp < at), _kept(late, late.stamp >= at)))


def stuck(data: CalibrationData, unit: str, sensor: str, axis: int, since: float = -np.inf) -> CalibrationData:
    """One axis of "acceleration" or "angular_velocity" keeps the value it has at an instant of the unit's clock [s]."""
    imu = unit_of(data, unit).imu
    values = getattr(imu, sensor).copy()
    first = int(np.searchsorted(imu.stamp, since))
    values[first:, axis] = values[first, axis]
    return _with_trace(data, unit, _changed(imu, **{sensor: values}))


def dead(data: CalibrationData, unit: str, sensor: str) -> CalibrationData:
    """All axes of one sensor give zero."""
    imu = unit_of(data, unit).imu
    return _with_trace(data, unit, _changed(imu, **{sensor: np.zeros_like(getattr(imu, sensor))}))


def saturated(
    data: CalibrationData, unit: str, acceleration_max: float = np.inf, angular_velocity_max: float = np.inf
) -> CalibrationData:
    """A unit's full scales are smaller [m/s^2], [rad/s]: what is beyond them is cut off."""
    one = unit_of(data, unit)
    acceleration = np.clip(one.imu.acceleration, -acceleration_max, acceleration_max)
    turning = np.clip(one.imu.angular_velocity, -angular_velocity_max, angular_velocity_max)
    imu = ImuTrace(one.imu.stamp, acceleration, turning)
    return _with_unit(
        data, replace(one, imu=imu, acceleration_max=acceleration_max, angular_velocity_max=angular_velocity_max)
    )


def on_the_table(data: CalibrationData, unit: str, seed: int = 0) -> CalibrationData:
    """A unit that was never clipped on lies flat beside the arm: gravity, biases and noise."""
    imu, rng = unit_of(data, unit).imu, np.random.default_rng(seed)
    count = len(imu.stamp)
    acceleration = [0.1, -0.2, 9.9] + 0.015 * rng.standard_normal((count, 3))
    turning = [0.05, -0.1, 0.02] + 0.002 * rng.standard_normal((count, 3))
    return _with_trace(data, unit, ImuTrace(imu.stamp, acceleration, turning))


def without_joints(data: CalibrationData, begin: float, end: float) -> CalibrationData:
    """Nothing is known of the joints in an interval [s]."""
    keep = (data.joints.stamp < begin) | (data.joints.stamp > end)
    return replace(data, joints=JointTrace(data.joints.stamp[keep], data.joints.q[keep]))


def joints_late(data: CalibrationData, late: float) -> CalibrationData:
    """All stamps of the joints are late [s]."""
    return replace(data, joints=JointTrace(data.joints.stamp + late, data.joints.q))


def silent(data: CalibrationData, unit: str, begin: float, end: float) -> CalibrationData:
    """A unit sends nothing in an interval of its clock [s]."""
    imu = unit_of(data, unit).imu
    return _with_trace(data, unit, _kept(imu, (imu.stamp < begin) | (imu.stamp > end)))


def with_knocks(data: CalibrationData, unit: str, knocks: int = 10, seed: int = 0) -> CalibrationData:
    """A unit is knocked now and then: 20 ms of 20 m/s^2 along any direction."""
    imu, rng = unit_of(data, unit).imu, np.random.default_rng(seed)
    felt = imu.acceleration.copy()
    for begin in rng.uniform(imu.stamp[0], imu.stamp[-1], knocks):
        direction = rng.normal(size=3)
        struck = (imu.stamp >= begin) & (imu.stamp < begin + 0.02)
        felt[struck] += 20.0 * direction / np.linalg.norm(direction)
    return _with_trace(data, unit, _changed(imu, acceleration=felt))


def _changed(imu: ImuTrace, **values: np.ndarray) -> ImuTrace:
    parts = {"stamp": imu.stamp, "acceleration": imu.acceleration, "angular_velocity": imu.angular_velocity}
    return ImuTrace(**(parts | values))


def _kept(imu: ImuTrace, keep: np.ndarray) -> ImuTrace:
    return ImuTrace(imu.stamp[keep], imu.acceleration[keep], imu.angular_velocity[keep])


def _joined(first: ImuTrace, second: ImuTrace) -> ImuTrace:
    return ImuTrace(
        np.concatenate([first.stamp, second.stamp]),
        np.vstack([first.acceleration, second.acceleration]),
        np.vstack([first.angular_velocity, second.angular_velocity]),
    )


def _with_trace(data: CalibrationData, unit: str, imu: ImuTrace) -> CalibrationData:
    return _with_unit(data, replace(unit_of(data, unit), imu=imu))


def _with_unit(data: CalibrationData, unit: UnitData) -> CalibrationData:
    return replace(data, units=tuple(unit if one.id == unit.id else one for one in data.units))
