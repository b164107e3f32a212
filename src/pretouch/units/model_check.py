"""Whether what a unit reports agrees with what the model says it must see: the arm itself, and declared fixtures."""

from collections import deque
from collections.abc import Iterator

import numpy as np

from pretouch.perception.obstacles import measured, placed_sensors, tells_anything
from pretouch.perception.scene_filter import Fixtures, bounds, expected_range, nearest_capsule, plane_return
from pretouch.robot.body import Capsules, placed
from pretouch.robot.kinematics import Kinematics
from pretouch.robot.model import RobotModel
from pretouch.sensing.sensor import Cones, Sensors
from pretouch.sensing.skin import Skin
from pretouch.types import BoolArray, FloatArray, RangeReadings
from pretouch.units.findings import Finding

_INNER = 7
"""Rays: the axis, and the ring half-way to the edge of the cone: where all of these end, a return is strong."""
REACH_M = 0.6
"""Predicted return up to which a unit must see it [m]: in strong light the sensor sees 0.7 m."""
MARGIN_M = 0.1
"""By how much a reading may be farther than predicted [m]: ranging error, placement, and capsules for surfaces."""
TESTS = 100
"""Readings from which a verdict is given: four seconds' worth of the monitor's 25 a second."""
SHARE = 0.8
"""Share of the last ones that must contradict the model."""
NEAR_M = 0.1
"""Reading up to which a lens may be covered [m]."""
MOVED_M = 0.2
"""How far a unit must have moved while it reads something near all the time [m]: no person's hand follows so."""


class ModelCheck:
    """Compares readings with predicted returns, for an arm whose joint positions are known.

    It names a unit that again and again does not see what it must (misplaced, covered, the wrong skin
    file), and one that sees something near wherever it goes (covered).
    """

    def __init__(self, model: RobotModel, skin: Skin, fixtures: Fixtures) -> None:
        self._model, self._skin, self._fixtures = model, skin, fixtures
        count = len(skin)
        self._used = np.full(count, -np.inf)
        self._tests: list[deque[tuple[bool, float, float]]] = [deque(maxlen=TESTS) for _ in range(count)]
        self._near = [_NearReadings() for _ in range(count)]
        self._predicted(model.description.q_ready, np.ones(count, np.bool_))  # compiled before readings wait for it

    def take(self, q: FloatArray, readings: RangeReadings) -> None:
        """Compare the readings that are new with what the posture q (n,) [rad] predicts.

        Readings and posture must be of the same instant to within some 50 ms; standing or slow arms are best. It takes
        0.2 ms for seven units: call it up to 25 times a second, outside the control loop.
        """
        fresh = readings.stamp > self._used
        self._used = np.maximum(self._used, readings.stamp)
        distance = measured(readings.distance, readings.status, self._skin.cones)
        fresh &= tells_anything(readings.distance, readings.status, distance, self._skin.cones)
        if not fresh.any():
            return
        position, nearest, farthest = self._predicted(q, fresh)
        seen = np.where(np.isnan(distance), np.inf, distance)
        for k in np.flatnonzero(fresh).tolist():
            if farthest[k] <= REACH_M:
                missed = bool(seen[k] > farthest[k] + MARGIN_M)
                self._tests[k].append((missed, float(seen[k]), float(farthest[k])))
            covered = seen[k] <= NEAR_M and seen[k] < nearest[k] - MARGIN_M
            if covered:
                self._near[k].take(float(seen[k]), position[k])
            else:
                self._near[k] = _NearReadings()

    def _predicted(self, q: FloatArray, tested: BoolArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Where the sensors are (K, 3), the nearest they can see of the model (K,), and what those tested must (K,)."""
        kin = self._model.kinematics(q)
        sensors, cones = placed_sensors(self._skin.arrays, kin), self._skin.cones
        body, fixtures = self._model.capsules, self._fixtures
        nearest = expected_range(kin, sensors, cones, body, fixtures)
        return sensors.position, nearest, _certain_return(kin, sensors, cones, tested, body, fixtures)

    def findings(self) -> tuple[Finding, ...]:
        """Return what disagrees by now, in the order of the skin."""
        return tuple(finding for k, unit in enumerate(self._skin.ids) for finding in self._of(k, unit))

    def _of(self, k: int, unit: str) -> Iterator[Finding]:
        tests, near = self._tests[k], self._near[k]
        missed = [(seen, predicted) for wrong, seen, predicted in tests if wrong]
        if len(tests) == TESTS and len(missed) >= SHARE * TESTS:
            seen, predicted = np.median(np.array(missed), axis=0)
            what = f"{seen:.2f} m" if np.isfinite(seen) else "nothing"
            sees = (
                f"{unit} reports {what} where the model has the arm or a fixture at {predicted:.2f} m, in {len(missed)}"
            )
            remedy = "check its pose in the skin file, its window, and the positions of the fixtures."
            yield Finding(unit, "fault", "model", f"{sees} of {len(tests)} readings: {remedy}")
        if near.count >= TESTS and near.moved >= MOVED_M:
            sees = (
                f"{unit} reports {near.distance:.3f} m everywhere along {near.moved:.1f} m of its motion, but the model"
            )
            remedy = "its window is covered or its cover glass is dirty; clean it."
            yield Finding(unit, "fault", "covered", f"{sees} has nothing so close: {remedy}")


class _NearReadings:
    """For how long, and over how much of the room, a unit has read something near without a break."""

    def __init__(self) -> None:
        self.count, self.distance = 0, 0.0
        self._low, self._high = np.full(3, np.inf), np.full(3, -np.inf)

    @property
    def moved(self) -> float:
        """How far it came meanwhile [m]."""
        return float(np.linalg.norm(self._high - self._low)) if self.count else 0.0

    def take(self, distance: float, position: FloatArray) -> None:
        """Take in a reading [m] at a position (3,) [m]."""
        self.count, self.distance = self.count + 1, distance
        self._low, self._high = np.minimum(self._low, position), np.maximum(self._high, position)


def _certain_return(
    kin: Kinematics, sensors: Sensors, cones: Cones, tested: BoolArray, body: Capsules, fixtures: Fixtures
) -> FloatArray:
    """Distance (K,) [m] by which all inner rays of a tested sensor have ended, infinite where one goes on."""
    shapes = [(capsules, bounds(capsules)) for capsules in (placed(body, kin), placed(fixtures.capsules, kin))]
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
