from dataclasses import replace

import numpy as np
import pytest
from lab.tests.studies.calibration.ideal import ideal_data
from lab.tests.studies.calibration.motions import short_plan
from scipy.spatial.transform import Rotation

from pretouch.calibration.data import CalibrationData
from pretouch.errors import ExperimentError
from pretouch.traces import ImuTrace
from pretouch_lab.studies.calibration.random_skin import random_skin
from pretouch_lab.studies.calibration.watanabe import pose, watanabe

pytestmark = pytest.mark.slow

PLAN = short_plan()


@pytest.fixture(scope="module")
def skin(panda_model):
    return random_skin(panda_model, 1)


@pytest.fixture(scope="module")
def ideal(panda_model, skin) -> CalibrationData:
    return ideal_data(panda_model, skin, PLAN, rate=100.0)


def errors(skin, poses) -> tuple[np.ndarray, np.ndarray]:
    """Errors of positions [m] and orientations [rad]."""
    true = skin.T_link_sensor
    turns = [Rotation.from_matrix(a[:3, :3].T @ b[:3, :3]).magnitude() for a, b in zip(true, poses, strict=True)]
    return np.linalg.norm(true[:, :3, 3] - np.array(poses)[:, :3, 3], axis=1), np.array(turns)


def biased(data: CalibrationData, bias: list[float]) -> CalibrationData:
    def worse(imu: ImuTrace) -> ImuTrace:
        return ImuTrace(imu.stamp, imu.acceleration + bias, imu.angular_velocity)

    return replace(data, units=tuple(replace(unit, imu=worse(unit.imu)) for unit in data.units))


def late(data: CalibrationData, seconds: float) -> CalibrationData:
    def delayed(imu: ImuTrace) -> ImuTrace:
        return ImuTrace(imu.stamp + seconds, imu.acceleration, imu.angular_velocity)

    return replace(data, units=tuple(replace(unit, imu=delayed(unit.imu)) for unit in data.units))


def test_of_perfect_sensors_it_finds_every_unit_to_a_tenth_of_a_millimetre(panda_model, skin, ideal):
    position, turn = errors(skin, watanabe(panda_model, ideal, PLAN.still))
    assert position.max() < 1e-4
    assert turn.max() < 1e-4


def test_a_bias_within_the_data_sheet_moves_units_by_centimetres(panda_model, skin, ideal):
    position, turn = errors(skin, watanabe(panda_model, biased(ideal, [0.2, -0.3, 0.2]), PLAN.still))
    assert np.median(position) > 5e-3
    assert np.median(turn) > np.deg2rad(0.5)


def test_it_takes_late_clocks_for_other_places(panda_model, skin, ideal):
    position, _ = errors(skin, watanabe(panda_model, late(ideal, 0.02), PLAN.still))
    assert np.median(position) > 1e-3


def test_it_answers_alike_every_time(panda_model, skin, ideal):
    one = replace(ideal, units=ideal.units[:1])
    first, second = (watanabe(panda_model, one, PLAN.still)[0] for _ in range(2))
    assert np.array_equal(first, second)


def test_six_parameters_are_two_joints_after_denavit_and_hartenberg():
    def about(axis: str, angle: float) -> np.ndarray:
        T = np.eye(4)
        T[:3, :3] = Rotation.from_euler(axis, angle).as_matrix()
        return T

    def along(axis: int, way: float) -> np.ndarray:
        T = np.eye(4)
        T[axis, 3] = way
        return T

    theta, d, theta_unit, d_unit, a, alpha = 0.4, 0.1, -0.7, 0.06, 0.03, 1.1
    virtual = about("z", theta) @ along(2, d) @ about("x", np.pi / 2)
    unit = about("z", theta_unit) @ along(2, d_unit) @ along(0, a) @ about("x", alpha)
    assert pose(np.array([theta, d, theta_unit, d_unit, a, alpha])) == pytest.approx(virtual @ unit)


def test_a_unit_on_an_unknown_link_is_refused(panda_model, ideal):
    unknown = replace(ideal, units=(replace(ideal.units[0], link=None),))
    with pytest.raises(ExperimentError, match="The link of unit on_panda_link2 is not known"):
        watanabe(panda_model, unknown, PLAN.still)


def test_a_motion_that_never_stands_is_refused(panda_model, ideal):
    with pytest.raises(ExperimentError, match="never stands"):
        watanabe(panda_model, ideal, ((1.0, 1.2),))
