import json

import numpy as np
from lab.tests.sweep.made import ISHIGAMI, ishigami, opened_ishigami, play

from pretouch_lab.engine import missing
from pretouch_lab.sweep.figure import sweep_figure
from pretouch_lab.sweep.indices import indices, tables
from pretouch_lab.sweep.play import opened, play_cells


def test_a_grid_has_a_table_for_each_parameter_and_a_figure(tmp_path):
    run = opened(ishigami(design="grid", arms=2), tmp_path)
    play(run, tmp_path)
    found = indices(run)
    shown = tables(run.sweep, found, ("value",))
    assert [(table.header[0], len(table.rows)) for table in shown] == [(f"scene.x{i}", 5) for i in (1, 2, 3)]
    assert len(sweep_figure(run.sweep, found, ("value",)).axes) == 3


def test_cells_of_this_version_are_not_played_again_and_more_samples_play_the_new_ones_only(tmp_path, monkeypatch):
    play(opened_ishigami(tmp_path), tmp_path)
    assert missing(opened_ishigami(tmp_path).tasks) == []
    assert len(missing(opened_ishigami(tmp_path, samples=16).tasks)) == 40
    monkeypatch.setattr("pretouch_lab.sweep.play.__version__", "9.9")
    assert len(missing(opened_ishigami(tmp_path).tasks)) == 40


def test_a_cell_that_fails_is_written_down_stops_no_other_and_is_tried_again(tmp_path):
    run = opened_ishigami(tmp_path, samples=2)
    play(run, tmp_path)
    row = json.loads(run.tasks[0].file.read_text())
    assert row["cells"] == [{"values": run.points[0].values, "seed": run.points[0].seed}]
    assert (row["experiment"], row["profile"]) == ("ishigami", "paper")
    bad = run.tasks[0]
    play_cells(ISHIGAMI.name, "paper", [({"scene.x1": 44.0}, 0)], bad.file)
    assert missing(run.tasks) == [bad]
    (reason,) = run.failures()
    assert "must be at most 3.2" in reason
    assert np.isnan(run.values()["value"]).tolist() == [True] + 9 * [False]
    assert indices(run)["value"]["points"] == 1
    play(run, tmp_path)
    assert run.failures() == []
