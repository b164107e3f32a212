import mujoco
import numpy as np
import pytest

from pretouch.errors import RobotModelError
from pretouch.robot.body import capsules_of


def _model(geoms: str) -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(
        f'<mujoco><worldbody><body name="one">{geoms}</body><body name="two">'
        '<geom name="two_0" type="capsule" fromto="0 1 0 0 1 2" size="0.2"/></body></worldbody></mujoco>'
    )


def test_capsules_have_the_ends_and_radius_of_the_file():
    body = capsules_of(_model('<geom type="capsule" fromto="0.3 0 0 0.3 0 -0.4" size="0.05"/>'))
    assert len(body.radius) == 2
    np.testing.assert_array_equal(body.link, [1, 2])
    np.testing.assert_allclose(body.radius, [0.05, 0.2])
    for a, b, ends in zip(body.a, body.b, [[(0.3, 0, 0), (0.3, 0, -0.4)], [(0, 1, 0), (0, 1, 2)]], strict=True):
        np.testing.assert_allclose(sorted([a.tolist(), b.tolist()]), sorted(ends), atol=1e-12)


def test_geoms_that_are_no_capsules_are_refused_by_name():
    with pytest.raises(RobotModelError, match=r"The geoms plate, ball are not capsules.*capsules only"):
        capsules_of(_model('<geom name="plate" type="box" size="1 1 1"/><geom name="ball" size="1"/>'))


def test_the_pandas_fingertips_reach_beyond_the_tcp(panda_model):
    hand = panda_model.capsules.of_links(np.array([panda_model.link_index("panda_hand")]))
    tip = max((hand.a[:, 2] + hand.radius).max(), (hand.b[:, 2] + hand.radius).max())
    assert tip == pytest.approx(0.1034 + 0.0087)  # 8.7 mm beyond the TCP, as the MJCF says


def test_the_body_that_moves_is_all_but_the_base(panda_model):
    base = panda_model.link_index("panda_link0")
    assert base in panda_model.capsules.link
    assert base not in panda_model.body.link
    assert len(panda_model.body.radius) == len(panda_model.capsules.radius) - 3  # link0_0, link0_1, link0_2
