from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pretouch.errors import PretouchError, RobotModelError
from pretouch.robot.description import panda


def test_panda_has_the_limits_its_vendor_publishes():
    arm = panda()
    np.testing.assert_allclose(arm.qd_max, [2.175] * 4 + [2.61] * 3)
    np.testing.assert_allclose(arm.qdd_max, [15, 7.5, 10, 12.5, 15, 20, 20])
    np.testing.assert_allclose(arm.tau_max, [87] * 4 + [12] * 3)
    np.testing.assert_allclose(np.rad2deg(arm.q_ready), [0, -45, 0, -135, 0, 90, 45])


@pytest.mark.parametrize("name", ["qd_max", "qdd_max", "tau_max"])
@pytest.mark.parametrize("bad", [0.0, -1.0, np.nan, np.inf])
def test_a_limit_that_is_no_positive_number_is_refused(name, bad):
    limits = np.ones(7)
    limits[3] = bad
    with pytest.raises(RobotModelError, match=f"panda: {name} is .*give 7 positive, finite numbers"):
        replace(panda(), **{name: limits})


@pytest.mark.parametrize("shape", [(6,), (8,), (7, 1), ()])
def test_limits_of_the_wrong_shape_are_refused(shape):
    with pytest.raises(RobotModelError, match=r"panda: qdd_max is [^:]*: give 7 positive"):
        replace(panda(), qdd_max=np.ones(shape))


def test_a_missing_mjcf_file_is_named():
    with pytest.raises(PretouchError, match=r"panda: there is no MJCF file at nowhere/arm\.xml"):
        replace(panda(), mjcf=Path("nowhere/arm.xml"))
