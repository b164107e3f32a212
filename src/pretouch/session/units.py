"""Sensor units before a run: each is heard, its clock is known, and what it shows agrees with the model."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from time import monotonic
from typing import Protocol

import numpy as np

from pretouch.errors import HardwareError
from pretouch.perception.scene_filter import Fixtures
from pretouch.ports import Clock, Robot
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.session.preflight import Finding
from pretouch.types import RangeReadings
from pretouch.units.findings import findings
from pretouch.units.health import HealthParams, Lateness, UnitWindow
from pretouch.units.model_check import ModelCheck, ModelCheckParams
from pretouch.units.receiver_process import Traffic
from pretouch.units.traffic import Received, UnitTraffic

_TAKE_S = 0.1
"""Time between two looks at the units [s]."""


class Units(Protocol):
    """What hears the units, as `NetworkSkin`."""

    @property
    def alive(self) -> bool:
        """Whether it still listens."""
        ...

    @property
    def address(self) -> tuple[str, int]:
        """Where it listens."""
        ...

    def read(self) -> RangeReadings:
        """Return the newest reading of each unit."""
        ...

    def take_samples(self) -> list[Received]:
        """Return the samples since the last call."""
        ...

    def traffic(self) -> Traffic:
        """Return what was counted."""
        ...


def wait_until_live(units: Units, clock: Clock, take: Callable[[float], None], patience: float, steady: float) -> None:
    """Wait until all units have been heard for a while without a break; those that are not are a HardwareError.

    Args:
        units: what hears them.
        clock: gives the ticks.
        take: is called at each tick [s], to take in what came.
        patience: how long to wait for one of them [s].
        steady: for how long all must be heard [s]: their clocks are known by then.
    """
    begin = since = clock.tick()
    while (now := clock.tick()) - since < steady:
        take(now)
        missing = [unit.id for unit in units.traffic().units if unit.state != "live"]
        since = now if missing else since
        if missing and now - begin > patience:
            host, port = units.address
            raise HardwareError(
                f"No data from {', '.join(missing)} at {host}:{port}: check with `pretouch skin monitor`, or name the"
                " arm's units with --skin."
            )


class UnitCheck:
    """Watches units for as long as their arm stands."""

    def __init__(
        self, units: Units, model: RobotModel, skin: Skin, fixtures: Fixtures, robot: Robot,
        left_out: Callable[[], float] = lambda: 0.0,
    ) -> None:  # fmt: skip
        """Take the units of a skin on an arm, and what stands around it.

        `left_out` tells the time that this machine was too slow to simulate so far [s], where they are simulated.
        """
        self._units, self._skin, self._robot, self._left_out = units, skin, robot, left_out
        self._health = HealthParams()
        self._windows = [UnitWindow(name, self._health.window_s) for name in skin.network.ids]
        self._model = ModelCheck(model, skin, fixtures, ModelCheckParams())
        self._lateness = Lateness(_TAKE_S, self._health.window_s)
        self._taken = 0.0
        self._arrivals = [-np.inf] * len(skin.mounted)

    def wait(self, clock: Clock, patience: float, steady: float) -> None:
        """Wait as `wait_until_live` does, and take in what comes."""
        wait_until_live(self._units, clock, self.take, patience, steady)

    def take(self, now: float) -> None:
        """Take in what came until a tick [s]."""
        if not self._units.alive:
            raise HardwareError("The receiver of the units has ended: see what it printed.")
        if now - self._taken < _TAKE_S:
            return
        self._taken = now
        self._lateness.look(now, self._left_out())
        heard = self._units.take_samples()
        for one in heard:
            self._arrivals[one.unit] = one.arrival
        traffic = self._traffic()
        for k, window in enumerate(self._windows):
            window.take(monotonic(), [one for one in heard if one.unit == k], traffic[k])
        self._model.take(self._robot.read().q, self._units.read())

    def findings(self) -> tuple[Finding, ...]:
        """Return what is wrong with them by now."""
        now = monotonic()
        health = [window.health(now, unit) for window, unit in zip(self._windows, self._traffic(), strict=True)]
        found = (*findings(health, self._health, self._lateness.total), *self._model.findings())
        return tuple(Finding(f.what, f.sentence, refused=f.level == "fault") for f in found)

    def _traffic(self) -> Sequence[UnitTraffic]:
        """Return what was counted, older than the samples by up to 0.6 s but for the newest arrivals."""
        traffic = zip(self._units.traffic().units, self._arrivals, strict=True)
        return [replace(unit, last_arrival=max(arrival, unit.last_arrival)) for unit, arrival in traffic]
