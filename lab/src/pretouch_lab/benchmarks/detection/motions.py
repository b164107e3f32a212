"""Motions other than circle and line, as courses of the joints (`scenarios/hard.toml`)."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from pretouch.robot.postures import brought_to
from pretouch.types import FloatArray
from pretouch_lab.benchmarks.detection.arm import model
from pretouch_lab.benchmarks.localization.motion import PEAK, Wandering, is_free, posture
from pretouch_lab.benchmarks.scenario_files import scenario

_TRIES = 200
_UP = np.array([0.0, 0.0, 1.0])
Rng = np.random.Generator


@dataclass(frozen=True)
class Motion:
    """What an arm does, and the loads that it grips and puts down meanwhile."""

    course: Wandering
    loads: tuple[tuple[float, float], ...] = ()
    """From each time on [s] what it carries [kg]."""

    def load(self, time: float) -> float:
        """Return what it carries at a time [kg]."""
        return next((kg for since, kg in reversed(self.loads) if since <= time), 0.0)


def motion_of(name: str, seed: int, until: float) -> Motion:
    """Draw a motion of the scenario file by its name for so long [s]; the seed says which."""
    rng = np.random.default_rng([seed, 61])
    if name in ("pick-and-place", "untold-load"):
        return _pick_and_place(scenario("hard")["motion"][name], rng, until)
    return Motion(_course(scenario("hard")["motion"][name], _NEXT[name], rng, until))


Next = Callable[[FloatArray, dict[str, Any], Rng], list[FloatArray]]
"""Gives the postures (n,) that come after one [rad]."""


def _course(chosen: dict[str, Any], after: Next, rng: Rng, until: float) -> Wandering:
    """String ways together until a time [s]."""
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
"""Shortest way [s]: nobody jogs by less."""


def _anywhere(q: FloatArray, _chosen: dict[str, Any], rng: Rng) -> list[FloatArray]:
    return [posture(rng, q)]


def _one_joint(q: FloatArray, chosen: dict[str, Any], rng: Rng) -> list[FloatArray]:
    turned = np.eye(len(q))[rng.integers(len(q))] * rng.choice([-1.0, 1.0])
    return [_free_of(q, lambda: q + turned * rng.uniform(*chosen["way_rad"]))]


def _a_little(q: FloatArray, chosen: dict[str, Any], rng: Rng) -> list[FloatArray]:
    return [_free_of(q, lambda: q + rng.uniform(-1.0, 1.0, len(q)) * rng.uniform(*chosen["way_rad"]))]


def _with_stops(q: FloatArray, chosen: dict[str, Any], rng: Rng) -> list[FloatArray]:
    low, high = chosen["stops"]
    parts = np.sort(rng.uniform(0.05, 0.95, int(rng.integers(low, high + 1))))
    target = posture(rng, q)
    return [q + part * (target - q) for part in (*parts, 1.0)]


def _free_of(q: FloatArray, draw: Callable[[], FloatArray]) -> FloatArray:
    """Draw until a posture within the limits is free; where none is, go towards the ready one."""
    arm = model()
    for _ in range(_TRIES):
        target = draw()
        if np.all(np.abs(target - arm.q_mid) < 0.45 * (arm.q_max - arm.q_min)) and is_free(target):
            return target
    return q + 0.1 * (arm.description.q_ready - q)


_NEXT: dict[str, Next] = {
    "random": _anywhere, "standing": _anywhere, "jogging": _one_joint, "stop-and-go": _with_stops,
    "teleoperation": _a_little,
}  # fmt: skip


def _pick_and_place(chosen: dict[str, Any], rng: Rng, until: float) -> Motion:
    """Go to and fro between two places, take something at one and put it down at the other."""
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
    return Motion(Wandering(np.array(q), np.array(start), np.array(duration)), tuple(loads))
