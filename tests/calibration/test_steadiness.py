"""A unit that slips is recognised, one that stays is not accused."""

import re

import numpy as np
import pytest

from pretouch.calibration.calibrate import calibrate
from pretouch.calibration.result import UnitCalibration
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch_lab.studies.calibration.random_skin import random_skin
from tests.calibration.faulty import slipped
from tests.calibration.made import MovingArm, turned

DURATION = 45.0


def slip_of(unit: UnitCalibration) -> str | None:
    return next((finding.sentence for finding in unit.findings if finding.kind == "slipped"), None)


def after_a_slip(model: RobotModel, arm: MovingArm, seed: int, angle: float, shift: float):
    """Calibrate a random skin all of whose units slip, at an instant in the middle 60 %; returns it and the instant."""
    rng = np.random.default_rng(seed)
    at = DURATION * rng.uniform(0.2, 0.8)
    direction = rng.normal(size=3)
    direction /= np.linalg.norm(direction)
    skin = random_skin(model, seed)
    moved = [turned(unit, angle * direction, shift * direction) for unit in skin.units]
    data, other = arm.data(skin, seed), arm.data(_Anywhere(moved), seed)
    for unit in skin.units:
        data = slipped(data, other, unit.id, at)
    return calibrate(model, data), at


class _Anywhere(Skin):
    """Units that may also have slipped into their link."""

    def __init__(self, units):
        self.units = tuple(units)


@pytest.mark.parametrize(
    ("angle", "shift"),
    [
        (0.0, 0.005),
        pytest.param(np.deg2rad(2.0), 0.0, marks=pytest.mark.slow),
        pytest.param(0.5, 0.02, marks=pytest.mark.slow),
    ],
)
def test_a_slip_is_recognised_with_its_instant_and_size(panda_model, moving_arm, angle, shift):
    check_slips(panda_model, moving_arm, [1], angle, shift)


def test_units_that_stay_are_not_accused(panda_model, moving_arm):
    found = calibrate(panda_model, moving_arm.data(random_skin(panda_model, 1), 1))
    assert [slip_of(unit) for unit in found.units] == [None] * 7


@pytest.mark.slow
@pytest.mark.parametrize(("angle", "shift"), [(0.0, 0.005), (np.deg2rad(2.0), 0.0), (0.5, 0.02)])
def test_many_slips_are_recognised(panda_model, moving_arm, angle, shift):
    check_slips(panda_model, moving_arm, range(10, 14), angle, shift)


@pytest.mark.slow
def test_many_units_that_stay_are_not_accused(panda_model, moving_arm):
    for seed in range(10, 18):
        found = calibrate(panda_model, moving_arm.data(random_skin(panda_model, seed), seed))
        assert [unit.findings for unit in found.units] == [()] * 7


def check_slips(model, arm, seeds, angle, shift):
    for seed in seeds:
        found, at = after_a_slip(model, arm, seed, angle, shift)
        for unit in found.units:
            sentence = slip_of(unit)
            assert sentence is not None, (seed, unit.id)
            assert not unit.accepted
            distance, turn, earliest, latest = (float(number) for number in re.findall(r"\d+\.\d", sentence)[:4])
            assert distance == pytest.approx(1000 * shift, abs=2.5)
            assert turn == pytest.approx(np.rad2deg(angle), abs=0.5)
            assert earliest - 0.1 <= at <= latest + 0.1
            assert latest - earliest < 6.0
