"""Motions other than circle and line, as courses of the joints that an arm follows whatever touches it."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from pretouch.robot.body import placed
from pretouch.robot.postures import brought_to
from pretouch.types import FloatArray
from pretouch_lab.bench.dense_skin import gap
from pretouch_lab.bench.scenes import model, scenario

_POSTURES = 4000
_ALONG = 12
"""Number of postures to test between one posture and the next."""
PEAK = 1.875
"""Largest speed of a quintic from rest to rest over its mean speed."""
_PULL_1_S = 2.0
"""Gain on the arm's error from its course [1/s]."""
_TRIES = 200
_UP = np.array([0.0, 0.0, 1.0])
Rng = np.random.Generator


@dataclass(frozen=True)
class Wandering:
    """M moves from rest to rest, one after the other, and the loads that the arm grips and puts down."""

    q: FloatArray
    """(M + 1, n) postures [rad]."""
    start: FloatArray
    """(M,) start of each move [s]."""
    duration: FloatArray
    """(M,) duration of each move [s]."""
    loads: tuple[tuple[float, float], ...] = ()
    """Times [s] and the load from then on [kg]."""

    def at(self, time: float) -> tuple[FloatArray, FloatArray]:
        """Return joint positions (n,) [rad] and velocities (n,) [rad/s] at a time [s]."""
        k = max(0, int(np.searchsorted(self.start, time, side="right")) - 1)
        s = min(1.0, max(0.0, (time - float(self.start[k])) / float(self.duration[k])))
        way = self.q[k + 1] - self.q[k]
        along = s**3 * (10.0 - 15.0 * s + 6.0 * s * s)
        return self.q[k] + along * way, 30.0 * (s * (1.0 - s)) ** 2 / float(self.duration[k]) * way

    def command(self, time: float, q_commanded: FloatArray) -> FloatArray:
        """Return joint velocities (n,) [rad/s] at a time [s] that keep commanded positions (n,) [rad] on the course."""
        q, qd = self.at(time)
        return qd + _PULL_1_S * (q - q_commanded)


def posture(rng: np.random.Generator, before: FloatArray | None) -> FloatArray:
    """Draw a posture (n,) with a free straight path to it; without such a posture, return the one before."""
    arm, part = model(), scenario("localization")["motion"]["range"]
    for _ in range(_POSTURES):
        q = np.asarray(arm.q_mid + part * (arm.q_max - arm.q_min) / 2 * rng.uniform(-1, 1, arm.n))
        ways = [q] if before is None else [before + k / _ALONG * (q - before) for k in range(_ALONG, 0, -1)]
        if all(is_free(way) for way in ways):
            return q
    return arm.description.q_ready if before is None else before


def is_free(q: FloatArray) -> bool:
    """Return True if the arm is clear of the floor and of itself."""
    chosen, arm = scenario("localization")["motion"], model()
    body = arm.capsules
    _, a, b, _ = placed(body, arm.kinematics(q))
    moves = np.asarray(arm.rigid >= 0)[body.link]
    lowest = np.minimum(a[:, 2], b[:, 2]) - body.radius
    order = arm.moved_by.sum(axis=1)[body.link]
    if lowest[moves & (order > 2)].min() < chosen["floor_m"]:
        return False
    for c in np.flatnonzero(order > 3):
        others = np.flatnonzero(order < order[c] - 2)
        points = np.linspace(a[c], b[c], 5)
        if gap(points, a[others], b[others], body.radius[others]).min() < body.radius[c] + chosen["apart_m"]:
            return False
    return True


def motion_of(name: str, seed: int, until: float) -> Wandering:
    """Draw a motion of the named kind until a time [s] from the seed."""
    rng = np.random.default_rng([seed, 61])
    if name in ("pick-and-place", "untold-load"):
        return _pick_and_place(scenario("hard")["motion"][name], rng, until)
    return _course(scenario("hard")["motion"][name], _NEXT[name], rng, until)


def wandering(seed: int, until: float) -> Wandering:
    """Draw the motion of a wandering arm until a time [s] from the seed."""
    return _course(scenario("localization")["motion"], _NEXT["random"], np.random.default_rng([seed, 41]), until)


Next = Callable[[FloatArray, dict[str, Any], Rng], list[FloatArray]]
"""Returns the postures (n,) that follow one [rad]."""


def _course(chosen: dict[str, Any], after: Next, rng: Rng, until: float) -> Wandering:
    """Chain moves until a time [s]."""
    q, start, duration, at = [posture(rng, None)], [], [], 1.0
    while at < until:
        for target in after(q[-1], chosen, rng):
            start.append(at)
            fastest = float(np.abs(target - q[-1]).max())
            duration.append(max(_SHORTEST_S, PEAK * fastest / rng.uniform(*chosen["speed_rad_s"])))
            at += duration[-1] + rng.uniform(*chosen["rest_s"])
            q.append(target)
    return Wandering(np.array(q), np.array(start), np.array(duration))


_SHORTEST_S = 0.15
"""Shortest move [s], as in jogging."""


def _one_joint(q: FloatArray, chosen: dict[str, Any], rng: Rng) -> list[FloatArray]:
    turned = np.eye(len(q))[rng.integers(len(q))] * rng.choice([-1.0, 1.0])
    return [_free_of(q, lambda: q + turned * rng.uniform(*chosen["way_rad"]))]


def _with_stops(q: FloatArray, chosen: dict[str, Any], rng: Rng) -> list[FloatArray]:
    low, high = chosen["stops"]
    parts = np.sort(rng.uniform(0.05, 0.95, int(rng.integers(low, high + 1))))
    target = posture(rng, q)
    return [q + part * (target - q) for part in (*parts, 1.0)]


def _free_of(q: FloatArray, draw: Callable[[], FloatArray]) -> FloatArray:
    """Draw until a posture is free and within the limits; without one, move towards the ready posture."""
    arm = model()
    for _ in range(_TRIES):
        target = draw()
        if np.all(np.abs(target - arm.q_mid) < 0.45 * (arm.q_max - arm.q_min)) and is_free(target):
            return target
    return q + 0.1 * (arm.description.q_ready - q)


_NEXT: dict[str, Next] = {
    **dict.fromkeys(("random", "standing"), lambda q, _chosen, rng: [posture(rng, q)]),
    "jogging": _one_joint,
    "stop-and-go": _with_stops,
    "teleoperation": lambda q, chosen, rng: [
        _free_of(q, lambda: q + rng.uniform(-1.0, 1.0, len(q)) * rng.uniform(*chosen["way_rad"]))
    ],
}


def _pick_and_place(chosen: dict[str, Any], rng: Rng, until: float) -> Wandering:
    """Return a motion to and fro between two places, with a load gripped at one and put down at the other."""
    hand, arm = model().ee, model()
    places = [
        np.array([rng.uniform(*chosen["x_m"]), side * rng.uniform(*chosen["y_m"]), rng.uniform(*chosen["z_m"])])
        for side in rng.permutation([-1.0, 1.0])
    ]
    low = [brought_to(arm, place) for place in places]
    high = [brought_to(arm, place + rng.uniform(*chosen["over_m"]) * _UP) for place in places]
    turn = [high[0], low[0], high[0], high[1], low[1], high[1]]
    q, start, duration, loads, at = [high[1]], [], [], [], 1.0
    while at < until:
        kg = rng.uniform(*chosen["load_kg"])
        for number, target in enumerate(turn):
            way = arm.kinematics(target).position[hand] - arm.kinematics(q[-1]).position[hand]
            fastest = np.abs(target - q[-1]).max() / rng.uniform(*chosen["speed_rad_s"])
            start.append(at)
            duration.append(max(_SHORTEST_S, PEAK * max(fastest, float(np.linalg.norm(way)) / chosen["hand_m_s"])))
            q.append(target)
            rest = rng.uniform(*chosen["rest_s"])
            if number in (1, 4):
                loads.append((at + duration[-1] + 0.5 * rest, kg if number == 1 else 0.0))
            at += duration[-1] + rest
    return Wandering(np.array(q), np.array(start), np.array(duration), tuple(loads))
