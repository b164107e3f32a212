import os
import signal
import subprocess
import sys
import time
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest
from lab.tests.sweep.made import files, ignore, opened_ishigami

from pretouch.errors import ExperimentError
from pretouch_lab.sweep import cluster
from pretouch_lab.sweep.run import Where, play

ROOT = Path(__file__).parents[3]  # workers import the experiment from the tests


@contextmanager
def process(module, *arguments):
    """A process of the cluster, and the line in which it says that it is there."""
    command = [sys.executable, "-m", f"distributed.cli.{module}", *arguments, "--no-dashboard"]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True, cwd=ROOT) as started:
        try:
            yield started
        finally:
            started.kill()


def said(started, words):
    """Read what a process says until some words come."""
    for line in started.stderr:
        if words in line:
            return line.split()[-1]
    raise AssertionError(f"it ended without {words!r}")


@pytest.fixture
def small_cluster():
    """A scheduler and two workers on this computer: (scheduler, workers, address)."""
    with ExitStack() as stack:
        scheduler = stack.enter_context(process("dask_scheduler", "--host", "127.0.0.1", "--port", "0"))
        address = said(scheduler, "Scheduler at:")
        workers = [
            stack.enter_context(
                process("dask_worker", address, "--nthreads", "1", "--no-nanny", "--host", "127.0.0.1")
            )
            for _ in range(2)
        ]  # fmt: skip
        for worker in workers:
            said(worker, "Registered to:")
        yield scheduler, workers, address


def test_no_scheduler_is_a_sentence_in_bounded_time(tmp_path, monkeypatch):
    monkeypatch.setattr(cluster, "CONNECT_S", 1.0)
    run = opened_ishigami(tmp_path)
    with pytest.raises(ExperimentError, match=r"No scheduler answers at tcp://127\.0\.0\.1:9: start one with"):
        play(run, Where(scheduler="tcp://127.0.0.1:9"), ignore)


@pytest.mark.slow
def test_cells_of_a_worker_that_is_killed_half_way_are_played_by_the_other(tmp_path, small_cluster):
    _, workers, address = small_cluster
    run = opened_ishigami(tmp_path, samples=8, pause_s="0.02")
    kills = iter([lambda: None, lambda: os.kill(workers[0].pid, signal.SIGKILL)])
    play(run, Where(scheduler=address), lambda _: next(kills, lambda: None)())
    assert workers[0].wait(10) == -signal.SIGKILL
    assert run.failed == []
    assert len(files(run)) == 40


@pytest.mark.slow
def test_a_scheduler_that_is_gone_half_way_is_said_and_the_sweep_goes_on_here(tmp_path, small_cluster):
    scheduler, _, address = small_cluster
    run = opened_ishigami(tmp_path, samples=16, pause_s="0.05")
    kills = iter([lambda: None, scheduler.kill])
    start = time.monotonic()
    with pytest.raises(ExperimentError, match=f"scheduler {address} is gone. What was done is kept"):
        play(run, Where(scheduler=address), lambda _: next(kills, lambda: None)())
    assert time.monotonic() - start < 60
    again = opened_ishigami(tmp_path, samples=16, pause_s="0.05")
    assert again.notes == []
    assert 2 <= len(files(again)) < 80
    play(again, Where(processes=2), ignore)
    assert again.wanted == []
