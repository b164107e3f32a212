import json
import os
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from dataclasses import replace
from multiprocessing.connection import wait
from pathlib import Path

import pytest

from pretouch.errors import ExperimentError, SkinError
from pretouch.sensing.skin import PAPER_SKIN
from pretouch_lab import campaign
from pretouch_lab.campaign import Request, play_trial, recording_file, trial_file

SMALL = Request(("static",), seeds=1, profiles=("blind",))


def test_tasks_take_all_cells_once_seed_by_seed():
    tasks = Request(("static", "dynamic"), seeds=2).trials()
    assert len(tasks) == 2 * (8 + 2)
    assert [seed for _, seed in tasks] == [0] * 10 + [1] * 10
    assert len({trial_file(Path("x"), *task) for task in tasks}) == 20


@pytest.mark.parametrize("own", [True, False])
def test_a_changed_skin_file_is_noticed(tmp_path, monkeypatch, own):
    file, out = tmp_path / "skin.toml", tmp_path / "out"
    file.write_bytes(PAPER_SKIN.read_bytes())
    monkeypatch.setattr(campaign, "skin_file", lambda _arm: file)
    request = replace(SMALL, skin=str(file) if own else None)
    request.open(out)
    request.open(out)
    file.write_bytes(PAPER_SKIN.read_bytes().replace(b"-0.108", b"-0.109"))
    with pytest.raises(ExperimentError, match="but the skin file has changed since: give another --out"):
        request.open(out)
    file.unlink()
    with pytest.raises(SkinError, match="cannot be read: No such file"):
        request.open(out)


def test_a_trial_that_a_signal_ends_ends_its_worker_and_leaves_no_result(tmp_path, monkeypatch):
    class Ended(Exception):
        pass

    def end(code):
        raise Ended(code)

    def terminated(*_args):
        raise SystemExit(143)

    monkeypatch.setattr(campaign.os, "_exit", end)
    monkeypatch.setitem(campaign.EXPERIMENTS, "static", replace(campaign.EXPERIMENTS["static"], trial=terminated))
    request = Request(("static",), seeds=1)
    with pytest.raises(Ended, match="143"):
        play_trial(request, tmp_path, *request.trials()[0], tmp_path / "trials" / "row.json")
    assert list((tmp_path / "trials").glob("*")) == []


@pytest.mark.parametrize(("record", "kept"), [("first", [0]), ("all", [0, 1])])
def test_the_trials_that_are_wanted_are_recorded(tmp_path, monkeypatch, record, kept):
    def played(_cell, seed, context):
        if context.recording:
            context.recording.write_text(str(seed))
        return {}, None

    monkeypatch.setitem(campaign.EXPERIMENTS, "static", replace(campaign.EXPERIMENTS["static"], trial=played))
    request = Request(("static",), seeds=2, record=record)
    cell = request.trials()[0][0]
    (tmp_path / "recordings").mkdir()
    recording_file(tmp_path, cell, 0).with_suffix(".unfinished").write_text("of a killed worker")
    for seed in (0, 1):
        play_trial(request, tmp_path, cell, seed, tmp_path / "row.json")
    assert [seed for seed in (0, 1) if recording_file(tmp_path, cell, seed).exists()] == kept
    assert recording_file(tmp_path, cell, 0).read_text() == "0"
    assert len(list((tmp_path / "recordings").iterdir())) == len(kept)


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
        wait_for(process, (tmp_path / "run.json").exists)
        time.sleep(delay)
        os.killpg(process.pid, signal.SIGINT)
        said = process.communicate(timeout=100)[1]
    assert process.returncode == 130
    assert "Traceback" not in said


def worker_of(process):
    """The process of one of a run's workers."""
    children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
    return int([pid for pid in children if b"spawn_main" in Path(f"/proc/{pid}/cmdline").read_bytes()][-1])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("of_worker", "number", "code", "words"),
    [
        (False, signal.SIGINT, 130, "finished trials are in"),
        (False, signal.SIGTERM, 143, "finished trials are in"),
        (False, signal.SIGKILL, -9, ""),
        (True, signal.SIGKILL, 2, "A worker process was killed"),
    ],
)
def test_a_stopped_run_and_one_whose_worker_is_killed_leave_whole_results(tmp_path, of_worker, number, code, words):
    with started(tmp_path) as process:
        wait_for(process, lambda: len(list((tmp_path / "trials").glob("[!.]*.json"))) >= 3)
        os.kill(worker_of(process) if of_worker else process.pid, number)
        said = process.communicate(timeout=100)[1]
    assert process.returncode == code
    assert words in said
    rows = [json.loads(file.read_text()) for file in (tmp_path / "trials").glob("[!.]*.json")]
    assert len(rows) >= 3
    assert all(row["experiment"] == "static" for row in rows)
    if code > 0:
        assert "Traceback" not in said
        assert len(json.loads((tmp_path / "results.json").read_text())["trials"]) == len(rows)
