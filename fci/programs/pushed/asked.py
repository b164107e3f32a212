"""What is pushed, and what that comes to at the joints: the same for every simulator in MuJoCo."""

import sys
from collections.abc import Iterator
from typing import Any

import mujoco
import numpy as np


class LinkPush:
    """A force at a link's centre of mass, for as long as nothing else is asked for."""

    def __init__(self, model: Any, data: Any, links: list[int]) -> None:
        """Take MuJoCo's model and data, and the bodies of the seven links."""
        self._model, self._data, self._links = model, data, links
        self._asked: tuple[int, np.ndarray] | None = None

    def apply(self) -> None:
        """Push, before a step."""
        if self._asked is None:
            return
        link, force = self._asked
        for body in self._links:
            self._data.xfrc_applied[body] = 0.0
        self._data.xfrc_applied[self._links[link], :3] = force

    def ask(self, link: int, force: np.ndarray) -> np.ndarray:
        """Push link 0 to 6 with a force (3,) [N], base frame, and return what that is at the joints (7,) [Nm]."""
        self._asked = (link, force)
        J = np.empty((3, self._model.nv))
        mujoco.mj_jacBodyCom(self._model, self._data, J, None, self._links[link])
        return J[:, :7].T @ force


def obey(push: LinkPush) -> None:
    """Do what the standard input asks for, until it ends."""
    print("ready", flush=True)
    for link, force in _lines():
        print(*push.ask(link, force), flush=True)


def _lines() -> Iterator[tuple[int, np.ndarray]]:
    for line in sys.stdin:
        link, *force = line.split()
        yield int(link), np.array(force, dtype=float)
