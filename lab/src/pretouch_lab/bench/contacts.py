"""Contacts: true forces on the surface of an arm that does not react; the skin may see the hand that pushes."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from pretouch.robot.body import placed
from pretouch.robot.postures import brought_to
from pretouch.sim.plant import Plant, PointForce
from pretouch.types import FloatArray
from pretouch_lab.bench.dense_skin import gap, surface
from pretouch_lab.bench.scenes import ArmCell, model, path_of, plant_of, scenario, sensing_of
from pretouch_lab.bench.streams import AWAY, Alone, Stream, record

_TRIES = 400
_SINK_M = 0.002
"""Largest apparent penetration of the hand into the arm at a contact [m]."""


@dataclass(frozen=True)
class Touching:
    """One contact: a force that rises, holds and falls, at a point fixed to a link."""

    link: int
    """Index of the link."""
    kind: int
    """Index of the kind in the scenario file."""
    force_n: float
    """Largest force [N]."""
    rise_s: float
    duration_s: float
    """From the start of the rise to the end of the fall [s]."""
    start: float
    """Start of the rise [s]."""
    point: FloatArray
    """(3,) link frame [m]."""
    normal: FloatArray
    """(3,) outward unit normal there, link frame."""
    inwards: FloatArray
    """(3,) unit vector of the force on the arm, link frame."""
    hand_radius: float
    """Radius of the visible hand that pushes [m]."""

    @property
    def end(self) -> float:
        """End of the fall [s]."""
        return self.start + self.duration_s

    def size_n(self, time: float) -> float:
        """Size of the force [N] at a time [s]."""
        edge = min(time - self.start, self.end - time) / self.rise_s
        return self.force_n * min(1.0, edge) if edge > 0 else 0.0

    def onset(self, of_n: float) -> float:
        """Time at which the force rises above `of_n` [s]."""
        return self.start + self.rise_s * of_n / self.force_n


def plan(number: int, hand_radius: float, seed: int) -> list[Touching]:
    """Draw `number` contacts: the seed decides places, forces and times."""
    family, rng = scenario("contacts"), np.random.default_rng([seed, 32])
    at, touches = float(family["duration"]["warm_up_s"]), list[Touching]()
    q = brought_to(model(), path_of("rest").point(0.0))  # start of the paths
    for _ in range(number):
        touches.append(touching(family["contact"], q, at, hand_radius, rng))
        at = touches[-1].end + rng.uniform(*family["duration"]["gap_s"])
    return touches


def touching(
    chosen: dict[str, Any], q: FloatArray, at: float, hand_radius: float, rng: np.random.Generator, name: str = ""
) -> Touching:
    """Draw a contact that begins at a time [s], in a posture (n,) [rad], on the named link or on any link.

    `chosen` is the table of contacts in a scenario file.
    """
    every = [(k, duration) for k, kind in enumerate(chosen["kind"]) for duration in kind["durations_s"]]
    k, duration = every[int(rng.integers(len(every)))]
    name = name or chosen["links"][int(rng.integers(len(chosen["links"])))]
    link = model().link_index(f"{model().description.name}_{name}")
    point, normal = place_on(link, q, hand_radius, rng, scenario("contacts")["hand"]["from_m"])
    inwards = chosen["tilt"] * rng.uniform(-1, 1, 3) - normal
    inwards /= np.linalg.norm(inwards)
    force = float(rng.choice(chosen["forces_n"]))
    rise = chosen["kind"][k]["rise_s"]
    return Touching(link, k, force, rise, duration, at, point, normal, inwards, hand_radius)


def place_on(
    link: int, q: FloatArray, radius: float, rng: np.random.Generator, from_m: float
) -> tuple[FloatArray, FloatArray]:
    """Draw a point and normal (3,) of a link's surface that a hand can reach along the normal, link frame.

    The test is for one posture (n,) [rad]. If no place is free, the last one is returned.
    """
    kin, arm = model().kinematics(q), model().capsules
    _, a, b, _ = placed(arm, kin)
    own = arm.of_links(np.array([link]))
    for _ in range(_TRIES):
        c = int(rng.integers(len(own.radius)))
        foot, normal = surface(own.a[c], own.b[c], rng.uniform(0, 2 * np.pi), rng.uniform())
        point = foot + own.radius[c] * normal
        ways = point + np.outer(radius + np.linspace(0.0, from_m, 9), normal)
        if gap(ways @ kin.rotation[link].T + kin.position[link], a, b, arm.radius).min() > radius - _SINK_M:
            break
    return point, normal


class Toucher:
    """Applies planned forces to an arm, and gives the position of the hand that pushes."""

    def __init__(self, plant: Plant, touches: list[Touching]) -> None:
        """Attach to a plant, so that the forces act whatever the arm does."""
        hand = scenario("contacts")["hand"]
        self._plant, self._touches = plant, touches
        self._from, self._speed = hand["from_m"], hand["speed_m_s"]
        self._way_s = self._from / self._speed
        self._next = 0
        self._pushed = 0
        plant.before_each_step(self._push)

    def _current(self, time: float) -> Touching | None:
        """Return the contact whose hand approaches, touches or leaves, None in between."""
        while self._next + 1 < len(self._touches) and time >= self._touches[self._next + 1].start - self._way_s:
            self._next += 1
        touch = self._touches[self._next] if self._touches else None
        if touch is None or not touch.start - self._way_s <= time <= touch.end + self._way_s:
            return None
        return touch

    def _push(self, time: float) -> float:
        """Apply the present force at the body's centre of mass, as MuJoCo needs it; return the time of the next one."""
        data, forces = self._plant.mj_data, self.forces(time)
        data.xfrc_applied[self._pushed] = 0.0
        if not forces:
            return min((touch.start for touch in self._touches[self._next :] if touch.start >= time), default=np.inf)
        ((self._pushed, at, force),) = forces
        data.xfrc_applied[self._pushed] = *force, *np.cross(at - data.xipos[self._pushed], force)
        return time

    def forces(self, time: float) -> list[PointForce]:
        """Return the force that acts at a time, for touch sensors: the simulation has no contact for it."""
        touch = self._current(time)
        if touch is None or touch.size_n(time) <= 0.0:
            return []
        rotation = self._plant.link_rotation[touch.link]
        at = self._plant.link_position[touch.link] + rotation @ touch.point
        return [PointForce(touch.link, at, touch.size_n(time) * (rotation @ touch.inwards))]

    def hand(self, time: float) -> FloatArray:
        """Centre of the hand (3,) [m] at a time [s], base frame."""
        touch = self._current(time)
        if touch is None:
            return AWAY
        off = self._speed * max(touch.start - time, time - touch.end, 0.0)
        rotation, origin = self._plant.link_rotation[touch.link], self._plant.link_position[touch.link]
        return np.asarray(origin + rotation @ (touch.point + (touch.hand_radius + off) * touch.normal))


def contact_stream(arm: ArmCell, seed: int) -> tuple[Stream, list[Touching]]:
    """Simulate an arm that is touched; return its stream and its contacts."""
    sensing = sensing_of(arm.sensing, seed)
    touches = plan(arm.count, sensing.hand_radius, seed)
    path, plant = path_of("circle" if arm.speed_m_s > 0 else "rest"), plant_of(arm.kind)
    what = Alone(path, arm.speed_m_s, plant, sensing, sensing.hand_radius, seed, last_s(touches), arm.world)
    return record(what, lambda plant: Toucher(plant, touches).hand), touches


def last_s(touches: list[Touching]) -> float:
    """Return the time after which no alarm counts for the last contact [s]."""
    return touches[-1].end + float(scenario("contacts")["judged"]["late_s"]) + 0.1
