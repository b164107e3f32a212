import json
import os
import signal
import subprocess
import sys
from multiprocessing import active_children
from pathlib import Path

import pytest
from lab.tests.sweep.made import ISHIGAMI, files, ignore, opened_ishigami, value
from pyarrow import parquet

from pretouch.errors import ExperimentError
from pretouch_lab import engine
from pretouch_lab.sweep import work
from pretouch_lab.sweep.definition import Asked, sweep_of
from pretouch_lab.sweep.document import picture, tables, written
from pretouch_lab.sweep.results import values_of
from pretouch_lab.sweep.run import Where, opened, play
from pretouch_lab.sweep.store import Store

HERE = Where(processes=1)
ROOT = Path(__file__).parents[3]


def known(cell):
    return value(*(cell.values[f"scene.x{i}"] for i in (1, 2, 3)))


def test_a_sweep_leaves_a_file_for_each_cell_a_table_indices_and_a_figure(tmp_path):
    run = opened_ishigami(tmp_path)
    assert len(run.wanted) == len(run.cells) == 8 * 5
    play(run, HERE, ignore)
    assert len(files(run)) == 40
    assert [run.results[cell.key].metrics["value"] for cell in run.cells] == [known(cell) for cell in run.cells]
    about = written(run)
    table = parquet.read_table(run.folder / "results.parquet")
    assert table.column_names == [
        "scene.x1", "scene.x2", "scene.x3", "seed", "value", "seconds", "status", "reason",
    ]  # fmt: skip
    rows = table.to_pylist()
    assert [row["value"] for row in rows] == [known(cell) for cell in run.cells]
    assert {row["status"] for row in rows} == {"ok"}
    assert json.loads(table.schema.metadata[b"pretouch"])["sweep"]["experiment"] == "ishigami"
    assert json.loads((run.folder / "indices.json").read_text())["metrics"] == about["metrics"]
    assert len(tables(run, about)[0].rows) == 3
    assert len(picture(run, about).figure.axes) == 1


def test_a_sweep_that_is_done_is_not_played_again_and_more_samples_play_the_new_ones_only(tmp_path):
    run = opened_ishigami(tmp_path)
    for cell, result in Store(run.folder / "cells", ISHIGAMI).answered(run.jobs[0], work.work(run.jobs[0].written())):
        Store(run.folder / "cells", ISHIGAMI).keep(cell, result)
    assert len(opened_ishigami(tmp_path).wanted) == 39
    assert len(opened_ishigami(tmp_path, samples=16).wanted) == 79


DAMAGED = {
    "{": "Expecting property name",
    "[]": "holds no object",
    '{"values": {}}': "is of another cell",
    '{"values": VALUES, "seed": 1000, "seconds": 1}': "neither numbers nor a reason",
    '{"values": VALUES, "seed": 1000, "seconds": 1, "metrics": {"value": "3"}}': "something else than numbers",
    '{"values": VALUES, "seed": 1000, "seconds": 1, "metrics": {}}': "not hold the numbers of ishigami",
    '{"values": VALUES, "seed": 1000, "metrics": {"value": 3}}': "says not how long",
}


def test_damaged_files_are_told_and_their_cells_played_again(tmp_path):
    run = opened_ishigami(tmp_path, samples=2)
    store, damaged = Store(run.folder / "cells", ISHIGAMI), run.cells[: len(DAMAGED)]
    for job in run.jobs:
        for cell, result in store.answered(job, work.work(job.written())):
            store.keep(cell, result)
    for cell, text in zip(damaged, DAMAGED, strict=True):
        store.file(cell.key).write_text(text.replace("VALUES", json.dumps(cell.values)))
    again = opened_ishigami(tmp_path, samples=2)
    for cell, words in zip(damaged, DAMAGED.values(), strict=True):
        assert any(cell.key in note and words in note and "played again" in note for note in again.notes), words
    assert {one.key for one in again.wanted} == {cell.key for cell in damaged}
    play(again, HERE, ignore)
    for cell in damaged:
        assert json.loads(store.file(cell.key).read_text())["metrics"] == {"value": known(cell)}


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        (b"[]", "no text"),
        ("nonsense", "cannot be read: Expecting value"),
        ("[" * 100_000, "cannot be read"),
        ("{}", "no list of results"),
        ("[]", "did not tell of it"),
        ('[{"key": "KEY", "seconds": 0, "metrics": {"value": NaN}}]', "something else than numbers"),
        ('[{"key": "KEY", "seconds": 0, "metrics": {"value": 1, "../x": 2}}]', "not hold the numbers"),
        ('[{"key": "KEY", "seconds": -1, "metrics": {"value": 1}}]', "not how long"),
        ('[{"key": "KEY", "seconds": true, "metrics": {"value": 1}}]', "not how long"),
        ('[{"key": "KEY", "seconds": 0, "reason": 7}]', "neither numbers nor a reason"),
    ],
)
def test_an_answer_is_data_that_is_checked_before_it_is_written(tmp_path, answer, words):
    run = opened_ishigami(tmp_path, samples=2)
    job = run.jobs[0]
    if isinstance(answer, str):
        answer = answer.replace("KEY", job.cells[0].key)
    ((_, result),) = Store(tmp_path, ISHIGAMI).answered(job, answer)
    assert result.metrics is None
    assert words in result.reason
    assert not list(tmp_path.glob("**/x*"))


def test_a_cell_that_fails_is_written_down_stops_no_other_and_is_tried_again(tmp_path):
    run = opened_ishigami(tmp_path, samples=2)
    store, bad = Store(run.folder / "cells", ISHIGAMI), run.jobs[0]
    asked = json.loads(bad.written())
    asked["cells"][0]["values"]["scene.x1"] = 44.0
    ((cell, result),) = store.answered(bad, work.work(json.dumps(asked)))
    assert result.metrics is None
    assert "must be at most 3.2" in result.reason
    store.keep(cell, result)
    again = opened_ishigami(tmp_path, samples=2)
    assert "1 cells of ishigami failed before and are tried again." in again.notes
    about = written(again)
    rows = parquet.read_table(again.folder / "results.parquet").to_pylist()
    assert rows[0]["status"] == "failed"
    assert "must be at most 3.2" in rows[0]["reason"]
    assert {row["status"] for row in rows[1:]} == {"missing"}
    assert about["metrics"]["value"]["blocks"] == 0
    play(again, HERE, ignore)
    assert again.failed == []


def test_a_worker_of_another_version_is_refused(tmp_path):
    run = opened_ishigami(tmp_path, samples=2)
    text = run.jobs[0].written().replace(work.code("ishigami"), "0" * 12)
    ((_, result),) = Store(tmp_path, ISHIGAMI).answered(run.jobs[0], work.work(text))
    assert "another version of pretouch" in result.reason


def test_results_that_cannot_be_written_are_an_error_and_what_was_is_kept(tmp_path):
    (tmp_path / "ishigami").write_text("a file in the place of the folder")
    with pytest.raises(ExperimentError, match=r"could not be written to .*the same command with the same --out"):
        opened_ishigami(tmp_path)


def _kill_one_worker():
    os.kill(active_children()[0].pid, signal.SIGKILL)


@pytest.mark.slow
def test_a_cell_whose_worker_is_killed_is_played_again(tmp_path):
    run = opened_ishigami(tmp_path, samples=2)
    kills = iter([_kill_one_worker, _kill_one_worker])
    play(run, HERE, lambda _: next(kills, lambda: None)())
    assert run.failed == []
    assert [run.results[cell.key].metrics["value"] for cell in run.cells] == [known(cell) for cell in run.cells]


@pytest.mark.slow
def test_a_cell_whose_worker_is_killed_each_time_is_given_up_alone(tmp_path, monkeypatch):
    monkeypatch.setattr(engine, "TRIES", 1)
    run = opened_ishigami(tmp_path, samples=2)
    kills = iter([_kill_one_worker])
    play(run, HERE, lambda _: next(kills, lambda: None)())
    ((_, result),) = run.failed
    assert "was killed 1 times, for want of memory perhaps" in result.reason
    assert sum(r.metrics is not None for r in run.results.values()) == len(run.cells) - 1
    assert len(opened_ishigami(tmp_path, samples=2).wanted) == 1


PARENT = """
import sys
from pathlib import Path
import pytest
from pretouch_lab.sweep.definition import Asked, sweep_of
from pretouch_lab.sweep.run import Where, opened, play
from lab.tests.sweep.made import register
register(pytest.MonkeyPatch())
sweep = sweep_of(Asked("ishigami", {"scene.x1": "0:1", "scene.x2": "0:1"}, samples=64, arms=1))
play(opened(sweep, Path(sys.argv[1])), Where(1), lambda _: print("done", flush=True))
"""


@pytest.mark.slow
def test_a_sweep_whose_process_is_killed_goes_on_where_it_was(tmp_path):
    command = [sys.executable, "-c", PARENT, str(tmp_path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=ROOT) as process:
        for _ in range(5):
            assert process.stdout.readline() == "done\n"
        process.kill()
    sweep = sweep_of(Asked("ishigami", {"scene.x1": "0:1", "scene.x2": "0:1"}, samples=64, arms=1))
    run = opened(sweep, tmp_path)
    assert run.notes == []  # each file is whole
    assert 5 <= len(files(run)) < 256
    assert len(run.wanted) == 256 - len(files(run))
    play(run, Where(2), ignore)
    assert len(values_of(run, "value")) == 256
    assert run.wanted == []
