"""What goes wrong with a calibration's data: each function returns other data, with one fault more."""

from dataclasses import replace

import numpy as np

from pretouch.calibration.values import CalibrationData, UnitData
from pretouch.traces import ImuTrace


def unit_of(data: CalibrationData, unit: str) -> UnitData:
    return next(one for one in data.units if one.id == unit)


def changed(data: CalibrationData, unit: str, **arrays: np.ndarray) -> CalibrationData:
    """Some arrays of a unit's trace are others."""
    return traced(data, unit, replace(unit_of(data, unit).imu, **arrays))


def traced(data: CalibrationData, unit: str, imu: ImuTrace, **more: object) -> CalibrationData:
    """A unit has another trace."""
    other = replace(unit_of(data, unit), imu=imu, **more)
    return replace(data, units=tuple(other if one.id == unit else one for one in data.units))


def kept(imu: ImuTrace, which: np.ndarray | slice) -> ImuTrace:
    """Some samples of a trace."""
    return ImuTrace(imu.stamp[which], imu.acceleration[which], imu.angular_velocity[which])


def joined(first: ImuTrace, second: ImuTrace) -> ImuTrace:
    """One trace after the other."""
    return ImuTrace(
        np.concatenate([first.stamp, second.stamp]),
        np.vstack([first.acceleration, second.acceleration]),
        np.vstack([first.angular_velocity, second.angular_velocity]),
    )


def swapped(data: CalibrationData, first: str, second: str) -> CalibrationData:
    """Two units sit where the other one is said to."""
    mine, others = unit_of(data, first).imu, unit_of(data, second).imu
    return traced(traced(data, first, others), second, mine)


def slipped(before: CalibrationData, after: CalibrationData, unit: str, at: float) -> CalibrationData:
    """From an instant of its clock [s], a unit measures as in other data, of the same run on another skin."""
    early, late = unit_of(before, unit).imu, unit_of(after, unit).imu
    return traced(before, unit, joined(kept(early, early.stamp < at), kept(late, late.stamp >= at)))


def stuck(data: CalibrationData, unit: str, sensor: str, axis: int, since: float = -np.inf) -> CalibrationData:
    """One axis of "acceleration" or "angular_velocity" keeps the value it has at an instant of the unit's clock [s]."""
    imu = unit_of(data, unit).imu
    values = getattr(imu, sensor).copy()
    first = int(np.searchsorted(imu.stamp, since))
    values[first:, axis] = values[first, axis]
    return changed(data, unit, **{sensor: values})


def saturated(data: CalibrationData, unit: str, angular_velocity_max: float) -> CalibrationData:
    """A gyroscope's full scale is smaller [rad/s]: what is beyond it is cut off."""
    imu = unit_of(data, unit).imu
    turning = np.clip(imu.angular_velocity, -angular_velocity_max, angular_velocity_max)
    return traced(data, unit, replace(imu, angular_velocity=turning), angular_velocity_max=angular_velocity_max)


def on_the_table(data: CalibrationData, unit: str, seed: int = 0) -> CalibrationData:
    """A unit that was never clipped on lies flat beside the arm: gravity, biases and noise."""
    count, rng = len(unit_of(data, unit).imu.stamp), np.random.default_rng(seed)
    acceleration = [0.1, -0.2, 9.9] + 0.015 * rng.standard_normal((count, 3))
    turning = [0.05, -0.1, 0.02] + 0.002 * rng.standard_normal((count, 3))
    return changed(data, unit, acceleration=acceleration, angular_velocity=turning)


def silent(data: CalibrationData, unit: str, begin: float, end: float) -> CalibrationData:
    """A unit sends nothing in an interval of its clock [s]."""
    imu = unit_of(data, unit).imu
    return traced(data, unit, kept(imu, (imu.stamp < begin) | (imu.stamp > end)))


def with_knocks(data: CalibrationData, unit: str, knocks: int = 10, seed: int = 0) -> CalibrationData:
    """A unit is knocked now and then: 20 ms of 20 m/s^2 along any direction."""
    imu, rng = unit_of(data, unit).imu, np.random.default_rng(seed)
    felt = imu.acceleration.copy()
    for begin in rng.uniform(imu.stamp[0], imu.stamp[-1], knocks):
        direction = rng.normal(size=3)
        struck = (imu.stamp >= begin) & (imu.stamp < begin + 0.02)
        felt[struck] += 20.0 * direction / np.linalg.norm(direction)
    return changed(data, unit, acceleration=felt)


def joints(data: CalibrationData, **arrays: np.ndarray) -> CalibrationData:
    """The joints' stamps or positions are others."""
    return replace(data, joints=replace(data.joints, **arrays))


def without_joints(data: CalibrationData, begin: float, end: float) -> CalibrationData:
    """Nothing is known of the joints in an interval [s]."""
    stamp = data.joints.stamp
    return cut(data, (stamp < begin) | (stamp > end))


def cut(data: CalibrationData, which: np.ndarray | slice) -> CalibrationData:
    """Some joint states are left."""
    return joints(data, stamp=data.joints.stamp[which], q=data.joints.q[which])
