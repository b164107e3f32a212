from concurrent.futures.process import BrokenProcessPool
from dataclasses import replace
from functools import partial

import pytest

from pretouch.atomic_write import write_json
from pretouch.errors import ExperimentError
from pretouch_lab.engine import Task, missing, open_folder, rows_of, run_tasks


def squared(number, file):
    write_json({"number": number, "square": number**2}, file)


def tasks_in(folder):
    return [Task(folder / "rows" / f"{n}.json", partial(squared, n), n) for n in range(3)]


def test_after_a_kill_only_what_is_missing_is_done_again(tmp_path):
    tasks, costs = tasks_in(tmp_path), []
    run_tasks(tasks, tmp_path, costs.append, processes=1)
    assert costs == [2, 1, 0]
    assert [row["square"] for row in rows_of(tasks)] == [0, 1, 4]
    tasks[1].file.unlink()
    kept = {task.file: task.file.stat().st_mtime_ns for task in (tasks[0], tasks[2])}
    assert missing(tasks) == [tasks[1]]
    run_tasks(tasks, tmp_path, costs.append, processes=1)
    assert costs[3:] == [1]
    assert kept == {file: file.stat().st_mtime_ns for file in kept}


@pytest.mark.parametrize("content", [b"{", b"[]", b"\xff", b"[" * 100_000, b"9" * 5000, b""])
def test_a_damaged_row_is_made_again_and_a_damaged_folder_is_named(tmp_path, content):
    task = tasks_in(tmp_path)[1]
    task.file.parent.mkdir()
    task.file.write_bytes(content)
    assert missing([task]) == [task]
    run_tasks([task], tmp_path, lambda _: None, processes=1)
    assert rows_of([task]) == [{"number": 1, "square": 1}]
    assert missing([replace(task, about={"number": 2})])
    (tmp_path / "run.json").write_bytes(content)
    with pytest.raises(ExperimentError, match=r"run\.json is damaged"):
        open_folder(tmp_path, {}, {})


def test_a_folder_of_another_run_is_refused_and_not_touched(tmp_path):
    open_folder(tmp_path, {"seeds": "published"}, {"the scenario files have": "a"})
    open_folder(tmp_path, {"seeds": "published"}, {"the scenario files have": "a"})
    before = (tmp_path / "run.json").read_text()
    with pytest.raises(ExperimentError, match="holds a run with seeds = 'published', not 'development': give another"):
        open_folder(tmp_path, {"seeds": "development"}, {"the scenario files have": "a"})
    with pytest.raises(ExperimentError, match="holds a run, but the scenario files have changed since"):
        open_folder(tmp_path, {"seeds": "published"}, {"the scenario files have": "b"})
    assert (tmp_path / "run.json").read_text() == before
    with pytest.raises(ExperimentError, match="cannot be used: Not a directory: give another --out"):
        open_folder(tmp_path / "run.json" / "below", {}, {})


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (BrokenProcessPool("it ended"), "A worker process was killed.*the same command with the same --out goes on"),
        (OSError(28, "No space left on device"), r"could not be written .*\(No space left on device\).* goes on"),
    ],
)
def test_what_ended_a_worker_is_said(tmp_path, error, words):
    def fail(_file):
        raise error

    with pytest.raises(ExperimentError, match=words):
        run_tasks([Task(tmp_path / "row.json", fail, 1.0)], tmp_path, lambda *_: None, processes=1)
