import json
import re
from dataclasses import replace
from shutil import copytree

import numpy as np
import pytest
from PIL import Image

from pretouch.atomic_write import write_json
from pretouch.errors import ExperimentError
from pretouch.recording.reader import open_recording
from pretouch.recording.run_record import columns_of
from pretouch_lab.campaign import Request, recording_file, trial_file
from pretouch_lab.cell import Cell, Grid
from pretouch_lab.paper import dynamic, static
from pretouch_lab.registry import summarise
from pretouch_lab.report import write_report
from pretouch_lab.trial import read_trace, record_of, trace_of

pytestmark = pytest.mark.slow

LINE = ("line", "-y")


@pytest.fixture(scope="module")
def request_and_folder(context, tmp_path_factory):
    request, out = Request(("static", "dynamic"), seeds=1), tmp_path_factory.mktemp("run")
    request.open(out)
    for task in request.tasks(out):
        task.file.parent.mkdir(exist_ok=True)
    cells = [c for c in static.cells(Grid(("blind", "paper"))) if (c.where["trajectory"], c.where["side"]) == LINE]
    for cell in [*cells, Cell(dynamic.NAME, "paper", {"restrictions": "slack"})]:
        recorded = replace(context, recording=recording_file(out, cell, 0))
        row, _ = (static if cell.experiment == "static" else dynamic).trial(cell, 0, recorded)
        write_json(row, trial_file(out, cell, 0))
    return request, out


def rows_in(out):
    return [json.loads(file.read_text()) for file in sorted((out / "trials").glob("*.json"))]


def test_tables_and_figures_are_in_one_file(request_and_folder):
    request, out = request_and_folder
    text = write_report([(request, out)], summarise(rows_in(out)), out).read_text()
    assert len(re.findall("^## ", text, flags=re.MULTILINE)) == 2
    figures = re.findall(r"^!\[.+\]\((.+)\)$", text, flags=re.MULTILINE)
    assert figures == ["static.png", "dynamic.png"]
    for name in figures:
        with Image.open(out / name) as picture:
            assert picture.width >= 1000
            assert np.asarray(picture.convert("L")).std() > 10


def test_a_run_without_trials_still_has_a_file_and_one_that_cannot_be_written_is_named(tmp_path):
    request = Request(("static",), seeds=1)
    assert write_report([(request, tmp_path)], {}, tmp_path).read_text() == ""
    with pytest.raises(ExperimentError, match="tables cannot be written"):
        write_report([(request, tmp_path)], {}, tmp_path / "none")


def test_a_recording_that_cannot_be_read_leaves_its_picture_out(request_and_folder, tmp_path):
    request, whole = request_and_folder
    out = copytree(whole, tmp_path / "out")
    (file,) = (out / "recordings").glob("dynamic*.mcap")
    file.write_bytes(file.read_bytes()[:100])
    text = write_report([(request, out)], summarise(rows_in(out)), out).read_text()
    assert re.findall(r"\]\((.+)\)$", text, flags=re.MULTILINE) == ["static.png"]


def test_a_recorded_trial_is_as_without_and_its_trace_has_the_course_and_each_steps_mean_true_force(context, tmp_path):
    where = {"trajectory": "line", "side": "+y", "stiffness_n_per_m": 25e3, "restrictions": "off"}
    cell, place = Cell(static.NAME, "paper", where), tmp_path / "x.mcap"
    row, record = static.trial(cell, 101, replace(context, recording=place))
    assert static.trial(cell, 101, context)[0] == row
    trace, again = trace_of(record), read_trace(place)
    assert again[1] == context.skin.ids
    for name in columns_of(record.steps):
        np.testing.assert_array_equal(getattr(again[0], name), getattr(trace, name))
    np.testing.assert_array_equal(again[0].true_force, trace.true_force)
    np.testing.assert_array_equal(again[0].detected, trace.detected)
    kept = record_of(open_recording(place))
    assert [(t.time, t.link, t.velocity.tolist()) for t in kept.touches] == [
        (t.time, t.link, t.velocity.tolist()) for t in record.touches
    ]
    np.testing.assert_array_equal(kept.hand_position, record.hand_position)
    i = int(np.abs(trace.true_force[:, 1]).argmax())
    since = (record.true_time > trace.time[i - 1] + 1e-9) & (record.true_time <= trace.time[i] + 1e-9)
    assert since.sum() == 10
    np.testing.assert_allclose(trace.true_force[i], record.true_force[since].mean(axis=0))
