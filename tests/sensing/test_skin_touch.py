"""Touch sensors in a skin file."""

import tomllib
from dataclasses import replace

import numpy as np
import pytest

from pretouch.errors import SkinError
from pretouch.sensing.skin import PAPER_SKIN, Skin, load_skin, save_skin
from pretouch.sensing.unit import TouchPatch

UNIT = """
[[unit]]
id = "a"
link = "panda_link5"
position_m = [0.0, 0.1, -0.2]
quaternion_wxyz = [1.0, 0.0, 0.0, 0.0]
"""


def written(tmp_path, touch: str):
    file = tmp_path / "skin.toml"
    file.write_text(UNIT + touch)
    return file


@pytest.mark.parametrize(
    ("line", "patch"),
    [
        ("", None),
        ("touch = false", None),
        ("touch = true", TouchPatch()),
        ("touch = {}", TouchPatch()),
        ("touch = {radius_m = 0.03}", TouchPatch(radius=0.03)),
        ("[unit.touch]\nradius_m = 0.03\nforce_min_n = 1\nmeasures_force = false", TouchPatch(0.03, 1.0, False)),
    ],
)
def test_a_touch_sensor_is_read(panda_model, tmp_path, line, patch):
    skin = load_skin(written(tmp_path, line), panda_model)
    assert skin.units[0].touch == patch
    assert skin.touching.tolist() == ([] if patch is None else [0])


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ('touch = "yes"', "Unit a: touch is 'yes': write true, or a table of radius_m, force_min_n, measures_force"),
        ("touch = {radius = 0.03}", "Unit a: touch has the unknown key 'radius': use radius_m"),
        ("touch = {radius_m = 0.0}", "Unit a: The radius of a touch patch is 0.0: give more than 0, at most 0.2 m"),
        ("touch = {radius_m = nan}", "The radius of a touch patch is nan"),
        ("touch = {radius_m = 20}", "The radius of a touch patch is 20"),
        ("touch = {force_min_n = true}", "The force_min of a touch patch is True"),
        ('touch = {measures_force = "no"}', "measures_force of a touch patch is 'no': give true or false"),
    ],
)
def test_what_is_wrong_with_a_touch_sensor_is_said(panda_model, tmp_path, line, message):
    with pytest.raises(SkinError, match=r"skin\.toml") as caught:
        load_skin(written(tmp_path, line), panda_model)
    assert message in str(caught.value)


def test_touch_sensors_are_written_and_read_back(panda_model, paper_skin, tmp_path):
    patches = [None, TouchPatch(), TouchPatch(0.05, 2.0, False), *[None] * 4]
    units = [replace(u, touch=p) for u, p in zip(paper_skin.units, patches, strict=True)]
    save_skin(Skin(units, panda_model), tmp_path / "a.toml")
    made = load_skin(tmp_path / "a.toml", panda_model)
    assert [u.touch for u in made.units] == patches
    assert made.touching.tolist() == [1, 2]
    assert "touch = true" in (tmp_path / "a.toml").read_text()


def test_a_file_without_touch_says_nothing_of_it(panda_model, tmp_path):
    save_skin(load_skin(PAPER_SKIN, panda_model), tmp_path / "saved.toml")
    units = tomllib.loads((tmp_path / "saved.toml").read_text())["unit"]
    assert [list(unit) for unit in units] == [["id", "link", "position_m", "quaternion_wxyz"]] * 7


def test_nobody_else_sees_the_touch_of_a_skin_without(paper_skin):
    assert paper_skin.touching.dtype == np.int64
    assert len(paper_skin.touching) == 0
