"""Plays whose rows a later run continues, in this process and in worker processes."""

import json
import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from functools import partial

import pytest

from pretouch.errors import ExperimentError
from pretouch_lab import run as lab_run
from pretouch_lab.run import ROWS, missing, open_run, plays_of, run, workers

CELLS = [{"name": "a", "factor": 2.0}, {"name": "b", "factor": 0.5}]


def played(cell, seed):
    return {"value": cell["factor"] * seed}


def killed(cell, seed):
    if cell["name"] == "b":
        os.kill(os.getpid(), signal.SIGKILL)
    return played(cell, seed)


def test_rows_are_of_all_plays_in_their_order_and_lines_of_a_file(tmp_path):
    rows = run(played, plays_of(CELLS, (3, 4)), tmp_path)
    assert [tuple(row.values())[-2:] for row in rows] == [(3, 6.0), (3, 1.5), (4, 8.0), (4, 2.0)]
    assert [row["name"] for row in rows] == ["a", "b", "a", "b"]
    assert [json.loads(line) for line in (tmp_path / ROWS).read_text().splitlines()] == rows


@pytest.mark.parametrize("torn", [0, 5])
def test_a_later_run_plays_what_is_missing_and_a_torn_last_line(tmp_path, torn):
    plays, seeds = plays_of(CELLS, (3, 4)), []

    def counted(cell, seed):
        seeds.append(seed)
        return played(cell, seed)

    first = run(counted, plays[:3], tmp_path)
    file = tmp_path / ROWS
    if torn:
        file.write_bytes(file.read_bytes()[:-torn])
    assert missing(plays, tmp_path) == (2 if torn else 1)
    assert run(counted, plays, tmp_path)[:3] == first
    assert seeds == ([3, 3, 4, 4, 4] if torn else [3, 3, 4, 4])


@pytest.mark.parametrize("line", ["[]", "{", '{"name": "a"}', "[" * 100_000, "\udcff"])
def test_a_damaged_line_is_named_and_left_as_it_is(tmp_path, line):
    content = line.encode(errors="surrogateescape") + b"\n"
    (tmp_path / ROWS).write_bytes(content)
    with pytest.raises(ExperimentError, match=r"Line 1 of .*rows\.jsonl is damaged .*: take the line out"):
        run(played, plays_of(CELLS, (3,)), tmp_path)
    assert (tmp_path / ROWS).read_bytes() == content


@pytest.mark.parametrize(
    ("measured", "match"), [({"value": {1}}, "'b'.*seed 3 cannot be JSON"), ({"name": 1}, "returns 'name'")]
)
def test_what_cannot_be_a_row_is_not_kept_and_those_before_are(tmp_path, measured, match):
    def fails(cell, seed):
        return {"value": float("inf")} if cell["name"] == "a" else measured

    with pytest.raises(ExperimentError, match=match):
        run(fails, plays_of(CELLS, (3,)), tmp_path)
    assert [json.loads(line)["value"] for line in (tmp_path / ROWS).read_text().splitlines()] == [None]


def test_a_second_run_in_the_same_folder_is_refused_and_one_that_cannot_be_written_is_named(tmp_path):
    def again(cell, seed):
        with pytest.raises(ExperimentError, match="Another run writes to"):
            run(played, [(cell, seed)], tmp_path)
        return {}

    assert len(run(again, [(CELLS[0], 1)] * 2, tmp_path)) == 2, "the same play is played once"
    with pytest.raises(FileNotFoundError):
        run(lambda *_: {"text": (tmp_path / "missing").read_text()}, [(CELLS[1], 1)], tmp_path)
    with pytest.raises(ExperimentError, match=r"Rows could not be kept in .*Not a directory"):
        run(played, [(CELLS[0], 1)], tmp_path / ROWS / "below")


def test_a_folder_of_other_arguments_is_refused_and_says_which_differ(tmp_path, monkeypatch):
    open_run(tmp_path, {"seeds": 3, "skin": None})
    open_run(tmp_path, {"seeds": 3, "skin": None})
    before = (tmp_path / "run.json").read_text()
    assert len(json.loads(before)["commit"]) == 40
    with pytest.raises(ExperimentError, match="holds a run with seeds = 3, not 4; arm = None, not 'fr3': give another"):
        open_run(tmp_path, {"seeds": 4, "skin": None, "arm": "fr3"})
    monkeypatch.setattr(lab_run, "commit", lambda: "0" * 40)
    with pytest.raises(ExperimentError, match="holds a run with commit = "):
        open_run(tmp_path, {"seeds": 3, "skin": None})
    assert (tmp_path / "run.json").read_text() == before
    (tmp_path / "run.json").write_text("[1]")
    with pytest.raises(ExperimentError, match=r"run\.json is damaged"):
        open_run(tmp_path, {})
    with pytest.raises(ExperimentError, match=r"Rows could not be kept in .*Not a directory"):
        open_run(tmp_path / "run.json" / "below", {})


def test_worker_processes_play_and_a_killed_one_is_named_with_what_it_played(tmp_path):
    plays, calls = plays_of(CELLS, range(3)), []
    with workers(2) as pool:
        rows = run(played, plays, tmp_path / "fine", *pool, done=partial(calls.append, 1))
    assert rows == run(played, plays, tmp_path / "here")
    assert len(calls) == len(plays)
    with (
        pytest.raises(ExperimentError, match=r"killed, .*while it played .*'b'.* with seed 7.*All finished"),
        workers(2) as pool,
    ):
        run(killed, [(CELLS[0], 6), (CELLS[1], 7)], tmp_path, *pool)
    assert missing([(CELLS[1], 7)], tmp_path) == 1
    with pytest.raises(ExperimentError, match="number of processes is 0"), workers(0):
        pass


SLEEPING = """
import sys, time
from pathlib import Path
from pretouch_lab.run import run, plays_of, workers

def slow(cell, seed):
    time.sleep(0.05)
    return {"value": seed}

if __name__ == "__main__":
    with workers(2) as pool:
        run(slow, plays_of([{"name": "a"}], range(10_000)), Path(sys.argv[1]), *pool)
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_a_stopped_run_keeps_its_rows_and_leaves_no_worker(tmp_path, number):
    script = tmp_path / "slow.py"
    script.write_text(SLEEPING)
    with subprocess.Popen([sys.executable, script, tmp_path], stderr=subprocess.PIPE, process_group=0) as process:
        rows = tmp_path / ROWS
        while not rows.exists() or rows.read_bytes().count(b"\n") < 3:
            assert process.poll() is None
            time.sleep(0.02)
        (os.killpg if number == signal.SIGINT else os.kill)(process.pid, number)
        text = process.communicate(timeout=60)[1].decode()
    assert ("KeyboardInterrupt" in text, "spawn_main" in text) == (number == signal.SIGINT, False)
    assert [json.loads(line)["name"] for line in rows.read_text().splitlines()[:3]] == ["a"] * 3
    with suppress(ProcessLookupError):
        for _ in range(400):
            os.killpg(process.pid, 0)
            time.sleep(0.05)
        pytest.fail("a worker is left")
