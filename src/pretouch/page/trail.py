"""Trail of the end-effector, coloured as in the paper's Fig. 4, of bounded length and bounded traffic."""

from enum import Enum

import numpy as np
from viser import SceneApi

from pretouch.explanation import OFF_PATH_M, binding
from pretouch.page import palette
from pretouch.types import ControlStep, FloatArray, Mode

SPACING_M = 0.005
"""Length of a segment, about [m]."""
BLOCK = 40
"""Segments sent together: the newest block is sent again as it grows, the others stay."""
BLOCKS = 16
"""Blocks kept: 3.2 m, twice round the paper's circle."""
_PERIOD_S = 0.1


class Activity(Enum):
    """Activity of the arm along its path."""

    FOLLOWING = palette.FOLLOWING
    AVOIDING = palette.LIMITING
    """Off the path, and kept from it by an obstacle."""
    RECOVERING = palette.RECOVERING
    """Off the path, on the way back."""
    REACTING = palette.REACTING
    HOLDING = palette.HOLDING


def activity(step: ControlStep) -> Activity:
    """Return the arm's activity in a step."""
    if step.mode is not Mode.TRACK:
        return Activity.REACTING if step.mode is Mode.REACT else Activity.HOLDING
    if np.linalg.norm(step.ee_position - step.path_position) < OFF_PATH_M:
        return Activity.FOLLOWING
    return Activity.AVOIDING if binding(step).any() else Activity.RECOVERING


class Trail:
    """The newest `BLOCK` * `BLOCKS` segments of the end-effector's trail.

    Blocks are used over again: a page keeps what was ever added to it, and may be open for days.
    """

    def __init__(self, scene: SceneApi, root: str = "") -> None:
        none = np.zeros((1, 2, 3))
        self._blocks = [
            scene.add_line_segments(
                f"{root}/trail/{i}", none, none.astype(np.uint8), thickness=3.5, thickness_units="screen", visible=False
            )
            for i in range(BLOCKS)
        ]
        self._visible, self._sent = True, -np.inf
        self._points: list[FloatArray] = []
        self._colours: list[palette.Colour] = []
        self._last: FloatArray | None = None
        self._full = 0
        """Blocks filled so far, those that were used over again included."""

    def __len__(self) -> int:
        return min(self._full, BLOCKS - 1) * BLOCK + len(self._points)

    def show(self, visible: bool) -> None:
        """Show or hide it."""
        self._visible = visible
        used = min(self._full + 1, BLOCKS) if self._points else 0
        for block in self._blocks[:used]:
            block.visible = visible

    def add(self, step: ControlStep) -> None:
        """Append the arm's position in a step."""
        here = step.ee_position
        if self._last is None:
            self._last = here
        if np.linalg.norm(here - self._last) < SPACING_M:
            return
        if len(self._points) == BLOCK:
            self._send()
            self._points, self._colours = [], []
            self._full += 1
        self._points.append(np.stack([self._last, here]))
        self._colours.append(activity(step).value)
        self._last = here

    def draw(self, now: float) -> None:
        """Send new segments, at a time [s]; at most ten times a second."""
        if self._points and now - self._sent >= _PERIOD_S:
            self._sent = now
            self._send()

    def clear(self) -> None:
        """Clear the trail."""
        for block in self._blocks:
            block.visible = False
        self._points, self._colours, self._last, self._full = [], [], None, 0

    def _send(self) -> None:
        block = self._blocks[self._full % BLOCKS]
        block.points = np.array(self._points, dtype=np.float32)
        block.colors = np.repeat(palette.as_vertex(self._colours)[:, None], 2, axis=1)
        block.visible = self._visible
