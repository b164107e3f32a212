import re
from dataclasses import replace

import numpy as np
import pytest
from lab.tests.paper.test_figures import UNITS, made_trace
from lab.tests.paper.test_static import cell
from lab.tests.test_summary import contact, dynamic_row, static_row
from PIL import Image

from pretouch.errors import ExperimentError, RecordingError
from pretouch.recording.reader import open_recording
from pretouch.recording.run_record import columns_of
from pretouch_lab import report
from pretouch_lab.campaign import Request
from pretouch_lab.paper import static
from pretouch_lab.registry import summarise
from pretouch_lab.report import write_report
from pretouch_lab.trial import read_trace, record_of, trace_of

ROWS = [static_row("blind", 0, 80.0), static_row("paper", 0, 20.0), dynamic_row([contact()])]


@pytest.mark.parametrize(("damaged", "drawn"), [("none", ["static.png", "dynamic.png"]), ("dynamic", ["static.png"])])
def test_tables_and_figures_are_in_one_file_but_those_of_recordings_that_cannot_be_read(
    tmp_path, monkeypatch, damaged, drawn
):
    def read(file):
        if file.name.startswith(damaged):
            raise RecordingError("It is damaged.")
        return made_trace(), UNITS

    monkeypatch.setattr(report, "read_trace", read)
    text = write_report([(Request(("static", "dynamic"), seeds=1), tmp_path)], summarise(ROWS), tmp_path).read_text()
    assert len(re.findall("^## ", text, flags=re.MULTILINE)) == 2
    assert re.findall(r"^!\[.+\]\((.+)\)$", text, flags=re.MULTILINE) == drawn
    for name in drawn:
        with Image.open(tmp_path / name) as picture:
            assert picture.width >= 1000
            assert np.asarray(picture.convert("L")).std() > 10


def test_a_run_without_trials_still_has_a_file_and_one_that_cannot_be_written_is_named(tmp_path):
    request = Request(("static",), seeds=1)
    assert write_report([(request, tmp_path)], {}, tmp_path).read_text() == ""
    with pytest.raises(ExperimentError, match="tables cannot be written"):
        write_report([(request, tmp_path)], {}, tmp_path / "none")


@pytest.mark.slow
def test_a_recorded_trial_is_as_without_and_its_trace_has_the_course_and_each_steps_mean_true_force(context, tmp_path):
    place = tmp_path / "x.mcap"
    row, record = static.trial(cell("paper", side="+y"), 101, replace(context, recording=place))
    assert static.trial(cell("paper", side="+y"), 101, context)[0] == row
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
