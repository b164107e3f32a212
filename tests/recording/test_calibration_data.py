"""What a skin can be calibrated from, out of either kind of recording."""

from dataclasses import replace

import numpy as np
import pytest

from pretouch.loop import Cycle
from pretouch.recording.calibration_data import read_measured
from pretouch.recording.skin_recording import SkinRecording
from pretouch.recording.writer import Recording
from pretouch.sensing.unit import ACCELERATION_LSB, ANGULAR_RATE_LSB
from pretouch.units.traffic import Received, imu_batch
from pretouch.units.wire import IMU_SAMPLE, imu_values
from tests.recording.runs import Run
from tests.recording.test_skin_recording import BATCH, arrival, sample

NAMES = tuple(f"panda_joint{i}" for i in range(1, 8))


def heard(number, **changed):
    sent = replace(sample(number), **changed)
    return Received(0, arrival(number), np.nan, 100.0 - 0.001, 2e-4, sent)


def recorded(place, received, joints=()):
    with SkinRecording(place) as recording:
        for one in received:
            recording.sample("hand/1", one, False)
        for part in joints:
            recording.joints(*part, None, NAMES)
    return read_measured(place)


def test_units_give_values_and_counters_sample_by_sample(tmp_path):
    received = [heard(n) for n in range(1, 40)]
    stamp, q = 100.0 + np.arange(50) / 50, np.random.default_rng(0).normal(size=(50, 7))
    found = recorded(tmp_path / "a.mcap", received, [(stamp, q)])
    unit = found.units["hand/1"]
    batches = [imu_batch(one) for one in received]
    np.testing.assert_allclose(unit.imu.acceleration, np.concatenate([b.acceleration for b in batches]), rtol=1e-14)
    np.testing.assert_allclose(
        unit.imu.angular_velocity, np.concatenate([b.angular_velocity for b in batches]), rtol=1e-14
    )
    # the receiver stamps with the earliest an instant can be, this with the middle
    np.testing.assert_allclose(unit.imu.stamp, np.concatenate([b.stamp for b in batches]) + 2e-4, atol=1e-9)
    counters = unit.counters
    for name in ("imu_index", "imu_count", "time_us", "imu_age_us"):
        sent = [getattr(one.sample, name) for one in received]
        assert getattr(counters, name if name == "imu_age_us" else name.removeprefix("imu_")).tolist() == sent
    assert set(counters.offset) == {100.0 - 0.001}
    assert set(counters.bound) == {2e-4}
    np.testing.assert_array_equal(found.joints.q, q)
    assert (found.joint_names, found.skin, found.complete) == (NAMES, None, True)


@pytest.mark.parametrize("acceleration", range(4))
@pytest.mark.parametrize("rate", range(5))
def test_full_scales_are_the_largest_values_a_sensor_can_tell(tmp_path, acceleration, rate):
    full = IMU_SAMPLE.pack(*[32767] * 6)
    found = recorded(tmp_path / "a.mcap", [heard(1, imu=full, imu_count=1, imu_scale=acceleration | rate << 4)])
    unit = found.units["hand/1"]
    a, w = imu_values(full, acceleration | rate << 4)
    np.testing.assert_allclose(unit.imu.acceleration, a, rtol=1e-14)
    np.testing.assert_allclose(unit.imu.angular_velocity, w, rtol=1e-14)
    range_g, range_dps = list(ACCELERATION_LSB)[acceleration], list(ANGULAR_RATE_LSB)[rate]
    assert unit.acceleration_max == pytest.approx(9.80665 * range_g, rel=1e-3)
    assert np.deg2rad(range_dps) < unit.angular_velocity_max < 1.2 * np.deg2rad(range_dps)
    assert unit.imu.acceleration.max() == unit.acceleration_max
    assert unit.imu.angular_velocity.max() == unit.angular_velocity_max


def test_of_two_scales_the_smaller_is_the_full_scale_and_one_there_is_not_is_left_out(tmp_path):
    received = [heard(number, imu_scale=scale) for number, scale in ((1, 0x21), (2, 0x42), (3, 0x51))]
    unit = recorded(tmp_path / "a.mcap", received).units["hand/1"]
    assert unit.acceleration_max == pytest.approx(4 * 9.80665, rel=1e-3)
    assert unit.angular_velocity_max == pytest.approx(np.deg2rad(573.4), rel=1e-3)
    assert unit.counters.index.tolist() == [BATCH, 2 * BATCH]
    assert len(unit.imu.stamp) == 2 * BATCH


def test_samples_of_unknown_time_keep_their_places(tmp_path):
    unknown = replace(heard(1), offset=np.nan)
    unit = recorded(tmp_path / "a.mcap", [unknown, heard(2), heard(3, imu_rate_hz=0)]).units["hand/1"]
    assert np.isnan(unit.imu.stamp).tolist() == [True] * BATCH + [False] * BATCH + [True] * BATCH
    assert np.isnan(unit.counters.offset).tolist() == [True, False, False]


def test_a_unit_without_an_imu_is_left_out(tmp_path):
    found = recorded(tmp_path / "a.mcap", [heard(1, imu_count=0, imu=b"")])
    assert found.units == {}
    assert found.joints is None


def test_a_run_gives_the_joints_of_its_inputs_its_skin_and_what_imus_it_kept(tmp_path, controller, paper_skin):
    run, rng = Run(controller), np.random.default_rng(1)
    at, a, w = 0.01 * np.arange(20), rng.normal(size=(20, 3)), rng.normal(size=(20, 3))
    with Recording(tmp_path / "run.mcap", run.controller) as recording:
        for _ in range(30):
            recording.record(run.turn())
        recording.imu("wrist 1", at[10:], a[10:], w[10:])
        recording.imu("wrist 1", at[:10], a[:10], w[:10])
    found = read_measured(tmp_path / "run.mcap")
    robots = [cycle.inputs.robot for cycle in run.cycles]
    np.testing.assert_array_equal(found.joints.q, [robot.q for robot in robots])
    np.testing.assert_array_equal(found.joints.stamp, [robot.stamp for robot in robots])
    assert found.joint_names == NAMES
    assert found.skin.ids == paper_skin.ids
    np.testing.assert_array_equal(found.skin.T_link_sensor, paper_skin.T_link_sensor)
    unit = found.units["wrist 1"]
    np.testing.assert_allclose(unit.imu.stamp, at, atol=1e-9)
    np.testing.assert_array_equal(unit.imu.acceleration, a)
    np.testing.assert_array_equal(unit.imu.angular_velocity, w)
    assert (unit.counters, unit.acceleration_max, unit.angular_velocity_max) == (None, np.inf, np.inf)


def test_inputs_of_a_run_that_are_no_posture_are_left_out(tmp_path, controller):
    run = Run(controller)
    with Recording(tmp_path / "run.mcap", controller) as recording:
        for number in range(8):
            cycle = run.turn()
            robot = cycle.inputs.robot
            changed = {2: robot.q * np.nan, 4: robot.q[:3], 6: "junk"}.get(number, robot.q)
            inputs = replace(cycle.inputs, robot=replace(robot, q=changed))
            recording.record(Cycle(inputs, cycle.before, cycle.step, cycle.after))
    found = read_measured(tmp_path / "run.mcap")
    kept = [run.cycles[i].inputs.robot.q for i in (0, 1, 3, 5, 7)]
    np.testing.assert_array_equal(found.joints.q, kept)
