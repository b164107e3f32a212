"""From a calibration to a skin file."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from pretouch.calibration.calibrate import calibrate, skin_of
from pretouch.calibration.findings import moved_out
from pretouch.errors import CalibrationError
from pretouch.sensing.sensor import VL53L5CX
from pretouch.sensing.skin import Skin, load_skin, save_skin
from pretouch.sensing.unit import TouchPatch, seat
from tests.calibration.faulty import on_the_table
from tests.calibration.made import turned


@pytest.fixture(scope="module")
def found(panda_model, good):
    return calibrate(panda_model, good)


def test_a_skin_carries_places_and_their_uncertainties(panda_model, found, pair, tmp_path):
    made = skin_of(found, panda_model)
    assert made.ids == pair.ids
    save_skin(made, tmp_path / "skin.toml")
    for unit, calibrated in zip(load_skin(tmp_path / "skin.toml", panda_model).units, found.units, strict=True):
        assert unit.T_link_sensor == pytest.approx(calibrated.place.T_link_sensor, abs=1e-9)
        assert unit.position_sigma == calibrated.place.position_sigma
        # half a degree either way of how well a board is glued on
        assert unit.orientation_sigma == pytest.approx(np.deg2rad(0.29), rel=0.01)


def test_a_unit_that_is_refused_stays_where_the_skin_had_it_or_is_left_out(panda_model, good, pair):
    found = calibrate(panda_model, on_the_table(good, "on_panda_link4"))
    assert skin_of(found, panda_model).ids == ("on_panda_hand",)
    kept = skin_of(found, panda_model, pair)
    assert kept.ids == pair.ids
    assert kept.units[0] is pair.units[0]
    assert kept.units[1] is not pair.units[1]


def test_a_unit_that_is_calibrated_keeps_its_sensors(panda_model, found, pair):
    first = replace(pair.units[0], touch=TouchPatch(radius_m=0.03), sensor=VL53L5CX())
    made = skin_of(found, panda_model, Skin([first, pair.units[1]], panda_model))
    assert [unit.touch for unit in made.mounted] == [TouchPatch(radius_m=0.03), None]
    assert [unit.sensor.zones for unit in made.mounted] == [4, 1]


def test_units_that_were_not_calibrated_stay(panda_model, found, whole_skin):
    made = skin_of(found, panda_model, whole_skin)
    assert made.ids == whole_skin.ids
    moved = [one.id for one, other in zip(made.units, whole_skin.units, strict=True) if one is not other]
    assert moved == ["on_panda_link4", "on_panda_hand"]


def test_without_any_unit_there_is_no_skin(panda_model, good, pair):
    found = calibrate(panda_model, on_the_table(on_the_table(good, "on_panda_link4"), "on_panda_hand"))
    for keep in (None, pair):
        with pytest.raises(CalibrationError, match="no skin can be made"):
            skin_of(found, panda_model, keep)


def test_a_unit_a_little_inside_its_capsule_is_moved_out_and_less_certain(panda_model, moving_arm, pair):
    true = pair.units[0]
    deep = turned(true, np.zeros(3), -0.011 * true.T_link_sensor[:3, 2])
    found = calibrate(panda_model, moving_arm.data(SimpleNamespace(units=(deep,))))
    (finding,) = found.units[0].findings
    assert (finding.kind, finding.refused) == ("inside", False)
    assert "3.0 mm inside the capsules" in finding.sentence
    (unit,) = skin_of(found, panda_model).units
    assert unit.position_sigma == pytest.approx(0.003, abs=3e-4)
    assert np.linalg.norm(unit.T_link_sensor[:3, 3] - deep.T_link_sensor[:3, 3]) == pytest.approx(0.003, abs=5e-4)


def test_a_unit_deep_inside_its_capsule_is_refused(panda_model, moving_arm, pair):
    true = pair.units[0]
    deep = turned(true, np.zeros(3), -0.04 * true.T_link_sensor[:3, 2])
    (unit,) = calibrate(panda_model, moving_arm.data(SimpleNamespace(units=(deep,)))).units
    assert [(finding.kind, finding.refused) for finding in unit.findings] == [("inside", True)]


def test_points_inside_a_link_are_moved_to_its_surface(panda_model):
    rng = np.random.default_rng(0)
    for link in sorted(set(panda_model.capsules.link.tolist())):
        own = panda_model.capsules.of_links(np.array([link]))
        for _ in range(50):
            k = rng.integers(len(own.radius))
            normal = rng.normal(size=3)
            normal /= np.linalg.norm(normal)
            p = own.a[k] + rng.uniform() * (own.b[k] - own.a[k]) + (own.radius[k] - 0.005) * normal
            out = moved_out(panda_model, link, p)
            if out is not None:
                assert seat(panda_model, link, out).height >= 0
                assert np.linalg.norm(out - p) <= 0.04
