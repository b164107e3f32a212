"""Steps that are not of the arm and skin that a recording is of."""

from dataclasses import replace

import numpy as np
import pytest

from pretouch.errors import RecordingError
from pretouch.recording.reader import open_recording
from tests.recording.runs import controller_of, recorded_run, steps_changed


@pytest.fixture(scope="module")
def whole(panda_model, paper_skin, tmp_path_factory):
    file = tmp_path_factory.mktemp("whole") / "whole.mcap"
    recorded_run(file, controller_of(panda_model, paper_skin), 8)
    return file


@pytest.mark.parametrize(
    "change",
    [
        lambda step: replace(step, q=step.q[:6]),
        lambda step: replace(step, qp=replace(step.qp, qd=np.zeros(8))),
        lambda step: replace(step, range_distance=step.range_distance[:2]),
        lambda step: replace(step, obstacles=replace(step.obstacles, ee_distance=np.zeros(9))),
        lambda step: replace(step, touched=replace(step.touched, point=np.zeros((2, 3)))),
        lambda step: replace(step, approach_limit=np.zeros(5)),
    ],
)
def test_a_step_that_is_not_of_the_recordings_arm_is_named(whole, tmp_path, change):
    place = tmp_path / "other.mcap"
    recorded = open_recording(steps_changed(whole, place, {3: change}))
    assert [recorded[i].step.stamp for i in range(3)] == recorded.stamps()[:3].tolist()
    with pytest.raises(RecordingError, match=r"Step 3 of .*other\.mcap is not of the arm and skin"):
        _ = recorded[3]
