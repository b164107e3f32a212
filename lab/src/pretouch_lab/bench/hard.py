"""Hard arms, with the errors of real ones, in other motions than circle and line (`scenarios/hard.toml`)."""

from collections.abc import Callable

import numpy as np

from pretouch.profiles import profile
from pretouch.robot.body import placed
from pretouch.sim.plant import Plant
from pretouch.sim.plant_params import PlantParams
from pretouch.types import FloatArray
from pretouch_lab.bench.contacts import Toucher, Touching, last_s, place_on
from pretouch_lab.bench.dense_skin import gap
from pretouch_lab.bench.motions import Wandering, motion_of
from pretouch_lab.bench.scenes import ArmCell, model, path_of, scenario, sensing_of
from pretouch_lab.bench.streams import AWAY, PROFILE, Alone, Stream, record_moved
from pretouch_lab.replay import Place

WORLD = "hard"
"""Set of the domain randomisation that each seed draws its arm from."""
_TRIES = 300
_LOOKED_AT = 150
"""Numbers of drawn places for a bystander, and of postures of the motion to test each place against."""


def hard_stream(arm: ArmCell, seed: int) -> tuple[Stream, list[Touching]]:
    """Simulate an arm; return its stream and its contacts, none in free motion.

    With nobody near the arm has no units: they would only read the arm itself.
    """
    family, sensing = scenario("hard"), sensing_of("nominal", seed)
    start = float(family["duration"]["warm_up_s"])
    motion = motion_of(arm.path, seed, start + 2.0 * arm.counted_s)
    touches = _touched(motion, arm.count, seed)
    radius = sensing.hand_radius if touches else family["near"]["radius_m"]
    end_s, speed = last_s(touches) if touches else start + arm.counted_s, profile(PROFILE).task.speed_m_s
    units, q = None if arm.near == "nothing" else sensing, motion.at(0.0)[0]
    what = Alone(path_of("rest"), speed, PlantParams(), units, radius, seed, end_s, WORLD, q)

    def prepare(plant: Plant) -> Place:
        plant.before_each_step(_gripping(plant, motion))
        if touches:
            return Toucher(plant, touches).hand
        return _beside(motion, seed) if arm.near == "standing" else AWAY

    return record_moved(what, prepare, motion.command), touches


def _gripping(plant: Plant, motion: Wandering) -> Callable[[float], float]:
    """Return a function that grips and puts down the motion's loads at their times."""
    waiting = list(motion.loads)

    def grip(time: float) -> float:
        while waiting and waiting[0][0] <= time:
            plant.grip(waiting.pop(0)[1])
        return waiting[0][0] if waiting else np.inf

    return grip


def _beside(motion: Wandering, seed: int) -> FloatArray:
    """Draw a place (3,) [m] for a bystander: the first within the range of distances, or else the nearest to it."""
    near, rng, body = scenario("hard")["near"], np.random.default_rng([seed, 62]), model().body
    times = np.linspace(0.0, float(motion.start[-1]), _LOOKED_AT)
    swept = [placed(body, model().kinematics(motion.at(time)[0])) for time in times]
    low, high = near["gap_m"]
    smallest, best = np.inf, AWAY
    for _ in range(_TRIES):
        place = rng.uniform([-0.9, -0.9, 0.0], [0.9, 0.9, 1.2])
        least = min(float(gap(place[None], a, b, body.radius)[0]) for _, a, b, _ in swept) - near["radius_m"]
        off = max(low - least, least - high, 0.0)
        if off < smallest:
            smallest, best = off, place
        if not off:
            break
    return best


def _touched(motion: Wandering, number: int, seed: int) -> list[Touching]:
    """Draw the contacts of an arm: the seed decides places, forces and times."""
    family, rng, arm = scenario("hard"), np.random.default_rng([seed, 63]), model()
    chosen, hand = family["contact"], scenario("contacts")["hand"]
    radius, at, touches = sensing_of("nominal", seed).hand_radius, float(family["duration"]["warm_up_s"]), []
    for _ in range(number):
        link = arm.link_index(f"{arm.description.name}_{chosen['links'][int(rng.integers(len(chosen['links'])))]}")
        point, normal = place_on(link, motion.at(at)[0], radius, rng, hand["from_m"])
        inwards = chosen["tilt"] * rng.uniform(-1, 1, 3) - normal
        inwards /= np.linalg.norm(inwards)
        force, duration = float(rng.choice(chosen["forces_n"])), float(rng.choice(chosen["durations_s"]))
        touch = Touching(link, _PUSH, force, chosen["rise_s"], duration, at, point, normal, inwards, radius)
        touches.append(touch)
        at = touch.end + rng.uniform(*chosen["gap_s"])
    return touches


_PUSH = 1
"""Index of the contacts' kind in contacts.toml."""
