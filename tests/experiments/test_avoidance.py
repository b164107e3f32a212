import numpy as np
import pytest

from pretouch.experiments import avoidance
from pretouch.experiments.cell import Cell
from tests.experiments.limits import assert_within_limits


@pytest.fixture(scope="module")
def trial(context):
    return avoidance.trial(Cell(avoidance.NAME, "paper", {}), 400, context)


def test_the_arm_slows_for_the_hand_and_recovers(trial):
    row, record = trial
    assert row["least_speed_scale"] < 0.6
    assert record.steps[-1].speed_scale == 1.0
    assert np.linalg.norm(record.steps[-1].ee_position - record.steps[-1].path_position) < 0.02


def test_no_command_exceeds_a_limit(trial, panda_model):
    assert_within_limits(trial[1], panda_model)


def test_a_hand_comes_once_on_each_side():
    first, second = avoidance.visits(0)
    assert first.place[1] < 0 < second.place[1]
    assert first.leave < second.arrive
