"""Domain randomisation of a trial: what its seed draws of a named set, under what the experiment itself varies."""

import re
from dataclasses import dataclass
from functools import cache
from hashlib import sha256

from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.sim.plant_params import PlantParams, plant_params_of
from pretouch.sim.random_skin import Misplacement, misplaced
from pretouch.sim.randomisation import SETS, drawn, with_own, world_set
from pretouch.sim.range_finder import RangeFinderParams

named_set = cache(world_set)


@dataclass(frozen=True)
class Parts:
    """What of a trial the domain randomisation decides."""

    plant: PlantParams
    ranging: RangeFinderParams
    skin: Skin
    """Where the units truly sit."""
    believed: Skin | None
    """Where the controller believes them to be; None: it knows the truth."""


def randomised(name: str, seed: int, model: RobotModel, parts: Parts) -> Parts:
    """Return the parts of a trial as its seed draws them of a set; as they are with no name.

    What the parts have otherwise than the usual arm, sensors and skin is what the experiment varies, and stays.
    """
    if not name:
        return parts
    usual = plant_params_of(model.description)
    world = drawn(named_set(name), seed, usual)
    believed, off = parts.believed, world.misplaced
    if believed is None and off != Misplacement() and len(parts.skin):
        believed = misplaced(parts.skin, model, off, seed)[0]
    plant, ranging = parts.plant, with_own(world.ranging, parts.ranging, RangeFinderParams())
    return Parts(with_own(world.plant, plant, usual), ranging, parts.skin, believed)


def folder_part(name: str) -> str:
    """Return what a folder's name has of a set: nothing of none, so that runs with different sets are kept apart."""
    if not name:
        return ""
    if name in SETS:
        return f"-{name}"
    safe = re.sub(r"[^A-Za-z0-9.]+", "-", name.removesuffix(".toml")).strip("-.")[-40:]
    return f"-{safe}-{sha256(name.encode()).hexdigest()[:6]}"


def sentence(name: str) -> str:
    """Say with which set something was played, or nothing of the usual arm."""
    if not name:
        return ""
    about = named_set(name).about
    return f"Domain randomisation {name}: other arms and sensors than those of the published tables. {about}"
