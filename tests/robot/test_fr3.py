"""The FR3: a Panda's frames and body, ranges and masses of its own."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from pretouch.robot.description import fr3
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import PAPER_SKIN, load_skin


@pytest.fixture(scope="module")
def fr3_model() -> RobotModel:
    return RobotModel(fr3())


@given(q=arrays(np.float64, 7, elements=st.floats(-3.1, 4.6)))
def test_the_fr3_has_the_frames_and_the_body_of_a_panda(panda_model, fr3_model, q):
    assert fr3_model.links == tuple(name.replace("panda", "fr3") for name in panda_model.links)
    kin, same = fr3_model.kinematics(q), panda_model.kinematics(q)
    np.testing.assert_allclose(kin.position, same.position, atol=1e-12)
    np.testing.assert_allclose(kin.rotation, same.rotation, atol=1e-12)
    np.testing.assert_array_equal(fr3_model.moved_by, panda_model.moved_by)
    for part in ("link", "a", "b", "radius"):
        np.testing.assert_array_equal(getattr(fr3_model.capsules, part), getattr(panda_model.capsules, part))


def test_joint_ranges_of_the_fr3_are_those_of_the_vendor(fr3_model):
    np.testing.assert_allclose(fr3_model.q_min, [-2.7437, -1.7837, -2.9007, -3.0421, -2.8065, 0.5445, -3.0159])
    np.testing.assert_allclose(fr3_model.q_max, [2.7437, 1.7837, 2.9007, -0.1518, 2.8065, 4.5169, 3.0159])
    assert np.all((fr3_model.q_min < fr3().q_ready) & (fr3().q_ready < fr3_model.q_max))


@given(fraction=arrays(np.float64, 7, elements=st.floats(0.0, 1.0)))
def test_mass_matrix_of_the_fr3_is_positive_definite(fr3_model, fraction):
    mass_matrix = fr3_model.dynamics(
        fr3_model.q_min + fraction * (fr3_model.q_max - fr3_model.q_min), np.zeros(7)
    ).mass_matrix
    assert np.linalg.eigvalsh(mass_matrix).min() > 1e-4
    np.testing.assert_allclose(mass_matrix, mass_matrix.T, atol=1e-12)


def test_the_stretched_fr3_weighs_what_its_links_do(fr3_model):
    # at zero all frames are turned about x alone: the shoulder carries each centre of mass with its x in the base
    masses = [2.9355370338, 2.2449013699, 2.6155955791, 2.3271207594, 1.8170376524, 0.6271432862, 0.73]
    x = [0.0031828864, 0.0407015686, 0.0825 - 0.0459100965, -0.0016039605, 0.0597131221, 0.088 + 0.0045225817]
    hand = 0.088 - 0.01 * np.cos(np.pi / 4)
    torque = -9.81 * np.dot(masses, [*x, hand])
    assert fr3_model.dynamics(np.zeros(7), np.zeros(7)).gravity[1] == pytest.approx(torque, abs=1e-3)


def test_the_seven_units_have_the_same_places_on_an_fr3(panda_model, fr3_model):
    skin = load_skin(PAPER_SKIN.with_name("fr3_seven_units.toml"), fr3_model)
    original = load_skin(PAPER_SKIN, panda_model)
    assert skin.ids == original.ids
    np.testing.assert_array_equal(skin.link, original.link)
    np.testing.assert_array_equal(skin.T_link_sensor, original.T_link_sensor)
