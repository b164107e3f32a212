import dataclasses

import numpy as np
import pytest

from pretouch.errors import ParameterError
from pretouch.robot.description import fr3, panda
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
    found.check_joints(6)
    # base and hand are those of the Panda, its third joint is left out
    assert found.torque_noise_nm == pytest.approx([2 * own.torque_noise_nm[k] for k in (0, 1, 2)] + [
        2 * own.torque_noise_nm[k] for k in (4, 5, 6)
    ])  # fmt: skip
    assert found.stiffness_nm_rad == tuple(own.stiffness_nm_rad[k] for k in (0, 1, 2, 4, 5, 6))


def test_figures_for_another_number_of_joints_are_refused(panda_model):
    params = dataclasses.replace(PlantParams(), stiffness_nm_rad=(1000.0,) * 6)
    with pytest.raises(ParameterError, match="stiffness_nm_rad has 6 values, the arm 7 joints"):
        Plant(panda_model, SceneSpec(), params, panda_model.description.q_ready, 0)
