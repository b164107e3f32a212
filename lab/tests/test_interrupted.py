"""A reproduction that a signal ends, or whose worker is killed."""

import json
import os
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from multiprocessing.connection import wait
from pathlib import Path

import pytest

from pretouch_lab.run import ROWS, RUN


@contextmanager
def started(out):
    """A run of many trials as its own process and group."""
    command = [sys.executable, "-m", "pretouch.cli", "reproduce", "static", "--seeds", "50", "--out", str(out)]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, process_group=0)
    with process:
        try:
            yield process
        finally:
            process.kill()


def wait_for(process, happened):
    deadline = time.monotonic() + 200
    while not happened():
        assert process.poll() is None, process.stderr.read()
        assert time.monotonic() < deadline
        wait([process.stderr], 0.02)


@pytest.mark.parametrize("delay", [0.1, *(pytest.param(s, marks=pytest.mark.slow) for s in (0.0, 0.4, 0.8))])
def test_ctrl_c_while_workers_start_leaves_no_traceback(tmp_path, delay):
    with started(tmp_path) as process:
        wait_for(process, (tmp_path / RUN).exists)
        time.sleep(delay)
        os.killpg(process.pid, signal.SIGINT)
        text = process.communicate(timeout=100)[1]
    assert process.returncode == 130
    assert "Traceback" not in text


def worker_of(process):
    """The process of one of a run's workers."""
    children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
    return int([pid for pid in children if b"spawn_main" in Path(f"/proc/{pid}/cmdline").read_bytes()][-1])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("of_worker", "number", "code", "words"),
    [
        (False, signal.SIGINT, 130, f"rows are in {{}}/{ROWS}; the same command"),
        (False, signal.SIGTERM, 143, f"rows are in {{}}/{ROWS}; the same command"),
        (True, signal.SIGKILL, 2, "A worker process was killed, for want of memory perhaps, while it played"),
    ],
)
def test_a_stopped_run_and_one_whose_worker_is_killed_leave_whole_rows(tmp_path, of_worker, number, code, words):
    with started(tmp_path) as process:
        wait_for(process, lambda: (tmp_path / ROWS).exists() and (tmp_path / ROWS).read_bytes().count(b"\n") >= 3)
        os.kill(worker_of(process) if of_worker else process.pid, number)
        text = process.communicate(timeout=100)[1]
    assert process.returncode == code
    assert words.format(tmp_path) in text
    assert "Traceback" not in text
    assert len([json.loads(line) for line in (tmp_path / ROWS).read_text().splitlines()]) >= 3
