"""The mass matrix from poses alone, against MuJoCo's."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from pretouch.robot.description import panda
from pretouch.robot.model import RobotModel

MODEL = RobotModel(panda())


@settings(max_examples=30)
@given(st.lists(st.floats(-2.8, 2.8), min_size=7, max_size=7))
def test_it_is_mujocos_in_any_posture(q):
    M, _ = MODEL.mass_matrix_and_bias(np.array(q), np.zeros(7), np.zeros(7))
    assert_allclose(MODEL.mass_matrix(np.array(q)), M, atol=1e-12)
