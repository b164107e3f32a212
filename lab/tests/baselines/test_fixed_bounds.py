import numpy as np
import pytest
from numpy.testing import assert_array_equal
from tests.contact.alone import begun as feel_init
from tests.contact.alone import feel
from tests.contact.test_feel import KIN, MODEL, NOTHING, STILL, robot

from pretouch.errors import ParameterError
from pretouch.profiles import profile
from pretouch_lab.baselines.fixed_bounds import FixedBounds


def test_bounds_are_read_from_a_profiles_text_and_bad_ones_refused():
    bounds = profile("fixed:detect.joint_torques_nm=10,9,8").detect
    assert bounds.joint_torques_nm == (10.0, 9.0, 8.0)
    with pytest.raises(ParameterError, match="joint_torques_nm"):
        FixedBounds(joint_torques_nm=(1.0, -1.0))
    with pytest.raises(ParameterError, match="write a number"):
        profile("fixed:detect.joint_torques_nm=many")


@pytest.mark.parametrize("name", ["fixed", "observer"])
def test_without_torques_nothing_is_felt(name):
    p = profile(f"{name}:window.samples=10")
    state = feel_init(MODEL, p)
    for _ in range(12):
        found, state = feel(state, MODEL, KIN, robot(np.full(7, np.nan)), NOTHING, False, p)
    assert found.contact is None
    assert not found.armed
    assert found.evidence == 0.0


def test_fixed_bounds_by_numbers():
    p = profile("fixed:window.samples=2")
    state = feel_init(MODEL, p)
    for _ in range(3):
        found, state = feel(state, MODEL, KIN, robot(STILL), NOTHING, False, p)
    for torque, wrench, evidence in ((10.0, 0.0, 0.5), (19.9, 0.0, 0.995), (20.1, 0.0, 1.005), (0.0, 21.0, 1.05)):
        tau, force = STILL.copy(), np.zeros(6)
        tau[1], force[0] = torque, wrench
        found, _ = feel(state, MODEL, KIN, robot(tau, force), NOTHING, False, p)
        assert found.evidence == pytest.approx(evidence)
        assert (found.contact is not None) is (evidence >= 1.0)
        assert_array_equal(found.residual, tau)
