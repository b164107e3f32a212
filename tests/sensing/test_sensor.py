"""Types of sensor: what they see, in skin files, in recordings, and in perception."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from pretouch.coverage.ways import expected_range
from pretouch.errors import ParameterError, SkinError
from pretouch.perception.obstacles import measured, placed_sensors
from pretouch.perception.scene_filter import Fixtures
from pretouch.robot.body import no_capsules
from pretouch.sensing.sensor import PAPER_SENSOR, VL53L5CX, VL53L7CX, Sensor, cone_rays, cones_of
from pretouch.sensing.skin import Skin, load_skin, save_skin, sensor_unit
from pretouch.sensing.unit import SensorUnit
from pretouch.types import RangeReadings, RangeStatus

UNIT = """
[[unit]]
id = "{id}"
link = "panda_hand"
position_m = [0.0, -0.108, {z}]
quaternion_wxyz = [0.7071067811865476, 0.7071067811865476, 0.0, 0.0]
"""
WIDE = """
[sensor.wide]
field_of_view_deg = 60
nearest_m = 0.02
farthest_m = 1.0
"""


@dataclass(frozen=True)
class Whistle(Sensor, name="whistle"):
    """An ultrasonic one of a test's."""

    field_of_view_deg: float = 15.0
    nearest_m: float = 0.2
    farthest_m: float = 6.0
    rate_hz: float = 10.0


def skin_of(folder, model, text):
    file = folder / "skin.toml"
    file.write_text(text)
    return load_skin(file, model)


def test_a_unit_has_the_papers_sensor_unless_its_file_says_otherwise(panda_model, tmp_path):
    text = WIDE + UNIT.format(id="a", z=0.045) + UNIT.format(id="b", z=0.02) + 'sensor = "wide"\n'
    text += UNIT.format(id="c", z=0.0) + 'sensor = "whistle"\n'
    skin = skin_of(tmp_path, panda_model, text)
    a, b, c = (unit.sensor for unit in skin.units)
    assert a == PAPER_SENSOR
    assert (b.field_of_view_deg, b.farthest_m, b.rate_hz, b.label) == (60, 1.0, 50.0, "wide")
    assert c == Whistle()
    assert skin.cones.kind.tolist() == [0, 1, 2]
    np.testing.assert_allclose(skin.cones.edge[:, 2], np.tan(np.deg2rad([13.5, 30.0, 7.5])))
    save_skin(skin, tmp_path / "again.toml")
    assert [unit.sensor for unit in load_skin(tmp_path / "again.toml", panda_model).units] == [a, b, c]


def test_a_wider_cone_meets_what_a_narrow_one_misses(panda_model, tmp_path):
    skin = skin_of(tmp_path, panda_model, WIDE + UNIT.format(id="a", z=0.045) + 'sensor = "wide"\n')
    kin = panda_model.kinematics(panda_model.description.q_ready)
    sensors = placed_sensors(skin.arrays, kin)
    p, R = sensors.position[0], sensors.rotation[0]
    # a wall along the beam, 0.1 m beside it: the edge of a cone of 60 degrees meets it at 0.1 m / sin 30, that of 27 at
    # 0.1 m / sin 13.5; a ray of the rings lies up to 15 degrees beside that edge
    wall = Fixtures(np.array([[*-R[:, 0], -R[:, 0] @ p - 0.1]]), no_capsules())
    for sensor, angle in ((skin.units[0].sensor, 30.0), (PAPER_SENSOR, 13.5)):
        seen = expected_range(kin, sensors, cones_of([sensor]), no_capsules(), wall)
        assert seen[0] == pytest.approx(0.1 / np.sin(np.deg2rad(angle)), rel=0.04)


def test_a_reading_counts_within_what_its_own_sensor_measures():
    cones = cones_of([PAPER_SENSOR, Whistle()])
    for distance, shown in ((0.1, (0.1, 0.2)), (5.0, (np.nan, 5.0)), (7.0, (np.nan, np.nan))):
        readings = RangeReadings(np.zeros(2), np.full(2, distance), np.full(2, int(RangeStatus.OK)))
        np.testing.assert_equal(measured(readings.distance, readings.status, cones), shown)
    near = RangeReadings(np.zeros(2), np.zeros(2), np.full(2, int(RangeStatus.MIN_RANGE)))
    np.testing.assert_equal(measured(near.distance, near.status, cones), (0.04, 0.2))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (UNIT.format(id="a", z=0.0) + 'sensor = "radar9"\n', r"Unit a has the sensor 'radar9': choose from .*vl53l1x"),
        (UNIT.format(id="a", z=0.0) + "sensor = 7\n", "Unit a has the sensor 7: choose from"),
        (
            "[sensor.odd]\nfield_of_view_deg = 400\n",
            r"\[sensor.odd\] is not possible: .*field_of_view_deg.* at most 120",
        ),
        ("[sensor.odd]\nnearest_m = 5.0\n", r"\[sensor.odd\] is not possible: .*nearest_m is 5 and farthest_m 4"),
        ("[sensor.odd]\nrate_hz = nan\n", r"\[sensor.odd\] is not possible: .*rate_hz"),
        ("[sensor.odd]\nangle = 3\n", r"\[sensor.odd\] has the unknown key 'angle': use like, field_of_view_deg"),
        ("[sensor.odd]\nown_name = 'x'\n", "has the unknown key 'own_name'"),
        ('[sensor.odd]\nlike = "odder"\n', r"\[sensor.odd\] has the sensor 'odder': choose from"),
        ("[sensor.vl53l1x]\nrate_hz = 10\n", r"\[sensor.vl53l1x\] has the name of a known type"),
        (
            '[sensor.mine]\nlike = "vl53l5cx"\nzones = 5\n',
            r"zones is 5: it measures 4 x 4 or 8 x 8. \(in .*skin.toml\)",
        ),
        ("[sensor.many]\nzones = 9\n", "zones is 9: it must be at most 8"),
        (
            UNIT.format(id="a", z=0.045) + UNIT.format(id="b", z=0.02) + 'sensor = "sonar"\n',
            r"Unit b has the sensor 'sonar': .* \(in .*skin.toml, unit 2 of 2\)",
        ),
        ("sensor = 4\n", "sensor is 4: write a table"),
        ("sensor = {odd = 4}\n", r"\[sensor.odd\] is 4: write a table"),
    ],
)
def test_a_type_that_cannot_be_is_named(panda_model, tmp_path, text, said):
    with pytest.raises(SkinError, match=said) as error:
        skin_of(tmp_path, panda_model, text if "[[unit]]" in text else text + UNIT.format(id="a", z=0.0))
    assert "skin.toml" in str(error.value)


def test_types_of_programs_are_checked_too():
    with pytest.raises(ParameterError, match="field_of_view_deg"):
        Sensor(field_of_view_deg=0.0)
    assert sensor_unit(
        id="a", link="panda_hand", position_m=np.zeros(3), quaternion_wxyz=[1.0, 0, 0, 0], sensor="whistle"
    ).sensor == Whistle()  # fmt: skip


ZONES = 'sensor = "vl53l5cx"\ntouch = true\n'


def test_each_zone_looks_along_its_own_beam_and_the_file_keeps_the_unit_whole(panda_model, tmp_path):
    skin = skin_of(tmp_path, panda_model, UNIT.format(id="a", z=0.045) + UNIT.format(id="b", z=0.02) + ZONES)
    assert len(skin) == 17
    assert skin.ids[:3] == ("a", "b/0", "b/1")
    assert skin.ids[-1] == "b/15"
    assert skin.boards == ("a", *["b"] * 16)
    assert skin.first.tolist() == [0, 1]
    assert skin.touching.tolist() == [1]
    assert [unit.id for unit in skin.mounted] == ["a", "b"]
    beam = skin.T_link_sensor[1:, :3, :3] @ [0.0, 0.0, 1.0]
    own = beam @ skin.mounted[1].T_link_sensor[:3, :3]  # in the unit's axes
    # from side to side 45 degrees: four zones of 11.25, the outer ones 16.875 off the axis
    across = np.rad2deg(np.arctan2(own[:, 0], own[:, 2])).reshape(4, 4)
    np.testing.assert_allclose(across, [[-16.875, -5.625, 5.625, 16.875]] * 4)
    np.testing.assert_allclose(np.rad2deg(np.arctan2(own[:, 1], own[:, 2])).reshape(4, 4), across.T)
    # the corners' edges: near the 63 degrees from corner to corner of the data sheet
    assert 45.0 < np.rad2deg(np.arccos(own[0] @ own[15])) < 63.0
    turns = skin.T_link_sensor[1:, :3, :3]
    np.testing.assert_allclose(turns @ turns.transpose(0, 2, 1), np.broadcast_to(np.eye(3), (16, 3, 3)), atol=1e-12)
    save_skin(skin, tmp_path / "again.toml")
    again = load_skin(tmp_path / "again.toml", panda_model)
    assert again.ids == skin.ids
    assert (tmp_path / "again.toml").read_text().count("[[unit]]") == 2
    np.testing.assert_allclose(again.T_link_sensor, skin.T_link_sensor, atol=1e-12)


def test_zones_of_more_units_than_a_step_can_take_are_refused(panda_model, paper_skin):
    eight = [replace(paper_skin.units[0], id=str(k), sensor=VL53L5CX(zones=8)) for k in range(33)]
    with pytest.raises(SkinError, match="has 2112 units, each zone counted: give at most 2048"):
        Skin(eight, panda_model)
    with pytest.raises(SkinError, match="Unit 0/0 is a zone: give the whole unit"):
        Skin(Skin(eight[:1], panda_model).units, panda_model)


@pytest.mark.parametrize("zone", [16, -1, "0", True, 1.0])
def test_a_zone_that_the_sensor_does_not_have_is_refused(paper_skin, zone):
    with pytest.raises(SkinError, match=r"Unit hand_left is zone .* of its sensor: give one from 0 to 15"):
        replace(paper_skin.units[0], sensor=VL53L5CX(), zone=zone)


def test_a_unit_speaks_over_the_network_once_for_all_its_zones(panda_model, paper_skin):
    assert (paper_skin.network.ids, set(paper_skin.network.zones)) == (paper_skin.ids, {1})
    assert np.array_equal(paper_skin.T_link_board, paper_skin.T_link_sensor)
    zoned = Skin([paper_skin.units[0], replace(paper_skin.units[1], sensor=VL53L5CX())], panda_model)
    assert (zoned.network.ids, zoned.network.zones) == (("hand_left", "hand_right"), (1, 4))
    assert list(zoned.network.first) == zoned.first.tolist() == [0, 1]
    assert zoned.network.rows == len(zoned) == 17
    assert zoned.board.tolist() == [0, *[1] * 16]
    assert zoned.T_link_board[16] == pytest.approx(paper_skin.T_link_sensor[1], abs=1e-12)


def test_a_zone_has_a_cone_as_large_as_it_is():
    assert VL53L7CX().angle == pytest.approx(np.deg2rad(15.0) * 2 / np.sqrt(np.pi))  # a cone as large as a zone


def test_each_type_has_its_bursts_delay_and_period():
    timing = cones_of([PAPER_SENSOR, VL53L7CX(), VL53L5CX(zones=8), Whistle()]).timing
    blind, delay, period = timing.T
    assert blind == pytest.approx([0.0, 0.86, 0.86, 0.0])
    # 8 x 8: the middle of its four parts of 1/60 s is 25 ms before that of the last
    assert delay == pytest.approx([0.0075, 0.034, 0.059, 0.0])
    assert period == pytest.approx([1 / 50, 1 / 60, 1 / 15, 1 / 10])
    with pytest.raises(ParameterError, match="blind_s is -1"):
        VL53L7CX(blind_s=-1.0)


# a unit


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
        (_pose(last_row=(0, 0, 0, 2)), "0 0 0 1 as the last row"),
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
