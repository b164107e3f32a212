"""A scene that only counts what it is sent."""

from types import SimpleNamespace
from typing import Any

import numpy as np


class Node(SimpleNamespace):
    """What a scene gives for a thing added: all that is set on it counts."""

    def __init__(self, scene: "FakeScene", name: str, given: dict[str, Any]) -> None:
        super().__init__(**given)
        self.__dict__.update(_scene=scene, name=name)

    def __setattr__(self, key: str, value: Any) -> None:
        self._scene.sent.append((self.name, key, _size(value)))
        self.__dict__[key] = value

    def remove(self) -> None:
        self._scene.nodes.pop(self.name)


class FakeScene:
    """Stands in for `viser.SceneApi`."""

    def __init__(self) -> None:
        self.nodes: dict[str, Node] = {}
        self.sent: list[tuple[str, str, int]] = []

    def __getattr__(self, method: str) -> Any:
        def add(name: str, *values: Any, **given: Any) -> Node:
            self.nodes[name] = Node(self, name, {"visible": True, "values": values, **given})
            return self.nodes[name]

        return add if method.startswith("add_") else lambda *_, **__: None

    def bytes_of(self, *keys: str) -> int:
        return sum(size for _, key, size in self.sent if key in keys)


def _size(value: Any) -> int:
    return len(value) if isinstance(value, bytes) else np.asarray(value).nbytes
