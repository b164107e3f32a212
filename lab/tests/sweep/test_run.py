import csv
import json

import numpy as np
from lab.tests.sweep.made import ISHIGAMI, ishigami, opened_ishigami, play, value

from pretouch_lab.engine import missing
from pretouch_lab.sweep.figure import sweep_figure
from pretouch_lab.sweep.indices import indices, tables
from pretouch_lab.sweep.play import opened, play_cells, write_table


def known(run):
    return [value(*point.values.values()) for point in run.points]


def test_a_sweep_leaves_a_file_for_each_cell_a_table_indices_and_a_figure(tmp_path):
    run = opened_ishigami(tmp_path)
    assert len(missing(run.tasks)) == 8 * 5
    play(run, tmp_path)
    assert len(list((tmp_path / "cells").glob("*.json"))) == 40
    assert run.values()["value"].tolist() == known(run)
    write_table(run, tmp_path / "table.csv")
    with open(tmp_path / "table.csv", newline="") as file:
        header, *rows = csv.reader(file)
    assert header == ["scene.x1", "scene.x2", "scene.x3", "seed", "value"]
    assert [float(row[-1]) for row in rows] == known(run)
    found = indices(run)
    (table,) = tables(run.sweep, found, ("value",))
    assert [row[0] for row in table.rows] == ["scene.x1", "scene.x2", "scene.x3"]
    assert "8 of 8 blocks have it" in table.note
    assert len(sweep_figure(run.sweep, found, ("value",)).axes) == 1


def test_a_grid_has_a_table_for_each_parameter_and_a_figure(tmp_path):
    run = opened(ishigami(design="grid", arms=2), tmp_path)
    play(run, tmp_path)
    found = indices(run)
    shown = tables(run.sweep, found, ("value",))
    assert [(table.header[0], len(table.rows)) for table in shown] == [(f"scene.x{i}", 5) for i in (1, 2, 3)]
    assert len(sweep_figure(run.sweep, found, ("value",)).axes) == 3


def test_a_sweep_that_is_done_is_not_played_again_and_more_samples_play_the_new_ones_only(tmp_path):
    run = opened_ishigami(tmp_path)
    play(run, tmp_path)
    assert missing(opened_ishigami(tmp_path).tasks) == []
    assert len(missing(opened_ishigami(tmp_path, samples=16).tasks)) == 40


def test_cells_of_another_version_are_not_taken(tmp_path, monkeypatch):
    play(opened_ishigami(tmp_path, samples=2), tmp_path)
    monkeypatch.setattr("pretouch_lab.sweep.play.__version__", "9.9")
    assert len(missing(opened_ishigami(tmp_path, samples=2).tasks)) == 10


def test_a_cell_that_fails_is_written_down_stops_no_other_and_is_tried_again(tmp_path):
    run = opened_ishigami(tmp_path, samples=2)
    play(run, tmp_path)
    bad = run.tasks[0]
    play_cells(ISHIGAMI.name, "paper", [({"scene.x1": 44.0}, 0)], bad.file)
    assert missing(run.tasks) == [bad]
    (reason,) = run.failures()
    assert "must be at most 3.2" in reason
    assert np.isnan(run.values()["value"]).tolist() == [True] + 9 * [False]
    assert indices(run)["value"]["points"] == 1
    play(run, tmp_path)
    assert run.failures() == []


def test_a_file_says_which_cells_it_is_of(tmp_path):
    run = opened_ishigami(tmp_path, samples=2)
    play(run, tmp_path)
    row = json.loads(run.tasks[0].file.read_text())
    assert row["cells"] == [{"values": run.points[0].values, "seed": run.points[0].seed}]
    assert (row["experiment"], row["profile"]) == ("ishigami", "paper")
