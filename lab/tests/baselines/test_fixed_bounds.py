import pytest

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
