"""A network between units and their receiver that loses datagrams, in either direction."""

import select
import socket
from threading import Event, Thread

import numpy as np

LOSS = 0.1
"""Share of datagrams lost."""
_HERE = "127.0.0.1"
_LOOK_S = 0.1


class Relay:
    """Stands where the units take their receiver to be; a context manager."""

    def __init__(self, receiver: int, seed: int) -> None:
        """Pass on to a port of this machine; what is lost comes from the seed."""
        self._receiver, self._rng, self._over = (_HERE, receiver), np.random.default_rng(seed), Event()
        self._front = _bound()
        self.port = int(self._front.getsockname()[1])
        self._behind: dict[tuple[str, int], socket.socket] = {}
        """For each unit the socket that the receiver takes for it."""
        self._thread = Thread(target=self._work, daemon=True)
        self._thread.start()

    def __enter__(self) -> "Relay":
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join()
        for one in (self._front, *self._behind.values()):
            one.close()

    def _work(self) -> None:
        while not self._over.is_set():
            units = {socket_: unit for unit, socket_ in self._behind.items()}
            for ready in select.select([self._front, *units], [], [], _LOOK_S)[0]:
                self._pass_on(ready, units.get(ready))

    def _pass_on(self, ready: socket.socket, unit: tuple[str, int] | None) -> None:
        """Pass a datagram on, from a unit or to one, unless it is lost; nobody may be there, as on any network."""
        try:
            data, sender = ready.recvfrom(2048)
            if self._rng.random() < LOSS:
                return
            if unit is None:
                self._behind.setdefault(sender, _bound() if sender not in self._behind else ready)
                self._behind[sender].sendto(data, self._receiver)
            else:
                self._front.sendto(data, unit)
        except OSError:
            return


def _bound() -> socket.socket:
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    made.bind((_HERE, 0))
    return made
