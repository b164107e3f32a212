import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from pretouch.errors import SkinError
from pretouch.sensing.sensor import PAPER_SENSOR, cone_rays
from pretouch.sensing.unit import SensorUnit


def _pose(rotation=np.eye(3), position=(0, 0, 0), last_row=(0, 0, 0, 1)) -> np.ndarray:  # noqa: B008 it is not changed
    return np.vstack([np.column_stack([rotation, position]), last_row]).astype(float)


def test_a_unit_keeps_its_own_read_only_pose():
    T = _pose(position=(0.1, 0.2, 0.3))
    unit = SensorUnit("hand", "panda_hand", T)
    T[:] = 0.0
    np.testing.assert_array_equal(unit.T_link_sensor[:3, 3], [0.1, 0.2, 0.3])
    with pytest.raises(ValueError, match="read-only"):
        unit.T_link_sensor[0, 0] = 2.0


@pytest.mark.parametrize(
    ("pose", "message"),
    [
        (np.eye(3), "give a finite 4 x 4 matrix"),
        (_pose(position=(np.nan, 0, 0)), "give a finite 4 x 4 matrix"),
        (_pose(rotation=np.full((3, 3), np.inf)), "give a finite 4 x 4 matrix"),
        (_pose(rotation=1e200 * np.eye(3)), "give a finite 4 x 4 matrix, in metres"),  # and is not multiplied
        (_pose(position=(1001.0, 0, 0)), "give a finite 4 x 4 matrix, in metres"),
        (_pose(rotation=np.diag([1.0, 1.0, -1.0])), "not a proper rotation .determinant -1.*right-handed"),
        (_pose(rotation=1.01 * np.eye(3)), "not a proper rotation .*give a right-handed rotation"),
        (_pose(rotation=np.zeros((3, 3))), "not a proper rotation .determinant 0"),
        (_pose(last_row=(0, 0, 0, 2)), "last row of its pose .*must be 0 0 0 1"),
    ],
)
def test_a_pose_that_is_none_is_refused_with_the_units_name(pose, message):
    with pytest.raises(SkinError, match=f"Unit hand: .*{message}"):
        SensorUnit("hand", "panda_hand", pose)


@pytest.mark.parametrize("name", ["left\nright", "left\x1b[31m", "\ud800"])
def test_a_name_that_does_not_print_is_refused_in_one_line(name):
    with pytest.raises(SkinError, match="printable characters only") as caught:
        SensorUnit(name, "panda_hand", np.eye(4))
    assert str(caught.value).isprintable()


def test_a_unit_is_taken_to_be_where_it_is_said_to_be():
    unit = SensorUnit("hand", "panda_hand", np.eye(4))
    assert (unit.position_sigma, unit.orientation_sigma) == (0.0, 0.0)
    unsure = SensorUnit("hand", "panda_hand", np.eye(4), 0.5, np.float32(0.25))
    assert (unsure.position_sigma, unsure.orientation_sigma) == (0.5, 0.25)
    assert type(unsure.orientation_sigma) is float


@pytest.mark.parametrize("sigma", [-1e-9, np.nan, np.inf, 3.0, True, "0.1", None])
def test_an_uncertainty_that_is_none_is_refused_with_the_units_name(sigma):
    with pytest.raises(SkinError, match=r"Unit hand: its position_sigma is .*: give .* deviation from 0 to 0\.5 m"):
        SensorUnit("hand", "panda_hand", np.eye(4), position_sigma=sigma)
    with pytest.raises(SkinError, match=r"Unit hand: its orientation_sigma is .*: give .* from 0 to 1\.571 rad"):
        SensorUnit("hand", "panda_hand", np.eye(4), orientation_sigma=sigma)


@pytest.mark.parametrize(("rings", "count"), [(0, 1), (1, 7), (2, 19), (3, 37)])
def test_cone_rays_are_unit_vectors_from_axis_to_edge(rings, count):
    rays = cone_rays(rings, PAPER_SENSOR.angle)
    assert rays.shape == (count, 3)
    np.testing.assert_allclose(np.linalg.norm(rays, axis=1), 1.0, atol=1e-12)
    np.testing.assert_array_equal(rays[0], [0, 0, 1])
    tilt = np.rad2deg(np.arccos(np.minimum(rays[:, 2], 1.0)))
    assert tilt.max() == pytest.approx(13.5 if rings else 0.0)  # half of the data sheet's 27 degrees


@given(tilt=st.floats(0.0, 1.0), turn=st.floats(0.0, 2 * np.pi))
def test_no_direction_in_the_field_of_view_is_far_from_a_ray(tilt, turn):
    seen = Rotation.from_euler("zy", [turn, tilt * PAPER_SENSOR.angle / 2]).apply([0, 0, 1])
    nearest = (cone_rays(2, PAPER_SENSOR.angle) @ seen).max()
    assert np.rad2deg(np.arccos(min(nearest, 1.0))) < 5.0  # rings and rays lie about 7 degrees apart
