"""Workload of a control step: many points near a moving arm that restrict its motion."""

import itertools

import numpy as np

from pretouch.control.path import Circle
from pretouch.errors import ExperimentError
from pretouch.importing.ready import reach_of
from pretouch.profiles import Profile
from pretouch.robot.body import Capsules, from_axes, placed
from pretouch.robot.description import panda
from pretouch.robot.model import RobotModel
from pretouch.sensing.sensor import PAPER_SENSOR
from pretouch.sensing.skin import Skin
from pretouch.sensing.unit import SensorUnit
from pretouch.types import FloatArray, Inputs, RangeReadings, RangeStatus, RobotState

LARGEST_SKIN = 10_000
"""Largest number of units: more would cover the arm more than once."""
UNIT_RATE = 50.0
"""Readings of a unit per second (paper, III-A)."""

_SPHERES, _SPHERE_RADIUS = 40, 0.1
_ROOM_CENTER, _ROOM_RADIUS = np.array([0.25, 0.0, 0.45]), 1.0
"""Centre and radius of the Panda's round room [m], as wide as its reach: every beam ends at a sphere or at the wall."""
_CLEAR = 0.3, 0.5
"""Least and largest distance of a sphere from the arm at the start [m]; nearer spheres would stop the arm by eq. 6."""
_HAND, _CIRCLE = 0.1, 0.1
"""Reach of the hand round its origin, and radius of the path [m]."""
_JOINTS_BEFORE = 2
"""Number of joints that move the first link with units."""
_ABOVE, _SEEN = 0.006, 0.55
"""Height of a unit above its link, and its largest first reading [m]: within d_notice of Table I."""
_FORCE_NOISE, _DRAWS = 0.3, 4096
"""Standard deviation of the force estimate [N], and its samples before they repeat."""
_IN_VAIN, _TRIES = 20, 40
"""Number of rounds over all links without a single unit before an error, and of tries on a link before the next one:
some links have few places with a view."""


class Workload:
    """An arm with K units among spheres in a round room, on a circle, that follows its commands exactly.

    Every unit has a reading 50 times a second, at times of its own. With `all_new` every reading has a new stamp in
    every cycle, unlike those of a real skin. Time is counted in cycles, so a run does not depend on the speed of the
    machine.
    """

    def __init__(self, model: RobotModel, units: int, profile: Profile, seed: int, all_new: bool = False) -> None:
        """Draw spheres, skin and the units' times from a seed."""
        if not 1 <= units <= LARGEST_SKIN:
            raise ExperimentError(f"The number of points is {units}: give 1 to {LARGEST_SKIN}.")
        rng = np.random.default_rng(seed)
        self._model, self._period = model, profile.task.control_period_s
        self._q, self._qd, self._cycle = model.description.q_ready.copy(), np.zeros(model.n), 0
        kin = model.kinematics(self._q)
        body, hand = placed(model.capsules, kin), kin.position[model.ee]
        self.path = Circle(center=tuple(hand - [0.0, _CIRCLE, 0.0]), radius=_CIRCLE)
        self._wider = reach_of(model) / reach_of(RobotModel(panda()))
        self.spheres = _spheres(rng, body, np.array([self.path.point(s) for s in np.linspace(0, self.path.length, 32)]))
        """(40, 3) centres [m], base frame."""
        self.skin = self._skin(rng, units, body)
        self._force = np.zeros((_DRAWS, 6))
        self._force[:, :3] = rng.normal(0.0, _FORCE_NOISE, (_DRAWS, 3))
        self._all_new = all_new
        self._phase = rng.uniform(0.0, 1 / UNIT_RATE, units)
        self._turn, self._distance = np.full(units, -np.inf), np.zeros(units)

    def inputs(self) -> Inputs:
        """Return the controller's inputs in this cycle."""
        units, now = len(self.skin), self._cycle * self._period
        turn = np.floor((now - self._phase) * UNIT_RATE)
        due = np.flatnonzero(turn > self._turn)
        kin, T, link = self._model.kinematics(self._q), self.skin.T_link_sensor[due], self.skin.link[due]
        R = kin.rotation[link]
        origin = kin.position[link] + np.einsum("kij,kj->ki", R, T[:, :3, 3])
        self._turn, self._distance[due] = turn, self._ranges(origin, np.einsum("kij,kj->ki", R, T[:, :3, 2]))
        stamp = np.full(units, now) if self._all_new else np.minimum(self._phase + turn / UNIT_RATE, now)
        readings = RangeReadings(stamp, self._distance.copy(), np.full(units, int(RangeStatus.OK)))
        wrench = self._force[self._cycle % _DRAWS]
        robot = RobotState(now, self._q, self._qd, self._q, self._qd, np.zeros(self._model.n), wrench)
        return Inputs(now, robot, readings)

    def move(self, qd: FloatArray) -> None:
        """Advance one cycle with joint velocities (n,) [rad/s]."""
        self._q, self._qd, self._cycle = self._q + qd * self._period, qd, self._cycle + 1

    def _ranges(self, origin: FloatArray, beam: FloatArray) -> FloatArray:
        """Return the distance (k,) [m] along rays (k, 3) to the nearest sphere, or to the room's wall."""
        along, half = _crossing(origin, beam, self.spheres, _SPHERE_RADIUS)
        sphere = np.where((half >= 0) & (along > 0), along - np.sqrt(np.maximum(half, 0.0)), np.inf).min(axis=1)
        along, half = _crossing(origin, beam, self._wider * _ROOM_CENTER[None], self._wider * _ROOM_RADIUS)
        wall: FloatArray = (along + np.sqrt(half))[:, 0]
        return np.minimum(sphere, wall)

    def _skin(self, rng: np.random.Generator, units: int, body: Capsules) -> Skin:
        """Place units on all links in turn that face away from the arm in its posture, and see a near surface."""
        model, kin, skin = self._model, self._model.kinematics(self._q), list[SensorUnit]()
        first = int(np.argmax(model.moved_by.sum(axis=1) >= _JOINTS_BEFORE))
        for tried, link in enumerate(itertools.cycle(range(first, len(model.links)))):
            if len(skin) == units:
                break
            if not skin and tried > _IN_VAIN * len(model.links):
                raise ExperimentError(
                    f"No unit on {model.description.name} sees past the arm in the posture q_ready: set a more"
                    " stretched q_ready in robot.toml."
                )
            capsules = np.flatnonzero(body.link == link)
            for _ in range(_TRIES if len(capsules) else 0):
                T_O_sensor = _outwards(rng, body, int(rng.choice(capsules)))
                p, beam = T_O_sensor[:3, 3], T_O_sensor[:3, 2]
                reading = float(self._ranges(p[None], beam[None])[0])
                if reading <= _SEEN and _sees_past(body, link, p, beam, reading):
                    T, R = np.eye(4), kin.rotation[link]
                    T[:3, :3], T[:3, 3] = R.T @ T_O_sensor[:3, :3], R.T @ (p - kin.position[link])
                    skin.append(SensorUnit(f"unit_{len(skin)}", model.links[link], T))
                    break
        return Skin(skin, model)


def _distance(points: FloatArray, body: Capsules) -> FloatArray:
    """Signed distance (P, C) [m] from each point (P, 3) to each capsule."""
    return np.asarray(np.linalg.norm(from_axes(points, body.a, body.b)[1], axis=2) - body.radius)


def _spheres(rng: np.random.Generator, body: Capsules, around: FloatArray) -> FloatArray:
    """Draw the centres (S, 3) [m] of spheres round the arm, none near the path (P, 3) of its hand."""
    low, high = np.minimum(body.a, body.b).min(axis=0) - 1.0, np.maximum(body.a, body.b).max(axis=0) + 1.0
    centers: list[FloatArray] = []
    while len(centers) < _SPHERES:
        center = rng.uniform(low, high)
        clear = float(_distance(center[None], body).min()) - _SPHERE_RADIUS
        passed = float(np.linalg.norm(around - center, axis=1).min()) - _SPHERE_RADIUS - _HAND
        if _CLEAR[0] <= min(clear, passed) and clear <= _CLEAR[1]:
            centers.append(center)
    return np.array(centers)


def _outwards(rng: np.random.Generator, body: Capsules, c: int) -> FloatArray:
    """Draw a pose (4, 4) just above a capsule, base frame: z points away from its axis."""
    axis = body.b[c] - body.a[c]
    z = np.cross(axis, rng.normal(size=3))
    z /= np.linalg.norm(z)
    x = axis / np.linalg.norm(axis)
    T = np.eye(4)
    T[:3, :3] = np.column_stack([x, np.cross(z, x), z])
    T[:3, 3] = body.a[c] + rng.uniform() * axis + (body.radius[c] + _ABOVE) * z
    return T


def _sees_past(body: Capsules, link: int, p: FloatArray, beam: FloatArray, reading: float) -> bool:
    """Return True if a unit is outside the arm, and no other link is in its cone up to its reading [m]."""
    along = np.linspace(0.0, reading, 16)
    others = _distance(p + along[:, None] * beam, body)[:, body.link != link]
    outside = float(_distance(p[None], body).min()) >= 0.5 * _ABOVE
    return outside and bool(np.all(others > along[:, None] * np.tan(PAPER_SENSOR.angle / 2)))


def _crossing(
    origin: FloatArray, beam: FloatArray, centers: FloatArray, radius: float
) -> tuple[FloatArray, FloatArray]:
    """Return the distances along rays to the points nearest to centres (k, S) [m], and squared half chords there."""
    to = centers - origin[:, None]
    along = (to * beam[:, None]).sum(-1)
    return along, radius**2 - (to * to).sum(-1) + along**2
