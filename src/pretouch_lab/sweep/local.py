"""Jobs in processes of this computer; one whose process is killed is played again, and not for ever."""

from collections import Counter, deque
from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool

from pretouch_lab.sweep.work import Job, work
from pretouch_lab.workers import interrupt_held_back, workers

TRIES = 3
"""Times a job is played whose process is killed each time."""

Done = Callable[[Job, object], None]
"""Is handed a job and the worker's answer."""
Lost = Callable[[Job, str], None]
"""Is handed a job that cannot be played, and why."""


class _Killed(Exception):
    """A process was killed while these jobs were being played."""

    def __init__(self, jobs: list[Job]) -> None:
        super().__init__()
        self.jobs = jobs


def run_local(jobs: list[Job], processes: int, done: Done, lost: Lost) -> None:
    """Play jobs, the longest first.

    A pool of processes does not tell which of its jobs killed one. Those that were being played are played again, each
    alone, so that a job that is killed every time is found, and no other is given up with it.
    """
    waiting = deque(sorted(jobs, key=lambda job: -job.cost_s))
    suspects: deque[Job] = deque()
    killed: Counter[str] = Counter()
    while waiting or suspects:
        source, count = (suspects, 1) if suspects else (waiting, processes)
        try:
            with workers(min(count, len(source))) as pool:
                _drain(pool, source, count, done)
        except _Killed as end:
            for job in end.jobs:
                killed[job.cells[0].key] += 1
                if killed[job.cells[0].key] >= TRIES:
                    lost(job, f"The process that played it was killed {TRIES} times, for want of memory perhaps.")
                else:
                    suspects.append(job)


def _drain(pool: ProcessPoolExecutor, source: deque[Job], count: int, done: Done) -> None:
    """Play all jobs of a queue, no more at once than there are processes."""
    flying: dict[Future[str], Job] = {}
    while source or flying:
        with interrupt_held_back():
            while source and len(flying) < count:
                job = source.popleft()
                try:
                    flying[pool.submit(work, job.written())] = job
                except BrokenProcessPool as error:
                    raise _Killed([job, *flying.values()]) from error
        broken = []
        for future in wait(flying, return_when=FIRST_COMPLETED).done:
            job = flying.pop(future)
            try:
                answer = future.result()
            except BrokenProcessPool:
                broken.append(job)
            else:
                done(job, answer)
        if broken:
            raise _Killed([*broken, *flying.values()])
