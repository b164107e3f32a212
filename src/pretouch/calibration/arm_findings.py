"""What is to be said of the run and the arm, once the places of its units are found."""

import numpy as np

from pretouch.calibration.link_motion import ArmMotion
from pretouch.calibration.params import CalibrationParams
from pretouch.calibration.result import Finding, UnitCalibration


def little_used(arm: ArmMotion) -> list[Finding]:
    """Say so if less than half of the run can be used."""
    step = float(arm.time[1] - arm.time[0])
    whole, used = step * len(arm.time), step * float(arm.usable.sum())
    if used >= 0.5 * whole:
        return []
    sentence = (
        f"Of {whole:.1f} s of joint states only {used:.1f} s are without gaps and could be used: record every state."
    )
    return [Finding("joints_little_used", sentence, False)]


def clocks_apart(units: tuple[UnitCalibration, ...], params: CalibrationParams) -> list[Finding]:
    """Say so if the clocks of all units that have a place are off by about the same."""
    placed = [unit for unit in units if unit.place is not None]
    late = np.array([unit.place.clock_offset for unit in placed if unit.place is not None])
    off = all(any(finding.kind == "clock" for finding in unit.findings) for unit in placed)
    if len(placed) < 2 or not off or np.ptp(late) > params.clock_error_s:
        return []
    middle = float(np.median(late))
    late_or_early = "late" if middle > 0 else "early"
    sentence = (
        f"The clocks of all units are {late_or_early} by about {abs(middle):.2f} s, because joints and units were"
        " stamped by different clocks: correct the stamps of all units by that."
    )
    return [Finding("clocks", sentence, False)]
