"""Model of an electrode in a simulated room: the field lines that end on what is near, each by how far that is."""

import mujoco
import numpy as np
from numpy.random import Generator

from pretouch.compiled import compiled
from pretouch.sensing.sensor import Capacitive, cone_rays
from pretouch.sim.rays import Geoms, cast, placed, turned
from pretouch.types import FloatArray, RangeStatus

ELECTRODE_M = 0.03
"""Size of the electrode: at this distance its signal of a wall is half of that of a touch [m]. Ours."""
DIELECTRIC = 0.3
"""Signal of what stands in the room, wood or plastic, in that of a person or an arm, which are grounded [1]. Ours."""
NOISE = 0.001
"""Standard deviation of a signal, of 1 at the touch of a wall [1]. Ours, as the next two: a fist is felt at 18 cm."""
DRIFT, DRIFT_S = 0.001, 60.0
"""Standard deviation of how far the baseline has drifted [1], and for how long it remembers [s]."""
_FELT = 4.0
"""Standard deviations of noise and drift from which on a signal tells something."""
LEAST = _FELT * float(np.hypot(NOISE, DRIFT))
RINGS = 8
"""217 field lines: a fist at 18 cm has seven."""
STREAM = 64
"""Number of the random stream of drift."""

_OK, _SIGNAL, _MIN_RANGE = (int(s) for s in (RangeStatus.OK, RangeStatus.SIGNAL, RangeStatus.MIN_RANGE))


@compiled
def field(
    body: int, T_body: FloatArray, rays: FloatArray, position: FloatArray, rotation: FloatArray, geoms: Geoms,
    farthest: float,
) -> float:  # fmt: skip
    """Signal of an electrode without noise, 1 at the touch of a grounded wall.

    It sits at T_body (4, 4) on a body, with field lines along the unit vectors `rays` (N, 3), sensor frame. Each that
    meets something adds cos(a) e / (e + d), with a its angle to the axis, d its length and e the electrode's size:
    together that of a plate before a wall. `position` (L, 3) [m] and `rotation` (L, 9) are of the bodies.
    """
    origin, R = placed(position[body], rotation[body], T_body)
    lines = turned(R, rays)
    distance, normal, struck = cast(origin, lines, geoms, body, farthest)
    total, all_of_it = 0.0, 0.0
    for i in range(len(rays)):
        all_of_it += rays[i, 2]
        if 0.0 <= distance[i] <= farthest:
            outwards = lines[i, 0] * normal[i, 0] + lines[i, 1] * normal[i, 1] + lines[i, 2] * normal[i, 2]
            away = 0.0 if outwards > 0.0 else distance[i]  # it began inside what presses on the electrode
            of_it = 1.0 if geoms.body[struck[i]] > 0 else DIELECTRIC
            total += of_it * rays[i, 2] * ELECTRODE_M / (ELECTRODE_M + away)
    return total / all_of_it


class Electrode:
    """One in a simulated room, with a baseline of its own that drifts."""

    def __init__(
        self, sensor: Capacitive, body: int, T_body: FloatArray, data: mujoco.MjData, geoms: Geoms, rng: Generator
    ) -> None:
        """Mount it at T_body (4, 4) on one of MuJoCo's bodies; `rng` says how it drifts."""
        rays = cone_rays(RINGS, sensor.angle)
        self._sensor, self._rng = sensor, rng
        self._room = body, T_body, rays, data.xpos, data.xmat, geoms, sensor.farthest_m
        self._drift, self._last = 0.0, -np.inf

    def measure(self, time: float, draw: float) -> tuple[float, int, float, float]:
        """Return distance [m], status, its standard deviation [m], and the signal, as a unit tells them by its map.

        `draw` is normal.
        """
        remembered = float(np.exp((self._last - time) / DRIFT_S))  # Ornstein and Uhlenbeck; 0 at first
        drawn = DRIFT * np.sqrt(1.0 - remembered**2) * self._rng.standard_normal()
        self._drift, self._last = remembered * self._drift + drawn, time
        return told(self._sensor, field(*self._room) + self._drift + NOISE * draw)


def told(sensor: Capacitive, signal: float) -> tuple[float, int, float, float]:
    """Return distance [m], status, its standard deviation [m], and the signal, as the unit tells them by its map."""
    distance = sensor.distance(signal)
    if signal < LEAST or distance > sensor.farthest_m:
        return 0.0, _SIGNAL, 0.0, signal
    status = _MIN_RANGE if distance < sensor.nearest_m else _OK
    return distance, status, sensor.spread_1 * distance, signal
