import numpy as np
import pytest
from tests.limits import assert_within_limits

from pretouch.sim.paper_scenes import dynamic_pushes
from pretouch_lab.experiments import dynamic

PAPER = {"profile": "paper", "restrictions": "slack"}


def test_angles_by_numbers_and_none_to_nothing():
    angles = {(2, 0, 0): 0, (0, 5, 0): 90, (-1, 0, 0): 180, (1, 1, 0): 45, (0, 0, 0): None}
    for b, angle in angles.items():
        assert dynamic.angle_deg(np.array([1.0, 0.0, 0.0]), np.array(b, float)) == pytest.approx(angle)


def test_three_pushes_are_felt_and_answered_the_way_they_went_and_the_arm_goes_on_along_its_path(context, panda_model):
    row, record = dynamic.trial(PAPER, 300, context)
    assert_within_limits(record, panda_model)
    assert row["contact"] is True
    assert row["detection_delay_s"] == pytest.approx(np.median([c["delay_s"] for c in row["contacts"]]), abs=2e-4)
    assert 5 < row["filtered_at_detection_n"] < row["raw_at_detection_n"] < row["peak_estimate_n"] + 5
    assert len(row["contacts"]) == 3
    for contact in row["contacts"]:
        assert contact["detected"]
        assert contact["direction_error_deg"] < 30
        assert contact["reaction_towards_person"] is False
        assert 0 < contact["delay_s"] < contact["push_s"] + 0.3
    assert row["false_detections"] == 0
    assert record.steps[-1].path_phase > record.reactions()[-1].path_phase + 0.3


def test_three_pushes_are_as_long_and_as_strong_as_said_and_on_different_faces():
    for seed in range(20):
        pushes = dynamic_pushes(seed)
        assert [p.start for p in pushes] >= [4.0, 13.0, 22.0]
        for push in pushes:
            assert 15.0 <= push.force <= 30.0
            assert 0.2 <= push.duration <= 0.5
            assert np.linalg.norm(push.inwards) == pytest.approx(1.0)
    inwards = [push.inwards for push in dynamic_pushes(7)]
    faces = [int(np.abs(way).argmax()) for way in inwards]
    assert len({(face, np.sign(way[face])) for face, way in zip(faces, inwards, strict=True)}) == 3
