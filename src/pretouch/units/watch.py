"""Watch of a skin: samples of its receiver, judged a few times a second."""

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

from pretouch.errors import HardwareError
from pretouch.ports import Clock
from pretouch.types import FloatArray
from pretouch.units.findings import Finding, findings
from pretouch.units.health import HealthParams, Lateness, UnitHealth, UnitWindow
from pretouch.units.model_check import ModelCheck
from pretouch.units.skin import NetworkSkin
from pretouch.units.unit import Received, UnitTraffic

_COMPARE_S = 0.04
"""Time between two comparisons with the model [s]: every other reading at 50 Hz."""


@dataclass(frozen=True)
class WatchUpdate:
    """Samples since the previous update, and the health of the units."""

    time: float
    """Instant, by the receiver's clock [s]."""
    elapsed: float
    """Time since watching began [s]."""
    samples: list[Received]
    units: tuple[UnitHealth, ...]
    findings: tuple[Finding, ...]
    last: bool
    """True if the duration is over."""


class UnitWatch:
    """Watches the units of a skin while `take` or `updates` are called."""

    def __init__(
        self,
        units: NetworkSkin,
        every: float,
        check: ModelCheck | None = None,
        posture: Callable[[], FloatArray] | None = None,
        left_out: Callable[[], float] = lambda: 0.0,
    ) -> None:
        """Watch from now on.

        Args:
            units: the receiver of the units.
            every: time between two looks at what came [s].
            check: compares readings with the model of the arm that carries them.
            posture: gives the arm's joint positions (n,) [rad], with `check`.
            left_out: gives the time that this machine was too slow to simulate so far [s], of simulated units.
        """
        self.units, self._every, self._check, self._posture, self._left_out = units, every, check, posture, left_out
        traffic = units.traffic().units
        self._limits = HealthParams()
        self._windows = [UnitWindow(self._limits.window_s) for _ in traffic]
        self._lateness = Lateness(every, self._limits.window_s)
        self._arrivals = [unit.last_arrival for unit in traffic]
        self._look_due = self._compare_due = -math.inf

    def take(self) -> list[Received]:
        """Collect the samples if it is time to; return them. It may be called at any rate."""
        self._compare()
        return self._look() if time.monotonic() >= self._look_due else []

    def _compare(self) -> None:
        """Compare readings with the model, where that is due."""
        now = time.monotonic()
        if self._check and self._posture and now >= self._compare_due:
            self._compare_due = now + _COMPARE_S
            self._check.take(self._posture(), self.units.read())

    def _look(self) -> list[Received]:
        if not self.units.alive:
            raise HardwareError("The receiver of the units has ended: see what it printed.")
        now = time.monotonic()
        self._look_due = now + self._every
        self._lateness.look(now, self._left_out())
        samples = self.units.take_samples()
        for one in samples:
            self._arrivals[one.unit] = one.arrival
        for k, (window, traffic) in enumerate(zip(self._windows, self._traffic(), strict=True)):
            window.take(now, [one for one in samples if one.unit == k], traffic)
        return samples

    def judge(self) -> tuple[tuple[UnitHealth, ...], tuple[Finding, ...]]:
        """Return the health of each unit by now, and what is wrong."""
        now = time.monotonic()
        units = zip(self._windows, self._traffic(), strict=True)
        health = tuple(window.health(now, traffic) for window, traffic in units)
        wrong = findings(health, self._limits, self._lateness.total)
        return health, (*wrong, *(self._check.findings() if self._check else ()))

    def wait(self, clock: Clock, patience: float = 20.0, steady: float = 3.0) -> None:
        """Wait until all units have been received for `steady` [s] without a break: their clocks are known by then.

        A unit that is not received within `patience` [s] is a HardwareError.
        """
        begin = since = clock.tick()
        while (now := clock.tick()) - since < steady:
            self.take()
            missing = [unit.id for unit in self.units.traffic().units if unit.state != "live"]
            since = now if missing else since
            if missing and now - begin > patience:
                host, port = self.units.address
                raise HardwareError(
                    f"No data from {', '.join(missing)} at {host}:{port}: check with `pretouch skin monitor`, or name"
                    " the arm's units with --skin."
                )

    def updates(self, duration: float = math.inf) -> Iterator[WatchUpdate]:
        """Yield an update at each look for a duration [s], by the monotonic clock; the last one is marked."""
        now = begun = due = time.monotonic()
        while now < begun + duration:
            due = min(max(due, now - self._every) + self._every, begun + duration)
            while (left := due - time.monotonic()) > 0:
                time.sleep(min(left, _COMPARE_S))
                self._compare()
            samples = self._look()
            now = time.monotonic()
            yield WatchUpdate(now, now - begun, samples, *self.judge(), now >= begun + duration)

    def _traffic(self) -> list[UnitTraffic]:
        """Return what was counted, older than the samples by up to 0.3 s but for the newest arrivals."""
        units = zip(self.units.traffic().units, self._arrivals, strict=True)
        return [replace(unit, last_arrival=max(arrival, unit.last_arrival)) for unit, arrival in units]
