"""Worker processes for long computations, which end with their parent and leave Ctrl-C to it."""

import os
import signal
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import active_children, get_context, parent_process
from threading import Thread

from pretouch.signals import kept_from_children, leave_to_parent, noted


@contextmanager
def workers(count: int) -> Iterator[ProcessPoolExecutor]:
    """Have so many worker processes; an exception ends them at once, and what they were to do."""
    pool = ProcessPoolExecutor(count, mp_context=get_context("spawn"), initializer=_start)
    try:
        yield pool
    except BaseException:
        for process in active_children():
            process.terminate()
        pool.shutdown(wait=True, cancel_futures=True)
        raise
    pool.shutdown()


@contextmanager
def interrupt_held_back() -> Iterator[None]:
    """Hold Ctrl-C back while processes start; they inherit that, so that it finds none of them half imported.

    Here it may come by another thread of a library, which this one's mask does not keep from calling the handler.
    """
    with noted(signal.SIGINT), kept_from_children({signal.SIGINT}):
        yield


def _start() -> None:
    """Leave Ctrl-C to the parent, which ends the workers in order; and do not outlive it if it is killed."""
    leave_to_parent({signal.SIGINT})
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
