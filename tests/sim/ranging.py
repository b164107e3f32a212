"""A room with something in front of units on the hand, and all they report."""

from dataclasses import dataclass

import numpy as np

from pretouch.sensing.skin import Skin
from pretouch.sim.plant import Plant
from pretouch.sim.plant_params import PlantParams
from pretouch.sim.range_finder import RangeFinders
from pretouch.sim.scene import Box, HandSpec

FORWARD = np.array([[0.0, 0.0, 1.0, 0.027], [0.0, 1.0, 0.0, 0.0], [-1.0, 0.0, 0.0, 0.03], [0.0, 0.0, 0.0, 1.0]])
"""Pose on the hand whose beam points along +x of the base in the ready posture."""
ORIGIN = np.array([0.33389, 0.0, 0.56028])
"""Where that sensor is then [m]."""
CONE_MEAN = 1.0198
"""A flat wall of one brightness, seen through 1 + 6 + 12 rays tilted by 0, 6.75 and 13.5 degrees and weighted by
their strength cos(tilt)^3, would be read farther than it is by this factor, sum of cos^2 over sum of cos^3, if the
sensor were not calibrated against one. So what fills only the middle of the cone is read nearer by as much."""
EXACT = {"offset_max_m": 0.0, "noise_floor_m": 0.0, "noise_rate": 0.0, "dropout": 0.0}
NO_ERROR = PlantParams(mass_error=0.0, payload_max_kg=0.0)


def wall(distance: float, name: str = "wall", half_width: float = 2.0) -> Box:
    return Box(name, (ORIGIN[0] + distance + 0.05, 0.0, ORIGIN[2]), (0.05, half_width, half_width), 75_000.0)


def ball(gap: float) -> HandSpec:
    """A hand, its surface `gap` [m] in front of the sensor."""
    return HandSpec(start=(ORIGIN[0] + gap + 0.05, 0.0, ORIGIN[2]))


@dataclass
class Rig:
    """Some units in a room, and all they report."""

    plant: Plant
    finders: RangeFinders
    skin: Skin

    def collect(self, duration: float) -> dict[str, np.ndarray]:
        """Each reading that became the newest of its unit: when it was seen, unit, stamp, distance, status."""
        rows, last = [], self.finders.read().stamp
        for _ in range(round(duration / 0.001)):
            self.plant.advance(0.001)
            now = self.finders.read()
            for unit in np.flatnonzero(now.stamp > last):
                rows.append((self.plant.time, unit, now.stamp[unit], now.distance[unit], now.status[unit]))
            last = now.stamp
        return dict(zip(("seen", "unit", "stamp", "distance", "status"), np.array(rows).T, strict=True))
