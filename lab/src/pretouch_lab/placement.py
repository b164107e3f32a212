"""Places of people, and of what stands in their room, in the reach of another arm than a Panda."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from pretouch.errors import ExperimentError
from pretouch.robot.description import is_shipped
from pretouch.robot.model import RobotModel
from pretouch.robot.postures import brought_to, capsule_ends, kinematics_of, segment_distance
from pretouch.sim.paper_scenes import PANDA_SIDE, SIGNS, Placement, placement_for

_VISITED_ABOVE_M = 0.05
"""Height of a visiting person's hand above the circle's centre, of the Panda's circle [m]."""
_RADIUS_M = 0.25
"""Radius of the paper's circle [m]."""
_POINTS = 24
"""Points of the circle at which the arm is looked at, on either way round."""
_BESIDE_M, _INSIDE_M = 0.078, 0.0
"""How far the centre of a person's hand is from the arm where it is nearest: as the Panda's hand passes it."""
_STEP_M, _STEPS = 0.005, 400
"""How far from the plane y = 0 these places are searched for, from far to near."""


@dataclass(frozen=True)
class PeoplePlacement(Placement):
    """Placement of the paper's paths for an arm, and of people beside them."""

    beside: tuple[float, float] = (0.43, 0.43)
    """Distance of a person's hand beside the circle from the plane y = 0, at -y and at +y [m]: the Panda's hand,
    whose side comes to 0.35 m, passes it by 3 cm."""
    inside: tuple[float, float] = (0.35, 0.35)
    """The same of a hand half of which is in the way."""

    def moved(self, x: float, y: float, z: float) -> tuple[float, float, float]:
        """Return where what stands at a point of the paper's room is for this arm [m].

        Within the circle's width it is scaled with it, beyond it keeps its distance from it.
        """
        if self == UNMOVED:
            return x, y, z
        inner = min(abs(y), _RADIUS_M)
        aside = float(np.copysign(self.scale * inner + abs(y) - inner, y))
        return self.scale * x, aside, self.scale * z

    def visited(self, place: str, sign: float) -> tuple[float, float, float]:
        """Return where a person's hand is held `beside` the circle or `inside` it, on the side `sign` (1: +y) [m]."""
        x, _, z = self.point(0.5, 0.0, 0.25)
        aside = (self.beside if place == "beside" else self.inside)[int(sign > 0)]
        above = self.hand("+y" if sign > 0 else "-y").above - PANDA_SIDE.above
        return x, sign * aside, z + above + _VISITED_ABOVE_M

    def sentence(self, arm: str) -> str:
        """Say what was done to the paper's paths and places."""
        if self == UNMOVED:
            return f"{arm} has the paper's own paths and places."
        places = [f"{a:.2f} and {b:.2f} m" for a, b in (self.beside, self.inside)]
        return (
            f"{self.paths_sentence(arm)} A person's hand beside the circle is {places[0]} from the plane y = 0 (at -y"
            f" and at +y), one in the way {places[1]}, where the free arm passes 3 cm from the one and through the"
            " middle of the other."
        )


UNMOVED = PeoplePlacement()
"""The paper's own, of a Panda and an FR3."""


@lru_cache(maxsize=1)
def people_placement(model: RobotModel) -> PeoplePlacement:
    """Place people beside the circle and in the way of an arm, where the Panda's people are. The last is remembered.

    A person's hand is held beside the circle where the whole free arm passes it by as much as the Panda's hand does.
    Raises ExperimentError where the arm cannot follow the paths, or has no such place.
    """
    paths = placement_for(model)
    if is_shipped(model.description):
        return UNMOVED
    ways = [paths.path("circle", sign) for sign in (-1.0, 1.0)]
    postures = [brought_to(model, way.point(s)) for way in ways for s in np.linspace(0.0, way.length, _POINTS)]
    ends = capsule_ends(model, kinematics_of(model, np.array(postures)))
    moved = np.isin(model.capsules.link, model.body.link)
    a, b, radius = ends[:, moved][:, :, 0], ends[:, moved][:, :, 1], model.capsules.radius[moved]
    aside, places = _STEP_M * np.arange(_STEPS, 0.0, -1.0), list[tuple[float, float]]()
    unplaced = PeoplePlacement(**vars(paths))
    for sign in SIGNS.values():
        x, _, z = unplaced.visited("beside", sign)
        at = np.column_stack([np.full(len(aside), x), sign * aside, np.full(len(aside), z)])[:, None, None]
        free = (segment_distance(a, b, at, at) - radius).min(axis=(1, 2))
        if not (free < _INSIDE_M).any():
            raise ExperimentError(
                f"There is no place for a person's hand in the way of {model.description.name}'s hand on the circle, at"
                f" x = {x:.2f} m and z = {z:.2f} m: look at the capsules of its last links in arm.xml."
            )
        # from the side as far in as nothing of the arm is nearer
        beside, inside = (aside[max(int(np.argmax(free < clear)) - 1, 0)] for clear in (_BESIDE_M, _INSIDE_M))
        places.append((float(beside), float(inside)))
    (right, right_in), (left, left_in) = places
    return PeoplePlacement(**vars(paths), beside=(right, left), inside=(right_in, left_in))
