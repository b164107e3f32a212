import json
from functools import partial

import numpy as np
import pytest

from pretouch.atomic_write import write_json
from pretouch.errors import ExperimentError
from pretouch.text_table import TextTable, markdown
from pretouch_lab.benchmarks.documents import begin_mark, end_mark, put
from pretouch_lab.benchmarks.store import Task, missing, open_bench, read_rows, run_tasks, write_arrays


def squared(number, file):
    write_json({"number": number, "square": number**2}, file)


def tasks_in(folder):
    return [Task(folder / "rows" / f"{n}.json", partial(squared, n), n) for n in range(3)]


def test_after_a_kill_only_what_is_missing_is_done_again(tmp_path):
    tasks, costs = tasks_in(tmp_path), []
    run_tasks(tasks, tmp_path, costs.append, processes=1)
    assert costs == [2, 1, 0]
    assert [row["square"] for row in read_rows(tasks)] == [0, 1, 4]
    tasks[1].file.unlink()
    kept = {task.file: task.file.stat().st_mtime_ns for task in (tasks[0], tasks[2])}
    assert missing(tasks) == [tasks[1]]
    run_tasks(tasks, tmp_path, costs.append, processes=1)
    assert costs[3:] == [1]
    assert kept == {file: file.stat().st_mtime_ns for file in kept}


def test_arrays_are_written_whole_or_not_at_all(tmp_path):
    file = tmp_path / "stream.npz"
    write_arrays({"robot.q": np.eye(2), "stamp": np.arange(3.0)}, file)
    assert [path.name for path in tmp_path.iterdir()] == ["stream.npz"]
    with np.load(file) as kept:
        np.testing.assert_array_equal(kept["robot.q"], np.eye(2))


def test_a_folder_of_another_run_is_refused(tmp_path):
    open_bench(tmp_path, "detection", {"seeds": "published"})
    open_bench(tmp_path, "detection", {"seeds": "published"})
    with pytest.raises(ExperimentError, match="holds a run with another seeds: give another --out"):
        open_bench(tmp_path, "detection", {"seeds": "development"})
    about = tmp_path / "run.json"
    about.write_text(json.dumps({**json.loads(about.read_text()), "scenarios": {}}))
    with pytest.raises(ExperimentError, match="another scenarios"):
        open_bench(tmp_path, "detection", {"seeds": "published"})


def test_a_damaged_row_is_named(tmp_path):
    task = tasks_in(tmp_path)[0]
    task.file.parent.mkdir()
    task.file.write_text("{")
    with pytest.raises(ExperimentError, match=r"0\.json is damaged .* delete it and run again"):
        read_rows([task])


def test_only_what_is_between_the_markers_of_a_document_is_replaced(tmp_path):
    document = tmp_path / "benchmarks.md"
    document.write_text(f"Before.\n\n{begin_mark('tables')}\nold\n{end_mark('tables')}\n\nAfter.\n")
    put(document, "tables", markdown(TextTable("Title", ("a", "b"), (("1", "2\n3"),), "Note.")))
    text = document.read_text()
    assert text.startswith("Before.")
    assert text.endswith("After.\n")
    assert "old" not in text
    assert "| 1 | 2<br>3 |" in text
    with pytest.raises(ExperimentError, match="has no place for figures"):
        put(document, "figures", "")
