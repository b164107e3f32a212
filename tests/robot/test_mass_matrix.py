"""The mass matrix from poses alone, against MuJoCo's."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from pretouch.robot.description import panda
from pretouch.robot.mass_matrix import mass_matrix_into
from pretouch.robot.model import RobotModel

MODEL = RobotModel(panda())


@settings(max_examples=30)
@given(st.lists(st.floats(-2.8, 2.8), min_size=7, max_size=7))
def test_it_is_mujocos_in_any_posture(q):
    kin, M = MODEL.kinematics(np.array(q)), np.empty((7, 7))
    mass_matrix_into(kin, MODEL.mechanism, M)
    assert_allclose(M, MODEL.mass_matrix(np.array(q)), atol=1e-12)
