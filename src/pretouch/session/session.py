"""One arm, its units and its controller: what is checked before the arm moves, in order."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pretouch.controller import Controller
from pretouch.errors import RobotError
from pretouch.loop import MonotonicClock
from pretouch.ports import Arm, Skin
from pretouch.session.preflight import Finding, PreflightParams, check, refusals
from pretouch.session.standstill import Standstill, watch
from pretouch.session.start import check_start
from pretouch.session.units import UnitCheck, Units
from pretouch.types import FloatArray, RangeReadings

_PATIENCE_S = 20.0
"""How long units that are not heard are waited for [s]."""
_STEADY_S = 3.0
"""How long all units must have been heard without a break [s]: their clocks are known by then."""


class NoUnits:
    """The port `Skin` of an arm without units."""

    def read(self) -> RangeReadings:
        """Return the readings of none."""
        return RangeReadings(np.zeros(0), np.zeros(0), np.zeros(0, np.int64))


@dataclass(frozen=True)
class Session:
    """An arm that stands, and what is to move it."""

    arm: Arm
    skin: Skin
    """The units as the loop reads them."""
    units: Units | None
    """What hears them, where their health is known."""
    controller: Controller
    floor: float
    """Height of what is below the arm, base frame [m]."""
    clock: MonotonicClock
    left_out: Callable[[], float] = lambda: 0.0
    """Time that this machine was too slow to simulate so far [s], where arm and units are simulated."""

    def preflight(self, params: PreflightParams, approach: bool) -> tuple[Standstill, tuple[Finding, ...]]:
        """Watch arm and units for some seconds; return what was seen of the arm, and what there is to know.

        Units that are not heard, and states that cannot be used, are an error at once.

        Args:
            params: what the arm must be like.
            approach: whether the arm is going to the start of its path first.
        """
        self.check_arm()
        c = self.controller
        units = UnitCheck(self.units, c.model, c.skin, c.fixtures, self.arm, self.left_out) if self.units else None
        if units:
            units.wait(self.clock, _PATIENCE_S, _STEADY_S)
        qd_max = c.limits.qd_max
        seen = watch(self.arm, self.clock, qd_max, params.watch_s, units.take if units else lambda _: None)
        found = check(c, seen, self.floor, params)
        if not approach:
            found += check_start(c, seen.newest.q)
        return seen, (*found, *(units.findings() if units else ()))

    def recheck(self, checked: Standstill, params: PreflightParams, approach: bool) -> FloatArray:
        """Return where the arm is by now (n,) [rad]; RobotError if that is not where it was checked, or may not move.

        Args:
            checked: what `preflight` saw of it.
            params: those of `preflight`.
            approach: whether the arm is going to the start of its path first.
        """
        self.check_arm()
        q = np.array(self.arm.read().q)
        moved = np.abs(q - checked.newest.q)
        joint = int(np.argmax(moved))
        if not moved[joint] <= params.drift_rad:
            raise RobotError(
                f"The arm moved after the checks, {self.controller.model.joints[joint]} by {moved[joint]:.3f} rad"
                f" (limit {params.drift_rad:g} rad): start again."
            )
        refused = () if approach else refusals(check_start(self.controller, q))
        if refused:
            raise RobotError(refused[0])
        return q

    def check_arm(self) -> None:
        """Raise RobotError with all that the arm itself has against being moved."""
        against = self.arm.unfit()
        if against:
            raise RobotError(" ".join(against))
