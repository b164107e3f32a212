"""Contacts: true forces on the surface of an arm that does not react, brought by a hand that the skin may see."""

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
"""How deep the hand may seem to be in the arm where it touches it [m]."""


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
    """[s]"""
    point: FloatArray
    """(3,) link frame [m]."""
    normal: FloatArray
    """(3,) outward unit normal there, link frame."""
    inwards: FloatArray
    """(3,) unit vector of the force on the arm, link frame."""
    hand_radius: float
    """Of the visible hand that brings it [m]."""

    @property
    def end(self) -> float:
        """When the force is gone [s]."""
        return self.start + self.duration_s

    def size_n(self, time: float) -> float:
        """Size of the force [N] at a time [s]."""
        edge = min(time - self.start, self.end - time) / self.rise_s
        return self.force_n * min(1.0, edge) if edge > 0 else 0.0

    def onset(self, of_n: float) -> float:
        """When the force passes a size [s]."""
        return self.start + self.rise_s * of_n / self.force_n


def plan(number: int, hand_radius: float, seed: int) -> list[Touching]:
    """Draw so many contacts: the seed says where, how and when."""
    family, rng = scenario("contacts"), np.random.default_rng([seed, 32])
    at, touches = float(family["duration"]["warm_up_s"]), list[Touching]()
    q = brought_to(model(), path_of("rest").point(0.0))  # where the paths begin
    for _ in range(number):
        touches.append(touching(family["contact"], q, at, hand_radius, rng))
        at = touches[-1].end + rng.uniform(*family["duration"]["gap_s"])
    return touches


def touching(
    chosen: dict[str, Any], q: FloatArray, at: float, hand_radius: float, rng: np.random.Generator, name: str = ""
) -> Touching:
    """Draw a contact that begins at a time [s], in a posture (n,) [rad], on a link of that name or on any.

    `chosen` is what a scenario file has of contacts.
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
    """Draw a point and normal (3,) of a link's surface that a hand can come to along the normal, link frame.

    That is judged in one posture (n,) [rad]. Where no free place is found, the last one drawn is taken.
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
    """Lays planned forces on an arm, and says where the hand is that brings them."""

    def __init__(self, plant: Plant, touches: list[Touching]) -> None:
        """Attach to a plant: forces act from then on, whatever the arm does."""
        hand = scenario("contacts")["hand"]
        self._plant, self._touches = plant, touches
        self._from, self._speed = hand["from_m"], hand["speed_m_s"]
        self._way_s = self._from / self._speed
        self._next = 0
        self._pushed = 0
        plant.before_each_step(self._push)

    def _current(self, time: float) -> Touching | None:
        """Return the contact whose hand is on its way or there, None in between."""
        while self._next + 1 < len(self._touches) and time >= self._touches[self._next + 1].start - self._way_s:
            self._next += 1
        touch = self._touches[self._next] if self._touches else None
        if touch is None or not touch.start - self._way_s <= time <= touch.end + self._way_s:
            return None
        return touch

    def _push(self, time: float) -> float:
        """Let the force of now act, and return when there is the next: MuJoCo's acts at a body's centre of mass."""
        data, forces = self._plant.mj_data, self.forces(time)
        data.xfrc_applied[self._pushed] = 0.0
        if not forces:
            return min((touch.start for touch in self._touches[self._next :] if touch.start >= time), default=np.inf)
        ((self._pushed, at, force),) = forces
        data.xfrc_applied[self._pushed] = *force, *np.cross(at - data.xipos[self._pushed], force)
        return time

    def forces(self, time: float) -> list[PointForce]:
        """Return the force that acts at a time, for sensors of forces without a contact of the simulation."""
        touch = self._current(time)
        if touch is None or touch.size_n(time) <= 0.0:
            return []
        rotation = self._plant.link_rotation[touch.link]
        at = self._plant.link_position[touch.link] + rotation @ touch.point
        return [PointForce(touch.link, at, touch.size_n(time) * (rotation @ touch.inwards))]

    def hand(self, time: float) -> FloatArray:
        """Where the hand's centre is at a time (3,) [m], base frame."""
        touch = self._current(time)
        if touch is None:
            return AWAY
        off = self._speed * max(touch.start - time, time - touch.end, 0.0)
        rotation, origin = self._plant.link_rotation[touch.link], self._plant.link_position[touch.link]
        return np.asarray(origin + rotation @ (touch.point + (touch.hand_radius + off) * touch.normal))


def contact_stream(arm: ArmCell, seed: int) -> tuple[Stream, list[Touching]]:
    """Let an arm be touched; return its stream and its contacts."""
    sensing = sensing_of(arm.sensing, seed)
    touches = plan(arm.count, sensing.hand_radius, seed)
    what = Alone(
        path_of("circle" if arm.speed_m_s > 0 else "rest"), arm.speed_m_s, plant_of(arm.kind), sensing,
        sensing.hand_radius, seed, last_s(touches), arm.world,
    )  # fmt: skip
    return record(what, lambda plant: Toucher(plant, touches).hand), touches


def last_s(touches: list[Touching]) -> float:
    """Return when the last contact can no more be judged [s]."""
    return touches[-1].end + float(scenario("contacts")["judged"]["late_s"]) + 0.1
