import numpy as np
import pytest
from tests.calibrated_arm import swinging
from tests.calibration.made import MovingArm

from pretouch.calibration.motion.plan import Plan
from pretouch.errors import ExperimentError
from pretouch.sim.imu import ImuParams
from pretouch.sim.random_skin import random_skin
from pretouch_lab.bench.calibration import clock_errors, simulate

START = np.array([0.0, -0.4, 0.0, -2.0, 0.0, 1.8, 0.6])
STILL = Plan(np.array([0.0, 1.0]), np.array([START, START]))
EXACT = ImuParams(
    rate_error=0.0, scale_error=0.0, misalignment_deg=0.0, acceleration_bias_mg=0.0, angular_rate_bias_dps=0.0,
    acceleration_noise_ug=0.0, angular_rate_noise_mdps=0.0,
)  # fmt: skip


@pytest.fixture(scope="module")
def skin(panda_model):
    return random_skin(panda_model, 0)


class Planned(MovingArm):
    """An arm that follows a plan exactly."""

    def _at(self, time):
        return np.array([swinging(self.model, 5.0).at(t)[0] for t in time])


def test_units_measure_what_the_plan_does_at_the_same_instants(panda_model, skin):
    plan, ideal = swinging(panda_model, 5.0), Planned(panda_model, 5.0)
    data = simulate(panda_model, skin, plan, 0, EXACT, clock_error_s=0.0)
    swings = (ideal.time > 1.5) & (ideal.time < 3.5)
    for unit, sensed in zip(skin.units, data.units, strict=True):
        expected, at = ideal.imu(unit), ideal.time[swings]
        for name, tolerance in (("acceleration", 0.3), ("angular_velocity", 0.015)):
            found = [np.interp(at, sensed.imu.stamp, axis) for axis in getattr(sensed.imu, name).T]
            off = np.array(found).T - getattr(expected, name)[swings]
            assert np.sqrt(np.mean(off**2)) < tolerance  # the arm follows the plan to some milliseconds
    planned = np.array([plan.at(time)[0] for time in data.joints.stamp])
    assert np.abs(planned - data.joints.q).max() < 0.02


def test_each_units_stamps_are_late_by_its_own_clock(panda_model, skin):
    right = simulate(panda_model, skin, STILL, 3, clock_error_s=0.0)
    wrong = simulate(panda_model, skin, STILL, 3)
    late = clock_errors(len(skin), 3)
    assert np.ptp(late) > 0.01
    assert np.abs(late).max() <= 0.02
    for k in range(len(skin)):
        assert wrong.units[k].imu.stamp - right.units[k].imu.stamp == pytest.approx(late[k])
        assert np.array_equal(wrong.units[k].imu.acceleration, right.units[k].imu.acceleration)


def test_the_same_seed_puts_the_same_sensors_on_another_skin(panda_model, skin):
    first, second = (simulate(panda_model, one, STILL, 5) for one in (skin, random_skin(panda_model, 7)))
    for a, b in zip(first.units, second.units, strict=True):
        assert np.array_equal(a.imu.stamp, b.imu.stamp)
        # at rest a gyroscope gives its bias and its noise, wherever it sits
        assert np.abs(a.imu.angular_velocity - b.imu.angular_velocity).max() < 0.01
        assert np.abs(a.imu.angular_velocity.mean(axis=0)).max() > 0.01


def test_full_scales_are_those_of_sixteen_bits(panda_model, skin):
    data = simulate(panda_model, skin, STILL, 0, links_known=False)
    assert [unit.acceleration_max for unit in data.units] == pytest.approx([4 * 9.80665] * len(skin), rel=1e-3)
    assert data.units[0].angular_velocity_max == pytest.approx(np.deg2rad(32767 * 0.0175))
    assert {unit.link for unit in data.units} == {None}


def test_a_plan_the_arm_cannot_follow_is_said_to_be_so(panda_model, skin):
    jump = Plan(np.array([0.0, 0.05]), np.array([START, START + 0.8]))
    with pytest.raises(ExperimentError, match=r"did not follow the plan to its end. The arm has left the plan"):
        simulate(panda_model, skin, jump, 0)
