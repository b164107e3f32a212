"""Watch of a skin: samples of its receiver, judged a few times a second, and its readings against the model."""

import math
import time
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from pretouch.errors import HardwareError
from pretouch.perception.obstacles import is_informative, measured, placed_sensors
from pretouch.perception.scene_filter import Fixtures, bounds, nearest_capsule, plane_return
from pretouch.ports import Clock
from pretouch.robot.body import placed
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.types import BoolArray, FloatArray, RangeReadings
from pretouch.units.findings import Finding, findings
from pretouch.units.health import HealthParams, Lateness, UnitHealth, UnitWindow
from pretouch.units.skin import NetworkSkin
from pretouch.units.unit import Received, UnitTraffic

_COMPARE_S = 0.04
"""Time between two comparisons with the model [s]: every other reading at 50 Hz."""
_INNER = 7
"""Rays: the axis, and the ring half-way to the edge of the cone: where all of these end, a return is strong."""
REACH_M = 0.6
"""Predicted return up to which a unit must see it [m]: in strong light the sensor sees 0.7 m."""
MARGIN_M = 0.1
"""Largest excess of a reading over the prediction [m]: ranging error, placement, and capsules for surfaces."""
TESTS = 100
"""Readings from which a verdict is given: four seconds' worth of the monitor's 25 a second."""
SHARE = 0.8
"""Share of the last ones that must contradict the model."""


class ModelCheck:
    """Compares readings with predicted returns, for an arm whose joint positions are known.

    It names a unit that again and again does not see what it must: misplaced, or of the wrong skin file.
    """

    def __init__(self, model: RobotModel, skin: Skin, fixtures: Fixtures) -> None:
        self._model, self._skin, self._fixtures = model, skin, fixtures
        count = len(skin)
        self._used = np.full(count, -np.inf)
        self._tests: list[deque[tuple[float, float]]] = [deque(maxlen=TESTS) for _ in range(count)]
        # compiled before readings wait for it
        self._certain_return(model.description.q_ready, np.ones(count, np.bool_))

    def take(self, q: FloatArray, readings: RangeReadings) -> None:
        """Compare new readings with the prediction for a posture q (n,) [rad].

        Readings and posture must be of the same instant to within some 50 ms; standing or slow arms are best. It takes
        0.2 ms for seven units: call it up to 25 times a second, outside the control loop.
        """
        fresh = readings.stamp > self._used
        self._used = np.maximum(self._used, readings.stamp)
        distance = measured(readings.distance, readings.status, self._skin.cones)
        fresh &= is_informative(readings.distance, readings.status, distance, self._skin.cones)
        if not fresh.any():
            return
        farthest = self._certain_return(q, fresh)
        measurement = np.where(np.isnan(distance), np.inf, distance)
        for k in np.flatnonzero(fresh).tolist():
            if farthest[k] <= REACH_M:
                self._tests[k].append((float(measurement[k]), float(farthest[k])))

    def _certain_return(self, q: FloatArray, tested: BoolArray) -> FloatArray:
        """Distance (K,) [m] by which all inner rays of a tested sensor have ended, infinite where one goes on."""
        kin, cones, fixtures = self._model.kinematics(q), self._skin.cones, self._fixtures
        sensors = placed_sensors(self._skin.arrays, kin)
        placed_capsules = placed(self._model.capsules, kin), placed(fixtures.capsules, kin)
        shapes = [(capsules, bounds(capsules)) for capsules in placed_capsules]
        far = np.full(len(sensors.link), np.inf)
        for k in np.flatnonzero(tested).tolist():
            far[k] = 0.0
            for i in range(_INNER):
                ray = cones._replace(rays=cones.rays[:, i : i + 1])
                end = plane_return(sensors, k, fixtures.planes, ray, np.inf)
                for shape in shapes:
                    end = min(end, nearest_capsule(sensors, k, *shape, ray))
                far[k] = max(far[k], end)
                if far[k] == np.inf:
                    break
        return far

    def findings(self) -> tuple[Finding, ...]:
        """Return the units that disagree by now, in the order of the skin."""
        wrong = []
        for unit, tests in zip(self._skin.ids, self._tests, strict=True):
            missed = [(reading, predicted) for reading, predicted in tests if reading > predicted + MARGIN_M]
            if len(tests) < TESTS or len(missed) < SHARE * TESTS:
                continue
            reading, predicted = np.median(np.array(missed), axis=0)
            report = f"{reading:.2f} m" if np.isfinite(reading) else "nothing"
            sentence = (
                f"{unit} reports {report} where the model has the arm or a fixture at {predicted:.2f} m, in"
                f" {len(missed)} of {TESTS} readings: check its pose in the skin file, its window, and the positions of"
                " the fixtures."
            )
            wrong.append(Finding(unit, "fault", "model", sentence))
        return tuple(wrong)


@dataclass(frozen=True)
class WatchUpdate:
    """Samples since the previous update, and the health of the units."""

    elapsed: float
    """Time since watching began [s]."""
    samples: list[Received]
    units: tuple[UnitHealth, ...]
    findings: tuple[Finding, ...]


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
        """Compare readings with the model, and collect the samples, each if it is time to; return them."""
        now = time.monotonic()
        if self._check and self._posture and now >= self._compare_due:
            self._compare_due = now + _COMPARE_S
            self._check.take(self._posture(), self.units.read())
        return self._look() if time.monotonic() >= self._look_due else []

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
        """Yield an update at each look for a duration [s], by the monotonic clock."""
        now = begun = due = time.monotonic()
        while now < begun + duration:
            due = min(max(due, now - self._every) + self._every, begun + duration)
            time.sleep(max(due - time.monotonic(), 0.0))
            samples = self._look()
            now = time.monotonic()
            yield WatchUpdate(now - begun, samples, *self.judge())

    def _traffic(self) -> list[UnitTraffic]:
        """Return what was counted, older than the samples by up to 0.3 s but for the newest arrivals."""
        units = zip(self.units.traffic().units, self._arrivals, strict=True)
        return [replace(unit, last_arrival=max(arrival, unit.last_arrival)) for unit, arrival in units]
