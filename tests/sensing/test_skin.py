import os
import threading
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from pretouch.coverage.ways import expected_range
from pretouch.errors import SkinError
from pretouch.perception.obstacles import placed_sensors
from pretouch.perception.scene_filter import no_fixtures
from pretouch.robot.description import panda
from pretouch.robot.model import RobotModel
from pretouch.robot.postures import brought_to
from pretouch.sensing import skin as sensing_skin
from pretouch.sensing.skin import Skin, load_skin, save_skin, sensor_unit
from pretouch.sensing.unit import SensorUnit, TouchPatch, seat

PRINTABLE = st.characters(codec="utf-8", exclude_categories=("C", "Z"), include_characters=" ")
ENTRY = {
    "id": '"left"',
    "link": '"panda_hand"',
    "position_m": "[0.0, -0.108, 0.045]",
    "quaternion_wxyz": "[0.6, 0.8, 0.0, 0.0]",
}


def _unit(name: str, link: str = "panda_hand", position=(0.0, -0.108, 0.045), R=None) -> SensorUnit:
    T = np.eye(4)
    T[:3, 3] = position
    if R is not None:
        T[:3, :3] = R
    return SensorUnit(name, link, T)


def _file(folder: Path, text: str) -> Path:
    path = folder / "skin.toml"
    path.write_text(text, encoding="utf-8")
    return path


def _entry(**changes: str | None) -> str:
    lines = [f"{key} = {value}" for key, value in (ENTRY | changes).items() if value is not None]
    return "\n".join(["[[unit]]", *lines, ""])


# A skin


def test_units_keep_their_order(panda_model):
    skin = Skin([_unit("b"), _unit("a", "panda_link6", (0.2, 0, 0)), _unit("c")], panda_model)
    assert skin.ids == ("b", "a", "c")
    assert [panda_model.links[i] for i in skin.link] == ["panda_hand", "panda_link6", "panda_hand"]
    np.testing.assert_array_equal(skin.T_link_sensor[:, 0, 3], [0, 0.2, 0])


@pytest.mark.parametrize(("position", "orientation"), [([], []), ([0.0], [0.0]), ([0.01, 0.0], [0.0, 0.02])])
def test_a_skin_knows_how_uncertain_the_places_of_its_units_are(panda_model, position, orientation):
    sigmas = enumerate(zip(position, orientation, strict=True))
    units = [replace(_unit(str(k)), position_sigma=p, orientation_sigma=o) for k, (p, o) in sigmas]
    skin, count = Skin(units, panda_model), len(position)
    assert (len(skin), skin.ids, skin.link.shape) == (count, tuple(map(str, range(count))), (count,))
    assert skin.T_link_sensor.shape == (count, 4, 4)
    np.testing.assert_array_equal(skin.arrays.position_sigma, position)
    np.testing.assert_array_equal(skin.arrays.orientation_sigma, orientation)
    assert skin.exact == (not any(position + orientation))
    assert [Skin([unit], panda_model).exact for unit in units] == [
        not (unit.position_sigma or unit.orientation_sigma) for unit in units
    ]


@pytest.mark.parametrize(
    ("units", "message"),
    [
        ([_unit(name) for name in "cabac"], "id a, c is used more than once: give each unit its own id"),
        ([_unit("a", "elbow")], r"Unit a .* 'elbow', which panda does not have: choose from panda_link0, "),
        ([_unit("a", "world")], "Unit a is mounted on 'world': choose a link of the arm, panda_link0, "),
    ],
)
def test_units_that_an_arm_cannot_carry_are_named(panda_model, units, message):
    with pytest.raises(SkinError, match=message):
        Skin(units, panda_model)


def test_a_unit_inside_its_link_is_refused_with_its_depth(panda_model):
    hand = panda_model.capsules.of_links(np.array([panda_model.link_index("panda_hand")]))
    finger = hand.radius.argmin()  # 11.5 mm, along the hand's z axis
    x, y, z = hand.b[finger]
    with pytest.raises(SkinError, match=r"Unit a lies 8\.0 mm inside panda_hand: move it out to the surface"):
        Skin([_unit("a", position=(x, y, z + 0.0035))], panda_model)
    assert len(Skin([_unit("a", position=(x, y, z + 0.0116))], panda_model)) == 1


@pytest.mark.parametrize("link", ["panda_hand_tcp", "panda_link8"])
def test_a_link_without_a_body_can_carry_a_unit_near_its_origin(panda_model, link):
    assert len(Skin([_unit("a", link, (0.0, 0.0, 0.01))], panda_model)) == 1
    with pytest.raises(SkinError, match=rf"Unit a lies 0\.6 m off {link}: give its position in metres"):
        Skin([_unit("a", link, (0.0, 0.6, 0.0))], panda_model)


def test_the_paper_skin_looks_outwards_from_the_surface(panda_model, paper_skin):
    assert len(paper_skin) == 7
    for link, T in zip(paper_skin.link, paper_skin.T_link_sensor, strict=True):
        own = panda_model.capsules.of_links(np.array([link]))
        steps = np.linspace(0, 1, 101)[:, None, None]
        axis = own.a + steps * (own.b - own.a)
        here, ahead = (
            (np.linalg.norm(T[:3, 3] + move * T[:3, 2] - axis, axis=2) - own.radius).min() for move in (0.0, 0.02)
        )
        assert 0.0 < here < 0.015
        assert ahead > here + 0.015


# Its file


@given(
    turns=st.lists(st.tuples(*[st.floats(-4, 4)] * 3), min_size=1, max_size=3),
    position=st.tuples(st.floats(0.2, 0.4), st.floats(-0.2, 0.2), st.floats(-0.2, 0.2)),
    names=st.lists(st.text(min_size=1, alphabet=PRINTABLE), min_size=3, max_size=3, unique=True),
    sigmas=st.tuples(st.floats(0.0, 0.5), st.floats(0.0, 1.5)) | st.just((0.0, 0.0)),
    patches=st.lists(st.sampled_from([None, TouchPatch(), TouchPatch(0.05, 2.0, False)]), min_size=3, max_size=3),
)
def test_a_saved_skin_is_read_back(panda_model, tmp_path_factory, turns, position, names, sigmas, patches):
    units = []
    for name, turn, patch in zip(names, turns, patches, strict=False):
        unit = _unit(name, "panda_link6", position, Rotation.from_rotvec(turn).as_matrix())
        units.append(replace(unit, position_sigma=sigmas[0], orientation_sigma=sigmas[1], touch=patch))
    skin, path = Skin(units, panda_model), tmp_path_factory.mktemp("skin") / "skin.toml"
    save_skin(skin, path)
    back = load_skin(path, panda_model)
    assert back.ids == skin.ids
    np.testing.assert_array_equal(back.touching, skin.touching)
    for part in ("link", "position_sigma", "orientation_sigma"):
        np.testing.assert_array_equal(getattr(back.arrays, part), getattr(skin.arrays, part))
    np.testing.assert_array_equal(back.T_link_sensor[:, :3, 3], skin.T_link_sensor[:, :3, 3])
    np.testing.assert_allclose(back.T_link_sensor, skin.T_link_sensor, atol=1e-14)
    assert [unit.touch for unit in back.units] == [unit.touch for unit in units]


def test_uncertainties_and_touch_sensors_are_written_only_where_there_are_any(panda_model, tmp_path):
    units = [_unit("a"), replace(_unit("b"), orientation_sigma=0.02), replace(_unit("c"), touch=TouchPatch())]
    save_skin(Skin(units, panda_model), tmp_path / "skin.toml")
    first, second, third = tomllib.loads((tmp_path / "skin.toml").read_text())["unit"]
    assert list(first) == list(ENTRY)
    assert second == first | {"id": "b", "orientation_sigma_rad": 0.02}
    assert third == first | {"id": "c", "touch": True}


@pytest.mark.parametrize("fails", ["write", "replace"])
def test_a_skin_that_cannot_be_written_leaves_the_file_that_was_there(panda_model, tmp_path, monkeypatch, fails):
    path = _file(tmp_path, "dear")

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync" if fails == "write" else "replace", full)
    with pytest.raises(SkinError, match=r"cannot be written to .*skin\.toml: No space left on device"):
        save_skin(Skin([_unit("a")], panda_model), path)
    assert path.read_text() == "dear"
    assert list(tmp_path.iterdir()) == [path]


def test_a_skin_replaces_what_a_link_leads_to_and_keeps_who_may_read_it(panda_model, tmp_path):
    path, link = _file(tmp_path, "old"), tmp_path / "link.toml"
    path.chmod(0o640)
    link.symlink_to(path)
    save_skin(Skin([_unit("a")], panda_model), link)
    assert link.is_symlink()
    assert path.stat().st_mode & 0o777 == 0o640
    assert load_skin(path, panda_model).ids == ("a",)


def test_a_skin_goes_down_a_pipe_as_it_is(panda_model, tmp_path):
    pipe, read = tmp_path / "pipe", []
    os.mkfifo(pipe)
    reader = threading.Thread(target=lambda: read.append(pipe.read_text()), daemon=True)
    reader.start()
    save_skin(Skin([_unit("a")], panda_model), pipe)
    reader.join(30.0)
    assert pipe.is_fifo()
    assert load_skin(_file(tmp_path, read[0]), panda_model).ids == ("a",)


@pytest.mark.parametrize(("place", "why"), [("nowhere/skin.toml", "No such file"), ("", "Is a directory")])
def test_a_place_for_a_skin_that_cannot_be_is_named(panda_model, tmp_path, place, why):
    with pytest.raises(SkinError, match=f"The skin cannot be written to .*{tmp_path.name}.*: {why}"):
        save_skin(Skin([_unit("a")], panda_model), tmp_path / place)


def test_a_quaternion_begins_with_w(panda_model, tmp_path):
    skin = load_skin(_file(tmp_path, _entry()), panda_model)
    # turned about x by 2 atan2(0.8, 0.6): cosine 0.36 - 0.64, sine 2 * 0.48; the beam is the third column
    np.testing.assert_allclose(skin.T_link_sensor[0, :3, 2], [0.0, -0.96, -0.28], atol=1e-12)
    np.testing.assert_allclose(skin.T_link_sensor[0, :3, 3], [0.0, -0.108, 0.045])


def test_the_matrix_of_a_quaternion_is_that_of_scipy_to_the_bit():
    place = {"id": "a", "link": "panda_link3", "position_m": np.zeros(3)}
    for drawn in np.random.default_rng(0).normal(size=(200, 4)):
        quaternion = (drawn / np.linalg.norm(drawn)).round(4)
        T = sensor_unit(**place, quaternion_wxyz=quaternion).T_link_sensor
        np.testing.assert_array_equal(T[:3, :3], Rotation.from_quat(quaternion, scalar_first=True).as_matrix())


def test_a_rounded_quaternion_and_uncertainties_in_whole_numbers_are_taken(panda_model, tmp_path):
    given = {"quaternion_wxyz": "[0.7071, 0, 0.7071, 0]", "position_sigma_m": "0", "orientation_sigma_rad": "1"}
    skin = load_skin(_file(tmp_path, _entry(**given)), panda_model)
    assert (skin.units[0].position_sigma, skin.units[0].orientation_sigma) == (0.0, 1.0)
    np.testing.assert_allclose(skin.T_link_sensor[0, :3, 2], [1, 0, 0], atol=1e-12)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (_entry(id=None), "A unit: Object missing required field `id`: a ..unit.. has id, link, position_m, quat"),
        (_entry(id="7"), r"A unit: Expected `str`, got `int` - at `\$.id`"),
        (_entry(id=r'"a\nb"'), r"the id 'a\\nb': use printable characters only"),
        (_entry(**{r'"a\nb"': "1"}), r"Unit left: .*unknown field `a\\nb`"),
        (_entry(id='""'), "empty id: give each unit a name"),
        (_entry(link='"elbow"'), "Unit left .*'elbow'.*choose from panda_link0"),
        (_entry(colour='"red"'), "Unit left: .*unknown field `colour`: a .*unit.* has id, link, position_m"),
        (_entry(position_m="[0.0, 0.1]"), r"Unit left: Expected `array` of length 3, got 2 - at `\$.position_m`"),
        (_entry(position_m="[true, 0, 0]"), r"Unit left: Expected `float`, got `bool` - at `\$.position_m\[0\]`"),
        (_entry(position_m=f"[1{'0' * 400}, 0, 0]"), r"Unit left: Number out of range - at `\$.position_m\[0\]`"),
        (_entry(position_m="[0.0, -108.0, 45.0]"), "Unit left lies .* m off panda_hand: give its position in metres"),
        (_entry(position_m="[0, 0, -1001]"), "its pose holds .*-1001.*: give a finite 4 x 4 matrix, in metres"),
        (_entry(quaternion_wxyz="[nan, 0, 0, 0]"), "Unit left: quaternion_wxyz has length nan: it must be 1"),
        (_entry(quaternion_wxyz="[1, 1, 0, 0]"), "has length 1.414: it must be 1"),
        (_entry(position_sigma_m="2.5"), r"its position_sigma is 2.5: give a standard deviation from 0 to 0\.5"),
        (_entry(touch='"yes"'), r"Unit left: Expected `bool \| object`, got `str` - at `\$.touch`"),
        (_entry(touch="{radius = 0.03}"), "Unit left: touch has the unknown key 'radius': use radius_m, force_min_n"),
        (
            _entry(touch="{radius_m = 0.0}"),
            "Unit left: touch is not possible: .*radius_m is 0.0: it must be greater than 0",
        ),
        (_entry(touch='{measures_force = "no"}'), "measures_force is 'no': it must be true or false"),
        ("", r"has no unit: give at least one \[\[unit\]\] with id, link and pose"),
        ("unit = []", "has no unit"),
        ("unit = 3", "has no unit"),
        ("[unit]\nid = 'a'", "has no unit"),
        ("unit = [3]", r"A unit is 3: write it as a \[\[unit\]\] table"),
        ("[[unit]\n", "is not valid TOML"),
        ("unit = " + "[" * 100_000, "is not valid TOML: its brackets are nested too deeply"),
        ("unit = " + "9" * 5000, "is not valid TOML: Exceeds the limit"),
        (_entry() + _entry(), "unit id left is used more than once: give each unit its own id"),
    ],
)
def test_what_is_wrong_with_a_skin_is_said_with_unit_and_file(panda_model, tmp_path, text, message):
    path = _file(tmp_path, text)
    with pytest.raises(SkinError, match=message) as caught:
        load_skin(path, panda_model)
    assert str(path) in str(caught.value)


def test_a_file_that_cannot_be_read_is_named(panda_model, tmp_path):
    with pytest.raises(SkinError, match=r"nowhere\.toml cannot be read: No such file"):
        load_skin(tmp_path / "nowhere.toml", panda_model)
    with pytest.raises(SkinError, match="cannot be read: Is a directory"):
        load_skin(tmp_path, panda_model)
    (tmp_path / "latin.toml").write_bytes(b'id = "\xe9"')
    with pytest.raises(SkinError, match=r"latin\.toml is not UTF-8 text: .* at byte 6"):
        load_skin(tmp_path / "latin.toml", panda_model)


@pytest.mark.parametrize("paper", [True, False])
def test_the_fr3_has_the_same_units(panda_model, fr3_model, paper):
    one, other = (sensing_skin.skin_for(model, paper=paper) for model in (panda_model, fr3_model))
    assert one.ids == other.ids
    np.testing.assert_array_equal(one.T_link_sensor, other.T_link_sensor)
    assert [unit.link.replace("fr3", "panda") for unit in other.units] == [unit.link for unit in one.units]


def test_units_of_the_usual_skin_are_not_buried_and_look_off_the_arm(panda_model):
    """Each unit is off the capsules of its link, and atop the circle at most half of its zones show the arm."""
    skin = sensing_skin.skin_for(panda_model)
    assert len(skin.mounted) <= 16
    for unit in skin.mounted:
        below = seat(panda_model, panda_model.link_index(unit.link), unit.T_link_sensor[:3, 3])
        assert 0.004 < below.height < 0.025
    kin = panda_model.kinematics(brought_to(panda_model, (0.5, 0.0, 0.5)))
    of_no_link = placed_sensors(skin.arrays, kin)._replace(link=np.full(len(skin), -1))
    own = expected_range(kin, of_no_link, skin.cones, panda_model.capsules, no_fixtures()) < 0.3
    assert np.add.reduceat(own, skin.first, dtype=np.int64).max() <= 8


def test_another_arm_has_no_skin_yet():
    other = RobotModel(replace(panda(), name="other"))
    with pytest.raises(SkinError, match=r"The arm other comes without a skin: write skin.toml beside .*suggest 8"):
        sensing_skin.paper_skin(other)


# Touch sensors


@pytest.mark.parametrize(
    ("line", "patch"),
    [
        ("", None),
        ("touch = false", None),
        ("touch = true", TouchPatch()),
        ("touch = {}", TouchPatch()),
        ("touch = {radius_m = 0.03}", TouchPatch(radius_m=0.03)),
        ("[unit.touch]\nradius_m = 0.03\nforce_min_n = 1\nmeasures_force = false", TouchPatch(0.03, 1.0, False)),
    ],
)
def test_a_touch_sensor_is_read(panda_model, tmp_path, line, patch):
    skin = load_skin(_file(tmp_path, _entry() + line), panda_model)
    assert skin.units[0].touch == patch
    assert skin.touching.tolist() == ([] if patch is None else [0])
