"""What can be wrong with what one unit measured, before it is compared with any link."""

from dataclasses import replace

import numpy as np

from pretouch.calibration.data import UnitData
from pretouch.calibration.imu_signal import saturated
from pretouch.calibration.params import CalibrationParams
from pretouch.calibration.result import Finding
from pretouch.calibration.signals import gaps, median_period, of_several_clocks
from pretouch.traces import ImuTrace
from pretouch.types import BoolArray, FloatArray

_LOST = 0.01
"""Share of the time in gaps from which on it is worth a word."""
_STUCK_S = 1.0
"""A value that stays the same for longer, while others vary, does not come from a sensor that works [s]."""
_VARIES = np.repeat((0.05, 0.3), 3)
"""By how much others vary then at least: angular velocities [rad/s], accelerations [m/s^2]."""
_AXES = ("gyroscope x", "gyroscope y", "gyroscope z", "accelerometer x", "accelerometer y", "accelerometer z")
_MISTAKEN = (
    (9.80665, "m/s^2 is needed and these look like g: multiply by 9.80665"),
    (0.00980665, "m/s^2 is needed and these look like thousandths of g: multiply by 0.00980665"),
    (0.01, "m/s^2 is needed and these look like cm/s^2: divide by 100"),
    (2.0, "the range it is read with is probably half the one it was set to"),
    (0.5, "the range it is read with is probably twice the one it was set to"),
)
"""Factors that make a measured gravity right, and what they tell."""


def checked_unit(unit: UnitData, params: CalibrationParams) -> tuple[UnitData, list[Finding]]:
    """Return a unit's data at increasing instants, and what is wrong with it; what is refused cannot be used at all."""
    imu = unit.imu
    measured = (imu.stamp, imu.acceleration, imu.angular_velocity)
    stamp, acceleration, turned = (np.asarray(a, dtype=np.float64) for a in measured)
    if stamp.ndim != 1 or acceleration.shape != (len(stamp), 3) or turned.shape != (len(stamp), 3):
        both = f"Accelerations {acceleration.shape} and angular velocities {turned.shape}"
        sentence = f"{both} do not fit {stamp.shape} stamps."
        return unit, [Finding("shape", f"{sentence} Give three of each for each stamp.", True)]
    if not len(stamp):
        return unit, [Finding("silent", "It sent no IMU samples: check that it is switched on and has an IMU.", True)]
    finite = np.asarray(np.isfinite(np.column_stack([stamp, acceleration, turned])).all(axis=1))
    findings = [] if finite.all() else [_not_finite(finite, params)]
    later = _later(np.where(finite, stamp, -np.inf))
    findings += _unordered(stamp[finite], later[finite], params)
    keep = finite & later
    clean = replace(unit, imu=ImuTrace(stamp[keep], acceleration[keep], turned[keep]))
    findings += _sparse(clean.imu.stamp, params)
    if not any(finding.refused for finding in findings):
        findings += [*_losses(clean, params), *_saturation(clean), *(_stuck(clean) or _gravity(clean))]
    return clean, findings


def _not_finite(finite: BoolArray, params: CalibrationParams) -> Finding:
    share = float(np.mean(~finite))
    sentence = f"{share:.1%} of its samples are not finite, or have no stamp, and were left out: check their source."
    return Finding("not_finite", sentence, share > params.unusable)


def _later(stamp: FloatArray) -> BoolArray:
    """Tell which stamps (M,) are later than all before them."""
    before = np.concatenate([[-np.inf], np.maximum.accumulate(stamp)[:-1]])
    return stamp > before


def _unordered(stamp: FloatArray, later: BoolArray, params: CalibrationParams) -> list[Finding]:
    if later.all() or not len(stamp):
        return []
    back = float(max(0.0, -np.diff(stamp).min()))
    if back > params.longest_gap_s:
        sentence = f"Its stamps go back by {back:.3g} s, because the unit or its clock restarted: calibrate again."
        return [Finding("clock", sentence, True)]
    sentence = (
        f"{np.mean(~later):.1%} of its samples are not later than ones before them, by up to {back:.3g} s, and were"
        " left out: give them in the order in which they were measured, on one clock."
    )
    return [Finding("unordered", sentence, bool(np.mean(~later) > params.unusable))]


def _sparse(stamp: FloatArray, params: CalibrationParams) -> list[Finding]:
    span = float(np.ptp(stamp)) if len(stamp) else 0.0
    if span < params.shortest_s:
        sentence = f"It has {len(stamp)} samples in {span:.3g} s: at least {params.shortest_s:g} s are needed."
        return [Finding("short", sentence, True)]
    period, needed = median_period(stamp), 0.25 / params.cutoff_hz
    if period > needed:
        sentence = f"Its samples came every {1000 * period:.3g} ms: at least every {1000 * needed:.3g} ms are needed."
        return [Finding("slow", sentence, True)]
    if of_several_clocks(stamp):
        sentence = f"Its {len(stamp)} samples are spread over {span:.3g} s: give those of one run, stamped in seconds."
        return [Finding("clock", sentence, True)]
    return []


def _losses(unit: UnitData, params: CalibrationParams) -> list[Finding]:
    stamp = unit.imu.stamp
    holes = gaps(stamp, params.longest_gap_s)[1:-1]
    missing = float((holes[:, 1] - holes[:, 0]).sum())
    if missing < _LOST * np.ptp(stamp):
        return []
    sentence = (
        f"Gaps in its samples: {len(holes)}, {missing:.2f} s in all ({missing / np.ptp(stamp):.1%}). Samples around"
        " them were left out: move the access point closer, or use fewer units at once."
    )
    return [Finding("lost", sentence, False)]


def _stuck(unit: UnitData) -> list[Finding]:
    """Find axes whose value stays the same for long while another one varies: they are stuck, or cut off there."""
    imu = unit.imu
    values = np.hstack([imu.angular_velocity, imu.acceleration])
    if not np.ptp(values, axis=0).any():
        sentence = f"All its {len(values)} samples are the same: restart the unit, or replace it."
        return [Finding("stuck", sentence, True)]
    stuck: list[str] = []
    for axis, name in enumerate(_AXES):
        begin, end = _longest_run(values[:, axis])
        others = np.ptp(values[begin:end], axis=0) > _VARIES
        lasted = imu.stamp[end - 1] - imu.stamp[begin]
        if lasted > _STUCK_S and others.any() and not _full(unit, axis, begin):
            where = f"{values[begin, axis]:.4g} {'m/s^2' if axis > 2 else 'rad/s'}"
            stuck.append(f"its {name} stays at {where} for {lasted:.1f} s")
    if not stuck:
        return []
    way_out = "restart the unit, or replace it; if its range ends there, set a larger one"
    return [Finding("stuck", f"While others vary, {', '.join(stuck)}: {way_out}.", True)]


def _longest_run(values: FloatArray) -> tuple[int, int]:
    """Return where the longest run of equal values begins and ends."""
    edges = np.concatenate([[0], np.flatnonzero(np.diff(values)) + 1, [len(values)]])
    i = int(np.argmax(np.diff(edges)))
    return int(edges[i]), int(edges[i + 1])


def _full(unit: UnitData, axis: int, sample: int) -> bool:
    """Tell whether a value is cut off."""
    imu = unit.imu
    one = ImuTrace(imu.stamp[:1], np.zeros((1, 3)), np.zeros((1, 3)))
    source, to = (imu.acceleration, one.acceleration) if axis > 2 else (imu.angular_velocity, one.angular_velocity)
    to[0, axis % 3] = source[sample, axis % 3]
    return bool(saturated(replace(unit, imu=one))[0])


def _saturation(unit: UnitData) -> list[Finding]:
    cut = saturated(unit)
    if not cut.any():
        return []
    imu = unit.imu
    largest = np.repeat((unit.angular_velocity_max, unit.acceleration_max), 3)
    peaks = np.abs(np.hstack([imu.angular_velocity, imu.acceleration])[cut]).max(axis=0)
    axes = ", ".join(name for name, full in zip(_AXES, peaks >= 0.999 * largest, strict=True) if full)
    sentence = (
        f"{cut.mean():.1%} of its samples are at the end of its range ({axes}) and were left out, with what is around"
        " them: set a larger range, or move more slowly."
    )
    return [Finding("saturated", sentence, False)]


def _gravity(unit: UnitData) -> list[Finding]:
    """Find an accelerometer that does not measure gravity, which a calibration motion hardly adds to."""
    gravity = float(np.median(np.linalg.norm(unit.imu.acceleration, axis=1)))
    if 0.7 < gravity / 9.80665 < 1.4:
        return []
    why = next((why for factor, why in _MISTAKEN if abs(factor * gravity / 9.80665 - 1) < 0.1), "check scale and axes")
    sentence = f"Its accelerometer measures {gravity:.4g} m/s^2 where gravity is 9.81: {why}."
    return [Finding("gravity", sentence, True)]
