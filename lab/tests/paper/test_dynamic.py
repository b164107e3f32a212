import numpy as np
import pytest
from tests.limits import assert_within_limits

from pretouch.sim.paper_scenes import dynamic_pushes
from pretouch_lab.cell import Cell
from pretouch_lab.paper import dynamic

PAPER = Cell(dynamic.NAME, "paper", {"restrictions": "slack"})
CONTACT = {"detected", "delay_s", "direction_error_deg", "push_n", "push_s", "reaction_towards_person"}


@pytest.fixture(scope="module")
def trial(context):
    return dynamic.trial(PAPER, 300, context)


def test_three_pushes_are_felt_and_answered_the_way_they_went(trial):
    row, _ = trial
    assert row["contact"] is True
    assert row["detection_delay_s"] == pytest.approx(np.median([c["delay_s"] for c in row["contacts"]]), abs=2e-4)
    assert 5 < row["filtered_at_detection_n"] < row["raw_at_detection_n"] < row["peak_estimate_n"] + 5
    assert len(row["contacts"]) == 3
    for contact in row["contacts"]:
        assert set(contact) == CONTACT
        assert contact["detected"]
        assert contact["direction_error_deg"] < 30
        assert 0 < contact["delay_s"] < contact["push_s"] + 0.3
    assert row["false_detections"] == 0


def test_the_arm_goes_on_along_its_path_afterwards(trial):
    _, record = trial
    last = record.reactions()[-1]
    before = last.path_phase
    assert record.steps[-1].path_phase > before + 0.3


def test_no_command_exceeds_a_limit(trial, panda_model):
    assert_within_limits(trial[1], panda_model)


def test_pushes_are_as_long_and_as_strong_as_said():
    for seed in range(20):
        pushes = dynamic_pushes(seed)
        assert [p.start for p in pushes] >= [4.0, 13.0, 22.0]
        for push in pushes:
            assert 15.0 <= push.force <= 30.0
            assert 0.2 <= push.duration <= 0.5
            assert np.linalg.norm(push.inwards) == pytest.approx(1.0)


def test_the_three_pushes_come_from_different_faces():
    faces = {tuple(np.abs(p.inwards).argmax() * np.sign(p.inwards[np.abs(p.inwards).argmax()]) for p in [q])
             for q in dynamic_pushes(7)}  # fmt: skip
    assert len(faces) == 3


@pytest.mark.slow
def test_each_of_thirty_pushes_is_felt(context, panda_model):
    contacts = []
    for seed in range(310, 320):
        row, record = dynamic.trial(PAPER, seed, context)
        assert_within_limits(record, panda_model)
        contacts += row["contacts"]
    assert len(contacts) == 30
    assert all(contact["detected"] for contact in contacts)
    assert np.median([contact["direction_error_deg"] for contact in contacts]) < 15
