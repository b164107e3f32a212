from dataclasses import replace

import mujoco
import numpy as np
import pytest

from pretouch.errors import ParameterError
from pretouch.sensing.skin import Skin
from pretouch.sensing.unit import SensorUnit
from pretouch.sim.imu import ImuParams, Imus
from pretouch.sim.plant import Plant
from pretouch.sim.plant_params import PlantParams
from pretouch.sim.scene import SceneSpec

G = 9.80665
ACCELERATION_LSB, ANGULAR_RATE_LSB = 0.122e-3 * G, np.deg2rad(17.5e-3)
"""At 4 g and 500 degrees a second [m/s^2], [rad/s] (data sheet)."""
NO_ERROR = PlantParams(mass_error=0.0, payload_max_kg=0.0)
EXACT = ImuParams(
    rate_error=0.0, scale_error=0.0, misalignment_deg=0.0, acceleration_bias_mg=0.0, angular_rate_bias_dps=0.0,
    acceleration_noise_ug=0.0, angular_rate_noise_mdps=0.0, acceleration_bandwidth_hz=1e4,
    angular_rate_bandwidth_hz=1e4,
)  # fmt: skip
"""A sensor that only rounds."""


class Rig:
    """Some sensors on an arm, and all samples they took."""

    def __init__(self, model, skin: Skin, params: ImuParams, seed: int = 0) -> None:
        self.plant = Plant(model, SceneSpec(), NO_ERROR, model.description.q_ready, seed)
        self.samples = []
        self.imus = Imus(self.plant, skin, params, seed, self.samples.append)
        self.skin = skin

    def of(self, unit: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Times (M,), angular velocities (M, 3) and accelerations (M, 3) of a unit."""
        mine = [s for s in self.samples if s.unit == unit]
        counts = np.array([s.counts for s in mine], dtype=float)
        return np.array([s.time for s in mine]), counts[:, :3] * ANGULAR_RATE_LSB, counts[:, 3:] * ACCELERATION_LSB

    def turn(self, joint: int, speed: float, duration: float) -> None:
        """Turn one joint exactly [rad/s], whatever its motor and its friction would do."""
        qd = np.zeros(self.plant.model.n)
        qd[joint] = speed
        for _ in range(round(duration / 0.001)):
            self.plant.mj_data.qvel[: len(qd)] = qd
            self.plant.advance(0.001)


def beside_the_axis(model, x: float, count: int = 1) -> Skin:
    """Sensors so far off the axis of joint 1 [m]."""
    pose = np.eye(4)
    pose[0, 3] = x
    return Skin([SensorUnit(f"arm{i}", model.links[2], pose) for i in range(count)], model)


def test_the_motion_is_that_of_mujocos_own_sensors(panda_model, paper_skin):
    rig = Rig(panda_model, paper_skin, replace(EXACT, rate_hz=1000.0))
    spec = mujoco.MjSpec.from_file(str(panda_model.description.mjcf))
    for name, unit in zip(paper_skin.ids, paper_skin.units, strict=True):
        quaternion = np.zeros(4)
        mujoco.mju_mat2Quat(quaternion, unit.T_link_sensor[:3, :3].reshape(-1))
        spec.body(unit.link).add_site(name=name, pos=unit.T_link_sensor[:3, 3], quat=quaternion)
        for kind in (mujoco.mjtSensor.mjSENS_GYRO, mujoco.mjtSensor.mjSENS_ACCELEROMETER):
            spec.add_sensor(type=kind, objtype=mujoco.mjtObj.mjOBJ_SITE, objname=name)
    other = spec.compile()
    data, seen = mujoco.MjData(other), []

    def note(now: float) -> None:
        # velocities belong half a step before positions: those at the instant of the positions are between two
        data.qpos[:7], data.qvel[:7] = state[0], 0.5 * (state[1] + rig.plant.mj_data.qvel[:7])
        data.qacc[:7] = rig.plant.mj_data.qacc[:7]
        mujoco.mj_inverse(other, data)  # derives the sensors from positions, velocities and accelerations
        seen.append(data.sensordata.reshape(-1, 6).copy())

    state = rig.plant.mj_data.qpos[:7].copy(), rig.plant.mj_data.qvel[:7].copy()
    for cycle in range(60):
        rig.plant.command(0.6 * np.sin(2 * np.pi * np.linspace(0.5, 1.5, 7) * 0.01 * cycle))
        for _ in range(10):
            state = rig.plant.mj_data.qpos[:7].copy(), rig.plant.mj_data.qvel[:7].copy()
            rig.plant.advance(0.001)
            note(rig.plant.time)  # qacc is that of the state before the step
    instants = 0.001 * np.arange(len(seen))
    for unit in range(len(paper_skin)):
        times, rate, acceleration = rig.of(unit)
        at = (times > 0.1) & (times < 0.59)
        expected = np.array([np.interp(times[at], instants, value) for value in np.array(seen)[:, unit].T]).T
        assert rate[at] == pytest.approx(expected[:, :3], abs=0.6 * ANGULAR_RATE_LSB)
        assert acceleration[at] == pytest.approx(expected[:, 3:], abs=0.6 * ACCELERATION_LSB)


def test_each_sensor_samples_at_its_own_rate_without_gaps(panda_model, paper_skin):
    rig = Rig(panda_model, paper_skin, ImuParams())
    rig.plant.advance(2.0)
    for unit, true in enumerate(rig.imus.rate):
        times, _, _ = rig.of(unit)
        assert np.diff(times) == pytest.approx(np.full(len(times) - 1, 1 / true))
        assert len(times) == pytest.approx(2.0 * true, abs=2)
    assert 0.97 * 416 <= rig.imus.rate.min() < rig.imus.rate.max() <= 1.03 * 416
    assert len(set(rig.imus.rate)) == len(paper_skin)


def test_noise_has_the_density_of_the_data_sheet(panda_model, paper_skin):
    rig = Rig(panda_model, paper_skin, ImuParams(scale_error=0.0, misalignment_deg=0.0))
    quiet = Rig(panda_model, paper_skin, ImuParams(
        scale_error=0.0, misalignment_deg=0.0, acceleration_noise_ug=0.0, angular_rate_noise_mdps=0.0
    ))  # fmt: skip
    rig.plant.advance(4.0)
    quiet.plant.advance(4.0)
    rate_density, acceleration_density = [], []
    for unit, true in enumerate(rig.imus.rate):
        (_, rate, acceleration), (_, rate_0, acceleration_0) = rig.of(unit), quiet.of(unit)
        rate_density.append((rate - rate_0).std(axis=0) / np.sqrt(true / 2))
        acceleration_density.append((acceleration - acceleration_0).std(axis=0) / np.sqrt(true / 2))
    # rounding to counts adds their variance / 6 in this difference
    rounding = np.array([ANGULAR_RATE_LSB, ACCELERATION_LSB]) / np.sqrt(6 * 208)
    found = np.sqrt(np.array([np.mean(rate_density), np.mean(acceleration_density)]) ** 2 - rounding**2)
    assert found == pytest.approx([np.deg2rad(7e-3), 90e-6 * G], rel=0.02)


def test_biases_fill_their_range_and_no_more(panda_model, paper_skin):
    biased = replace(EXACT, acceleration_bias_mg=40.0, angular_rate_bias_dps=10.0)
    rates, accelerations = [], []
    for seed in range(20):
        rig = Rig(panda_model, paper_skin, biased, seed)
        exact = Rig(panda_model, paper_skin, EXACT, seed)
        rig.plant.advance(0.02)
        exact.plant.advance(0.02)
        for unit in range(len(paper_skin)):
            (_, rate, acceleration), (_, rate_0, acceleration_0) = rig.of(unit), exact.of(unit)
            rates.append(np.rad2deg((rate - rate_0).mean(axis=0)))
            accelerations.append((acceleration - acceleration_0).mean(axis=0) / G)
    for values, most in ((np.array(rates), 10.0), (np.array(accelerations), 0.040)):
        assert np.abs(values).max() < 1.03 * most
        assert values.std() == pytest.approx(most / np.sqrt(3), rel=0.08)
        assert abs(values.mean()) < 0.1 * most


def test_scales_and_axes_are_off_by_what_the_parameters_say(panda_model):
    skin = beside_the_axis(panda_model, 0.3, 30)
    only = replace(EXACT, scale_error=0.01, acceleration_range_g=2)
    rig = Rig(panda_model, skin, only)
    rig.plant.advance(0.1)
    up = np.array([rig.of(unit)[2][-1, 2] / 2 for unit in range(30)]) / G
    assert np.abs(up - 1).max() <= 0.0101
    assert up.std() == pytest.approx(0.01 / np.sqrt(3), rel=0.25)
    rig = Rig(panda_model, skin, replace(EXACT, misalignment_deg=0.5))
    rig.plant.advance(0.1)
    tilt = np.array([rig.of(unit)[2][-1, :2] for unit in range(30)]) / G
    assert np.abs(tilt).max() <= 1.02 * np.deg2rad(0.5)
    assert tilt.std() == pytest.approx(np.deg2rad(0.5) / np.sqrt(3), rel=0.25)


def test_counts_end_at_sixteen_bits(panda_model):
    rig = Rig(
        panda_model,
        beside_the_axis(panda_model, 0.45),
        replace(EXACT, acceleration_range_g=2, angular_rate_range_dps=125),
    )
    rig.turn(joint=0, speed=9.0, duration=0.1)  # 36 m/s^2 towards the axis, 516 degrees a second
    counts = np.array([s.counts for s in rig.samples if s.time > 0.05])
    assert (counts[:, 2] == 32767).all()
    assert (counts[:, 3] == -32768).all()
    assert np.abs(counts).max() <= 32768


def test_a_slow_filter_holds_back_a_sudden_turn(panda_model):
    rig = Rig(panda_model, beside_the_axis(panda_model, 0.3), replace(EXACT, angular_rate_bandwidth_hz=10.0))
    rig.plant.advance(0.01)
    rig.turn(joint=0, speed=1.0, duration=0.2)
    times, rate, _ = rig.of(0)
    turning = times > 0.02
    after = 1.0 - np.exp(-2 * np.pi * 10.0 * (times[turning] - 0.01))
    assert rate[turning, 2] == pytest.approx(after, abs=0.08)
    assert after.min() < 0.6, "all is over when it is looked at"


def test_without_units_and_with_rates_there_are_not(panda_model):
    rig = Rig(panda_model, Skin([], panda_model), ImuParams())
    rig.plant.advance(0.1)
    assert rig.samples == []
    with pytest.raises(ParameterError, match=r"ImuParams.rate_hz"):
        ImuParams(rate_hz=5.0)


def test_sensors_change_nothing_of_the_arms_motion(panda_model, paper_skin):
    rig = Rig(panda_model, paper_skin, ImuParams())
    bare = Plant(panda_model, SceneSpec(), NO_ERROR, panda_model.description.q_ready, 0)
    for plant in (rig.plant, bare):
        plant.command(np.full(7, 0.3))
        plant.advance(0.3)
    assert np.array_equal(rig.plant.mj_data.qpos, bare.mj_data.qpos)
    assert np.array_equal(rig.plant.read().tau_ext, bare.read().tau_ext)
