"""Comparison of a unit's readings with those that the model predicts of the arm itself and declared fixtures."""

from collections import deque

import numpy as np

from pretouch.perception.obstacles import is_informative, measured, placed_sensors
from pretouch.perception.scene_filter import Fixtures, bounds, nearest_capsule, plane_return
from pretouch.robot.body import placed
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.types import BoolArray, FloatArray, RangeReadings
from pretouch.units.findings import Finding

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
