"""A reproduction that a signal ends."""

import os
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from multiprocessing.connection import wait

import pytest

from pretouch_lab.run import RUN


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


@pytest.mark.parametrize("delay", [0.1, *(pytest.param(s, marks=pytest.mark.slow) for s in (0.0, 0.6))])
def test_ctrl_c_while_workers_start_leaves_no_traceback(tmp_path, delay):
    with started(tmp_path) as process:
        wait_for(process, (tmp_path / RUN).exists)
        time.sleep(delay)
        os.killpg(process.pid, signal.SIGINT)
        text = process.communicate(timeout=100)[1]
    assert process.returncode == 130
    assert "Traceback" not in text
