import dataclasses

import numpy as np
import pytest

from pretouch.errors import ParameterError
from pretouch.robot.description import fr3, panda
from pretouch.robot.model import RobotModel
from pretouch.sim.plant import Plant
from pretouch.sim.plant_params import PlantParams, plant_params_of
from pretouch.sim.scene import SceneSpec


@pytest.mark.parametrize("arm", [panda(), fr3()])
def test_the_panda_and_the_fr3_have_the_pandas_figures(arm):
    assert plant_params_of(arm) == PlantParams()


def test_torques_of_another_arm_are_scaled_by_its_limits():
    six = dataclasses.replace(
        panda(), q_ready=np.zeros(6), qd_max=np.ones(6), qdd_max=np.ones(6), tau_max=np.array([174.0] * 3 + [24.0] * 3)
    )
    found, own = plant_params_of(six), PlantParams()
    found.check_joints(6, 9)
    # base and hand are those of the Panda, its third joint is left out
    assert found.torque_noise_nm == pytest.approx(
        [2 * own.torque_noise_nm[k] for k in (0, 1, 2)] + [2 * own.torque_noise_nm[k] for k in (4, 5, 6)]
    )
    assert found.stiffness_nm_rad == tuple(own.stiffness_nm_rad[k] for k in (0, 1, 2, 4, 5, 6))


MODEL = RobotModel(panda())


def plant(seed=1001, **changes):
    return Plant(MODEL, SceneSpec(), PlantParams(**changes), panda().q_ready, seed)


def turned(arm, steps=30):
    states = []
    for i in range(steps):
        arm.command(np.full(7, 0.1 if i >= 10 else 0.0))
        arm.advance(0.01)
        states.append(arm.read())
    return states


def test_a_late_state_is_the_state_of_then_with_its_stamp():
    now, late = turned(plant()), turned(plant(state_delay_s=0.02))
    assert late[0].stamp == 0.0, "before a delay is over the first state is told"
    for i in range(2, 30):
        assert late[i].stamp == pytest.approx(now[i].stamp - 0.02)
        for name in ("q", "qd", "tau_ext", "q_commanded", "qd_commanded"):
            assert np.array_equal(getattr(late[i], name), getattr(now[i - 2], name)), name
        assert np.array_equal(late[i].wrench, now[i - 2].wrench)


def test_a_late_command_moves_the_arm_as_much_later():
    now, late = turned(plant()), turned(plant(command_delay_s=0.02))
    for i in range(20):
        assert late[i + 2].q_commanded - late[0].q_commanded == pytest.approx(
            now[i].q_commanded - now[0].q_commanded, abs=1e-12
        )
    assert late[11].qd_commanded.max() == 0.0


def test_commands_come_in_the_order_they_were_given():
    arm = plant(command_delay_s=0.015)
    for speed in (0.1, 0.2, 0.0):
        arm.command(np.full(7, speed))
        arm.advance(0.01)
    assert arm.read().qd_commanded[0] == pytest.approx(0.2)
    arm.advance(0.01)
    assert arm.read().qd_commanded[0] == 0.0


def test_a_known_arm_is_that_arm_whatever_the_seed():
    known = {
        "offsets_nm": (0.1,) * 7, "mass_factors": (1.01,) * len(MODEL.links), "payload_kg": 0.25,
        "ripple_phases_rad": (0.5,) * 7,
    }  # fmt: skip
    for seed in (1001, 1002):
        arm = plant(seed, **known)
        assert arm.offset_nm.tolist() == [0.1] * 7
        assert arm.error.payload == 0.25
        assert set(arm.error.mass_factor.tolist()) == {1.01}


def test_what_is_known_changes_no_other_draw():
    one, other = plant(), plant(payload_kg=0.0)
    assert np.array_equal(one.offset_nm, other.offset_nm)
    assert np.array_equal(one.error.mass_factor, other.error.mass_factor)


def test_what_is_known_of_another_arm_is_refused():
    with pytest.raises(ParameterError, match="stiffness_nm_rad has 6 values, and 7 are needed"):
        plant(stiffness_nm_rad=(1000.0,) * 6)
    with pytest.raises(ParameterError, match="mass_factors has 3 values"):
        plant(mass_factors=(1.0, 1.0, 1.0))
    with pytest.raises(ParameterError, match="offsets_nm has 6 values"):
        plant(offsets_nm=(0.0,) * 6)
    with pytest.raises(ParameterError, match=r"payload_kg is -0.1: it must be at least 0"):
        PlantParams(payload_kg=-0.1)
