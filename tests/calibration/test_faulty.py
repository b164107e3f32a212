"""The faults that other tests rely on are what they say."""

import numpy as np
import pytest

from pretouch.calibration.data import CalibrationData, UnitData
from pretouch.traces import ImuTrace, JointTrace
from tests.calibration import faulty


def made(factor: float = 1.0) -> CalibrationData:
    stamp = np.arange(0.0, 10.0, 0.01)
    signal = factor * np.sin(stamp)[:, None] * [1.0, 2.0, 3.0]
    units = tuple(UnitData(name, ImuTrace(stamp, k * signal, -k * signal)) for k, name in enumerate("abc", 1))
    return CalibrationData(JointTrace(stamp, signal), units)


DATA = made()


def of(data: CalibrationData, unit: str) -> ImuTrace:
    return faulty.unit_of(data, unit).imu


def test_swapped_units_keep_their_names_and_exchange_what_they_measure():
    data = faulty.swapped(DATA, "a", "b")
    assert [unit.id for unit in data.units] == ["a", "b", "c"]
    assert of(data, "a") is of(DATA, "b")
    assert of(data, "b") is of(DATA, "a")


def test_a_slipped_unit_goes_on_elsewhere():
    imu = of(faulty.slipped(DATA, made(5.0), "b", 4.0), "b")
    early = imu.stamp < 4.0
    assert np.array_equal(imu.stamp, of(DATA, "b").stamp)
    assert imu.acceleration == pytest.approx(np.where(early[:, None], 1.0, 5.0) * of(DATA, "b").acceleration)


def test_a_stuck_axis_stays_where_it_was():
    imu = of(faulty.stuck(DATA, "c", "acceleration", 1, since=5.0), "c")
    assert np.ptp(imu.acceleration[imu.stamp >= 5.0, 1]) == 0.0
    assert np.ptp(imu.acceleration[imu.stamp < 5.0, 1]) > 1.0
    assert np.array_equal(imu.angular_velocity, of(DATA, "c").angular_velocity)
    assert not of(faulty.dead(DATA, "c", "angular_velocity"), "c").angular_velocity.any()


def test_a_saturated_unit_tells_its_smaller_range():
    unit = faulty.unit_of(faulty.saturated(DATA, "a", acceleration_max=2.0), "a")
    assert np.abs(unit.imu.acceleration).max() == unit.acceleration_max == 2.0
    assert np.array_equal(unit.imu.angular_velocity, of(DATA, "a").angular_velocity)


def test_a_unit_on_the_table_feels_gravity_and_does_not_turn():
    imu = of(faulty.on_the_table(DATA, "a"), "a")
    assert np.linalg.norm(imu.acceleration, axis=1) == pytest.approx(np.full(1000, 9.9), abs=0.2)
    assert imu.angular_velocity.std(axis=0).max() < 0.01


def test_missing_data_leave_a_gap():
    joints = faulty.without_joints(DATA, 2.0, 3.0).joints
    assert np.diff(joints.stamp).max() == pytest.approx(1.02, abs=0.02)
    assert len(joints.q) == len(joints.stamp)
    silent = of(faulty.silent(DATA, "a", 2.0, 3.0), "a")
    assert np.diff(silent.stamp).max() == pytest.approx(1.02, abs=0.02)
    lossy = of(faulty.with_losses(DATA, "a", bursts=5, length=0.3), "a")
    assert 850 <= len(lossy.stamp) < 1000
    assert len(lossy.acceleration) == len(lossy.stamp)


def test_knocks_are_short_and_hard():
    off = np.linalg.norm(of(faulty.with_knocks(DATA, "a", 5), "a").acceleration - of(DATA, "a").acceleration, axis=1)
    assert 5 <= np.count_nonzero(off) <= 15
    assert off[off > 0].min() > 5.0


def test_joints_may_be_late():
    assert faulty.joints_late(DATA, 0.1).joints.stamp[0] == pytest.approx(0.1)
