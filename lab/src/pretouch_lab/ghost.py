"""Drives the ghost of a scene: a ball that is seen, and that touches nothing."""

from collections.abc import Callable

import numpy as np

from pretouch.sim.plant import Plant
from pretouch.types import FloatArray


class Ghost:
    """Puts the ghost of a plant's scene where a function of time says, before each physics step."""

    def __init__(self, plant: Plant, place: Callable[[float], FloatArray]) -> None:
        """Attach to a plant whose scene has a ghost; `place(time)` returns its centre (3,) [m], base frame."""
        body = plant.mj_model.body("ghost")
        # a view into the simulation's memory, taken once
        self._at, self._place = plant.mj_data.mocap_pos[int(plant.mj_model.body_mocapid[body.id])], place
        plant.before_each_step(self._move)

    @property
    def position(self) -> FloatArray:
        """Centre of the ghost (3,) [m], base frame."""
        return np.array(self._at)

    def _move(self, time: float) -> None:
        self._at[:] = self._place(time)
