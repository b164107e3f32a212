import numpy as np
import pytest

from pretouch.errors import ExperimentError
from pretouch.robot.postures import brought_to


def test_the_hand_is_at_the_point_and_as_upright_as_before(panda_model):
    point = np.array([0.5, -0.25, 0.25])
    q = brought_to(panda_model, point)
    kin, ready = panda_model.kinematics(q), panda_model.kinematics(panda_model.description.q_ready)
    ee = panda_model.ee
    np.testing.assert_allclose(kin.position[ee], point, atol=2e-6)
    np.testing.assert_allclose(kin.rotation[ee], ready.rotation[ee], atol=1e-5)
    assert np.all((q > panda_model.q_min) & (q < panda_model.q_max))


def test_a_point_out_of_reach_is_named(panda_model):
    with pytest.raises(ExperimentError, match=r"cannot reach \[2.0, 0.0, 0.5\]"):
        brought_to(panda_model, np.array([2.0, 0.0, 0.5]))
