"""Jobs on a dask.distributed cluster that is there already, and a sentence in bounded time when it is gone."""

import asyncio
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING, Any

from pretouch.errors import ExperimentError
from pretouch_lab.engine import TRIES
from pretouch_lab.sweep.work import Job, work

if TYPE_CHECKING:  # an extra
    from distributed import Client, Future

CONNECT_S = 10.0
"""Time a scheduler has to answer at first [s]."""
GONE_S = 15.0
"""Time after which a scheduler that does not answer counts as gone [s]."""
IDLE_S = 60.0
"""Time without any worker after which it is given up [s]."""
_LOOK_S = 0.5
_AHEAD = 4
"""Jobs handed over for each thread of the cluster: enough that none waits, and few where the scheduler goes away."""


def run_on_cluster(
    address: str, jobs: list[Job], done: Callable[[Job, object], None], lost: Callable[[Job, str], None]
) -> None:
    """Play jobs on a cluster, in their order. Raises ExperimentError where it is not there, or goes away.

    A job whose worker is killed is played again by the scheduler. Answers are text, and others, pickled ones too,
    are not read; but dask unpickles the errors of workers here, so that the cluster must be trusted.
    """
    with _client(address) as client:
        watch = _Watch(client, address)
        waiting = deque(jobs)
        finished: SimpleQueue[Future] = SimpleQueue()
        flying: dict[str, tuple[Job, Future]] = {}
        while waiting or flying:
            while waiting and len(flying) < max(1, _AHEAD * watch.threads):
                job = waiting.popleft()
                future = client.submit(work, job.written(), pure=False, retries=0)
                flying[future.key] = (job, future)
                future.add_done_callback(finished.put)
            try:
                future = finished.get(timeout=_LOOK_S)
            except Empty:
                watch.look()
                continue
            if future.key not in flying:
                continue
            if future.status in ("cancelled", "lost"):
                watch.gone()
            job, _ = flying.pop(future.key)
            if future.status == "finished":
                done(job, _answer(future, watch))
            else:
                lost(job, f"Its worker was killed {TRIES} times, or could not play it: see the worker's log.")


def _answer(future: "Future", watch: "_Watch") -> object:
    """Fetch an answer, None for one that is no text; what went away with it is found out in bounded time."""
    from distributed import CancelledError

    try:
        return future.result(timeout=GONE_S)
    except TypeError:  # not of msgpack
        return None
    except (TimeoutError, OSError, CancelledError):
        watch.gone()
        raise  # never: `gone` raises


class _Watch:
    """Whether the scheduler answers, and has workers."""

    def __init__(self, client: "Client", address: str) -> None:
        self._client, self._address = client, address
        self._worked = self._asked = time.monotonic()
        self.threads = 0
        self._ask()

    def look(self) -> None:
        """Raise ExperimentError if the scheduler is gone, or has had no worker for a while."""
        if self._client.status not in ("running", "connecting"):
            self.gone()
        now = time.monotonic()
        if now - self._asked < 2.0 and self._client.status == "running":
            return
        self._asked = now
        self._ask()
        if self.threads:
            self._worked = now
        elif now - self._worked > IDLE_S:
            raise ExperimentError(
                f"The scheduler {self._address} has had no worker for {IDLE_S:.0f} s: start one with"
                f" `dask worker {self._address} --nthreads 1`, or leave --scheduler out. What was done is kept."
            )

    def _ask(self) -> None:
        try:
            identity = self._client.sync(self._client.scheduler.identity, callback_timeout=GONE_S)
        except (OSError, TimeoutError, AttributeError, RuntimeError):
            self.gone()
        self.threads = sum(int(worker["nthreads"]) for worker in identity["workers"].values())

    def gone(self) -> None:
        """Say that it is."""
        raise ExperimentError(
            f"The scheduler {self._address} is gone. What was done is kept: the same command goes on when it is back,"
            " and without --scheduler on this computer."
        )


@contextmanager
def _client(address: str) -> "Iterator[Client]":
    """Connect to a scheduler for as long as the context lasts."""
    from distributed import Client

    client: Any = None
    try:
        asyncio.run(_greet(address))
        client = Client(address, timeout=CONNECT_S, set_as_default=False, deserializers=["msgpack"])
    except (OSError, ValueError, TimeoutError) as error:
        raise ExperimentError(
            f"No scheduler answers at {address}: start one with `dask scheduler`, give its address as tcp://HOST:PORT,"
            " or leave --scheduler out."
        ) from error
    try:
        yield client
    finally:
        with suppress(Exception):  # it may be gone, and what matters is said already
            client.close(timeout=2)


async def _greet(address: str) -> None:
    """Raise what `_client` expects unless a scheduler greets: dask's client waits for a silent one without end."""
    from distributed.comm import connect

    comm = await asyncio.wait_for(connect(address, timeout=CONNECT_S), CONNECT_S)
    await comm.close()
