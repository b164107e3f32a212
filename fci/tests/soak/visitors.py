"""Visitors of a page: they come, look, say something, read what they are sent or do not, and go without a word."""

from contextlib import suppress
from threading import Event, Thread

import msgspec
import numpy as np
import viser
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

_AT_ONCE = 3
CAMERA = {
    "type": "ViewerCameraMessage", "wxyz": [1.0, 0.0, 0.0, 0.0], "position": [2.0, 1.0, 1.0], "fov": 0.9, "near": 0.1,
    "far": 100.0, "image_height": 600, "image_width": 800, "look_at": [0.0, 0.0, 0.5], "up_direction": [0.0, 0.0, 1.0],
}  # fmt: skip
"""What viser's page says of where it looks from."""


class Visitors:
    """Some at a time, in threads; a context manager."""

    def __init__(self, url: str, seed: int) -> None:
        self._address, self._seed, self._over = url.replace("http", "ws", 1).rstrip("/"), seed, Event()
        self._threads = [
            Thread(target=self._come_and_go, args=(np.random.default_rng([seed, i]),)) for i in range(_AT_ONCE)
        ]
        self.visits, self.errors = 0, list[str]()

    def __enter__(self) -> "Visitors":
        for thread in self._threads:
            thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        for thread in self._threads:
            thread.join()

    def _come_and_go(self, rng: np.random.Generator) -> None:
        while not self._over.is_set():
            try:
                self._visit(rng)
            except (
                OSError,
                TimeoutError,
                ConnectionClosed,
            ) as error:  # it is a failure: the page is there all the time
                self.errors.append(f"{type(error).__name__}: {error}")
                self._over.wait(1.0)
            self.visits += 1
            self._over.wait(rng.uniform(0.0, 5.0))

    def _visit(self, rng: np.random.Generator) -> None:
        protocol, reads = f"viser-v{viser.__version__}", rng.random() < 0.7
        with connect(self._address, subprotocols=[protocol], max_size=None, max_queue=None if reads else 1) as page:  # type: ignore[list-item]
            page.send(msgspec.msgpack.encode(CAMERA))
            for _ in range(int(rng.integers(1, 40))):
                if self._over.wait(0.25):
                    break
                page.send(msgspec.msgpack.encode(CAMERA | {"fov": rng.uniform(0.3, 1.2)}))
                if reads:
                    with suppress(TimeoutError):
                        page.recv(timeout=0.0)
