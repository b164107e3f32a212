from dataclasses import replace

import numpy as np
import pytest
from lab.tests.experiments.test_static import cell

from pretouch.recording.reader import open_recording
from pretouch.recording.run_record import columns_of
from pretouch.reporting.record import gather
from pretouch_lab.experiments import static
from pretouch_lab.trial import trace_of


@pytest.mark.slow
def test_a_recorded_trial_is_as_without_and_its_trace_has_the_course_and_each_steps_mean_true_force(context, tmp_path):
    place = tmp_path / "x.mcap"
    row, record = static.trial(cell("paper", side="+y"), 101, replace(context, recording=place))
    assert static.trial(cell("paper", side="+y"), 101, context)[0] == row
    trace, again = trace_of(record), gather(open_recording(place))
    assert again.units == context.skin.ids
    for name in columns_of(record.steps):
        np.testing.assert_array_equal(getattr(again, name), getattr(trace, name))
    np.testing.assert_array_equal(again.true_force, trace.true_force)
    np.testing.assert_array_equal(again.detected, trace.detected)
    assert [(time, link, velocity.tolist()) for time, link, velocity in again.truth.touches] == [
        (touch.time, context.model.links[touch.link], touch.velocity.tolist()) for touch in record.touches
    ]
    i = int(np.abs(trace.true_force[:, 1]).argmax())
    since = (record.true_time > trace.time[i - 1] + 1e-9) & (record.true_time <= trace.time[i] + 1e-9)
    assert since.sum() == 10
    np.testing.assert_allclose(trace.true_force[i], record.true_force[since].mean(axis=0))
