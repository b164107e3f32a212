import json
import signal
import subprocess
import sys
import time
from dataclasses import replace
from multiprocessing.connection import wait
from pathlib import Path

import pytest

from pretouch.errors import ExperimentError, ParameterError, SkinError
from pretouch.experiments import campaign
from pretouch.experiments.campaign import Request, finished, open_folder, run_campaign, trial_file

SMALL = Request(("static",), seeds=1, profiles=("blind",))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"experiments": ("statik",)}, "'statik' is unknown: choose from static, avoidance, dynamic, all"),
        ({"seeds": 0}, "number of seeds is 0: give at least 1"),
        ({"seeds": -3}, "number of seeds is -3"),
        ({"profiles": ()}, "profiles are none"),
        ({"profiles": ("paper", "paper")}, "name each wanted one once"),
        ({"restrictions": "firm"}, "'firm' is unknown: choose from off, hard, slack, floor"),
        ({"stiffness": 0.0}, "stiffness is 0 N/m"),
        ({"stiffness": float("nan")}, "stiffness is nan N/m"),
    ],
)
def test_what_cannot_be_done_is_said_in_a_sentence(change, words):
    with pytest.raises(ExperimentError, match=words):
        replace(SMALL, **change)


def test_an_unknown_profile_is_refused():
    with pytest.raises(ParameterError, match="'brave' is unknown: choose from paper, blind"):
        replace(SMALL, profiles=("brave",))


def test_a_bad_skin_is_refused_before_anything_runs(tmp_path):
    with pytest.raises(SkinError, match=r"nowhere\.toml cannot be read"):
        run_campaign(replace(SMALL, skin=str(tmp_path / "nowhere.toml")), tmp_path / "out", lambda *_: None)
    assert not (tmp_path / "out").exists()


def test_tasks_take_all_cells_seed_by_seed():
    tasks = Request(("static", "dynamic"), seeds=2).tasks()
    assert len(tasks) == 2 * (8 + 2)
    assert [seed for _, seed in tasks] == [0] * 10 + [1] * 10
    assert len({trial_file(Path("x"), *task) for task in tasks}) == 20


def test_a_run_goes_on_where_it_was(tmp_path, monkeypatch):
    one = replace(SMALL, seeds=1)
    seen = []
    run_campaign(one, tmp_path, lambda *counts: seen.append(counts))
    assert seen == [(0, 4), (1, 4), (2, 4), (3, 4), (4, 4)]
    rows = finished(one, tmp_path)
    assert [row["seed"] for row in rows] == [0, 0, 0, 0]
    files = sorted((tmp_path / "trials").iterdir())
    files[2].unlink()
    kept = {file: file.stat().st_mtime_ns for file in files if file.exists()}
    seen.clear()
    run_campaign(one, tmp_path, lambda *counts: seen.append(counts))
    assert seen == [(3, 4), (4, 4)]
    assert {file: file.stat().st_mtime_ns for file in kept} == kept
    assert finished(one, tmp_path) == rows
    monkeypatch.setattr(campaign, "ProcessPoolExecutor", None)
    run_campaign(one, tmp_path, lambda *counts: None)


@pytest.mark.parametrize("change", [{"seeds": 5}, {"stiffness": 2000.0}, {"restrictions": "floor"}])
def test_a_folder_of_another_run_is_not_touched(tmp_path, change):
    open_folder(SMALL, tmp_path)
    before = (tmp_path / "run.json").read_text()
    (name,) = change
    with pytest.raises(ExperimentError, match=rf"holds a run with {name} = .*: give another --out"):
        open_folder(replace(SMALL, **change), tmp_path)
    assert (tmp_path / "run.json").read_text() == before


def test_a_damaged_folder_is_named(tmp_path):
    (tmp_path / "run.json").write_text("{")
    with pytest.raises(ExperimentError, match=r"run\.json is damaged"):
        open_folder(SMALL, tmp_path)


def test_a_folder_that_cannot_be_made_is_named(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(ExperimentError, match="cannot be used: Not a directory: give another --out"):
        open_folder(SMALL, tmp_path / "file" / "below")


@pytest.fixture
def long_run(tmp_path):
    """A run of many trials as its own process, some of them finished."""
    out = tmp_path / "out"
    command = [sys.executable, "-m", "pretouch.cli", "reproduce", "static", "--seeds", "50", "--out", str(out)]
    process = subprocess.Popen(
        command,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        # a background job of a shell inherits that Ctrl-C is ignored
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    with process:
        try:
            deadline = time.monotonic() + 200
            while len(list((out / "trials").glob("[!.]*.json"))) < 3:
                assert process.poll() is None, process.stderr.read()
                assert time.monotonic() < deadline
                wait([process.stderr], 0.1)
            yield process, out
        finally:
            process.kill()


@pytest.mark.parametrize(("number", "code"), [(signal.SIGTERM, 143), (signal.SIGINT, 130), (signal.SIGKILL, -9)])
def test_a_stopped_run_leaves_whole_results(long_run, number, code):
    process, out = long_run
    process.send_signal(number)
    said = process.communicate(timeout=100)[1]
    assert process.returncode == code
    rows = [json.loads(file.read_text()) for file in (out / "trials").glob("[!.]*.json")]
    assert len(rows) >= 3
    assert all(row["experiment"] == "static" for row in rows)
    if number != signal.SIGKILL:
        assert "finished trials are in" in said
        results = json.loads((out / "results.json").read_text())
        assert len(results["trials"]) == len(rows)
        assert "Traceback" not in said
