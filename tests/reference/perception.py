"""From readings to obstacles, unit by unit: eq. 1, what a status means, how long a point is kept, what the arm sees
of itself."""

import numpy as np

from pretouch.perception.scene_filter import Fixtures
from pretouch.profiles import Profile
from pretouch.robot.model import RobotModel
from pretouch.sensing.sensor import PAPER_SENSOR, cone_rays
from pretouch.sensing.skin import Skin
from pretouch.types import Obstacles, RangeReadings, RangeStatus
from tests.reference.geometry import Posture, closest, first_hit

RAYS = cone_rays(2, PAPER_SENSOR.angle)
FAILURES = {
    RangeStatus.HARDWARE: " (it reports a hardware failure)",
    RangeStatus.STUCK: " (it repeats the same reading)",
}
A_TARGET = {RangeStatus.OK, RangeStatus.NO_WRAP_CHECK, RangeStatus.MERGED}
TOO_NEAR = {RangeStatus.MIN_RANGE, RangeStatus.MIN_CLIPPED}
NOTHING_NEAR = {RangeStatus.SIGNAL, RangeStatus.SIGMA, RangeStatus.OUT_OF_BOUNDS, RangeStatus.WRAPPED}


def shown(distance: float, status: int) -> float:
    """Distance a reading stands for [m], NaN for none: at least what the sensor can measure, none beyond its range."""
    if status in TOO_NEAR:
        return PAPER_SENSOR.nearest_m
    if status in A_TARGET and 0 <= distance <= PAPER_SENSOR.farthest_m:
        return max(distance, PAPER_SENSOR.nearest_m)
    return np.nan


def shown_by(readings: RangeReadings) -> np.ndarray:
    """The same (K,) of all readings."""
    return np.array([shown(d, s) for d, s in zip(readings.distance, readings.status, strict=True)])


def tells(distance: float, status: int) -> bool:
    """Whether a reading tells anything: a target, one far away, or that none near returns light. Failures do not."""
    far = status in A_TARGET and PAPER_SENSOR.farthest_m < distance < np.inf
    return bool(np.isfinite(shown(distance, status)) or far or status in NOTHING_NEAR)


class Eyes:
    """What is remembered of each unit's readings."""

    def __init__(self, model: RobotModel, skin: Skin, fixtures: Fixtures, profile: Profile) -> None:
        self.model, self.skin, self.fixtures = model, skin, fixtures
        self.looks, self.params = profile.perception is not None, profile.sight
        self.forget()

    def forget(self) -> None:
        """Begin anew."""
        units = range(len(self.skin))
        self.point: list[np.ndarray | None] = [None for _ in units]
        self.seen = [-np.inf for _ in units]
        self.used = [-np.inf for _ in units]
        self.heard = [-np.inf for _ in units]

    def look(self, posture: Posture, ee: np.ndarray, readings: RangeReadings, now: float) -> Obstacles:
        """Take in what is new; return the points known now, with the closest points of the body."""
        if not self.looks:
            return obstacles_of([])
        found = []
        for k in range(len(self.skin)):
            T = posture.T[self.skin.link[k]] @ self.skin.T_link_sensor[k]
            self._take(k, T, posture, readings, now)
            if now - self.seen[k] <= self.params.persistence_s:
                found.append((k, now - self.seen[k], *self._nearest(k, T, posture, ee)))
        return obstacles_of(found)

    def _take(self, k: int, T: np.ndarray, posture: Posture, readings: RangeReadings, now: float) -> None:
        stamp, distance, status = float(readings.stamp[k]), float(readings.distance[k]), int(readings.status[k])
        if not self.used[k] < stamp <= now:
            return
        self.used[k] = stamp
        if tells(distance, status):
            self.heard[k] = stamp
        d = shown(distance, status)
        late = now - stamp > self.params.persistence_s
        margin = self.params.self_margin_m or 0.0
        margin += min(self._spread(k, d), margin)
        if not np.isnan(d) and not late and d < self._predicted(k, T, posture) - margin:
            self.point[k], self.seen[k] = (T @ [0.0, 0.0, d, 1.0])[:3], stamp  # eq. 1

    def _spread(self, k: int, distance: float) -> float:
        """How far from its place a point may lie that unit k shows at a distance [m], by what is not known of it."""
        unit = self.skin.units[k]
        return self.params.spread_sigmas * float(np.hypot(unit.position_sigma, distance * unit.orientation_sigma))

    def _predicted(self, k: int, T: np.ndarray, posture: Posture) -> float:
        """Distance at which unit k would see another link or a fixture, over the rays of its cone."""
        if self.params.self_margin_m is None:
            return np.inf
        p, rays = T[:3, 3], RAYS @ T[:3, :3].T
        nearest = np.inf
        for part in (self.model.capsules, self.fixtures.capsules):
            other = part.link != self.skin.link[k]
            a, b = posture.ends(part)
            nearest = min(nearest, first_hit(p, rays, a[other], b[other], part.radius[other]))
        for plane in self.fixtures.planes:
            height, sinking = plane[:3] @ p - plane[3], -rays @ plane[:3]
            if height >= 0:
                nearest = min(nearest, (height / sinking[sinking > 0]).min(initial=np.inf))
        return nearest

    def _nearest(self, k: int, T: np.ndarray, posture: Posture, ee: np.ndarray) -> tuple:
        point, body = self.point[k], self.model.body
        assert point is not None
        c, on_body, direction, distance = closest(point, *posture.ends(body), body.radius, np.array([0.0, 0.0, 1.0]))
        u = self._spread(k, float(np.linalg.norm(point - T[:3, 3])))
        return point, max(0.0, np.linalg.norm(point - ee) - u), on_body, body.link[c], direction, distance - u

    def silence(self, now: float, status: np.ndarray) -> tuple[float, str]:
        """Factor on the speed for the unit that has been silent longest, and the names of those silent too long."""
        if not self.looks or not self.heard:
            return 1.0, ""
        ages = [now - heard for heard in self.heard]
        from_, to = self.params.slow_after_s, self.params.silent_after_s
        units = zip(self.skin.ids, ages, status, strict=True)
        names = [name + FAILURES.get(int(said), "") for name, age, said in units if age >= to]
        return min(1.0, max(0.0, (to - max(ages)) / (to - from_))), ", ".join(names)


def obstacles_of(found: list[tuple]) -> Obstacles:
    """Gather obstacles one by one: unit, age, point, ee_distance, body_point, link, direction, body_distance."""
    unit, age, point, ee_distance, body_point, link, direction, distance = (
        zip(*found, strict=True) if found else [()] * 8
    )
    return Obstacles(
        np.array(unit, dtype=np.int64), np.reshape(point, (-1, 3)), np.array(ee_distance),
        np.reshape(body_point, (-1, 3)), np.array(link, dtype=np.int64), np.reshape(direction, (-1, 3)),
        np.array(distance), np.zeros(len(unit)), np.array(unit, dtype=np.int64), np.array(age),
    )  # fmt: skip
