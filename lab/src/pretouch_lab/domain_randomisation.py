"""Domain randomisation of a trial: the seed draws an arm and sensors from a set; the experiment's own values stay."""

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
    """Parts of a trial that the domain randomisation draws."""

    plant: PlantParams
    ranging: RangeFinderParams
    skin: Skin
    """Units at their true places."""
    believed: Skin | None
    """Units at the places that the controller assumes; None: the true ones."""


def randomised(name: str, seed: int, model: RobotModel, parts: Parts) -> Parts:
    """Draw the parts of a trial from a set by its seed; without a name, return the parts unchanged.

    A value that differs from the default arm, sensors or skin was set by the experiment, and stays.
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
    """Return the suffix of a folder's name that separates runs with different sets; empty without a set."""
    if not name:
        return ""
    if name in SETS:
        return f"-{name}"
    safe = re.sub(r"[^A-Za-z0-9.]+", "-", name.removesuffix(".toml")).strip("-.")[-40:]
    return f"-{safe}-{sha256(name.encode()).hexdigest()[:6]}"


def sentence(name: str) -> str:
    """Return a sentence that names the set of a run; empty without a set."""
    if not name:
        return ""
    about = named_set(name).about
    return f"Domain randomisation {name}: other arms and sensors than those of the published tables. {about}"
