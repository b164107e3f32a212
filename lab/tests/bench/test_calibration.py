import json
from dataclasses import replace

import numpy as np
import pytest
from tests.calibration.made import turned

from pretouch import cli
from pretouch.calibration.values import Place
from pretouch.sim.random_skin import random_skin
from pretouch_lab.bench.calibration import NOT_FOUND, place_row, tables

NONE = np.zeros(3)


def place(unit, shift: list[float], turn: list[float], covariance: np.ndarray) -> Place:
    """An answer that is off the truth by a shift in the link frame [m] and a turn in the sensor frame [rad]."""
    T = turned(unit, np.array(turn), np.array(shift)).T_link_sensor
    return Place(unit.link, T, covariance, NONE, NONE, NONE, NONE, 0.012, 0.1, 0.01, 1.0)


def test_a_row_tells_error_sigma_and_the_error_over_its_covariance(panda_model):
    unit = random_skin(panda_model, 0).units[2]
    covariance = np.diag([0.01, 0.01, 0.01, 0.002, 0.001, 0.001]) ** 2
    row = place_row(panda_model, unit, place(unit, [0.004, 0.0, 0.0], [0.0, 0.03, 0.0], covariance), late=0.01)
    assert row["position_error_m"] == pytest.approx(0.004)
    assert row["orientation_error_deg"] == pytest.approx(np.degrees(0.03))
    assert row["position_sigma_m"] == pytest.approx(0.002)
    assert row["orientation_sigma_deg"] == pytest.approx(np.degrees(0.01))
    assert row["nees_position"] == pytest.approx(4.0)
    assert row["nees_orientation"] == pytest.approx(9.0)
    assert row["nees_pose"] == pytest.approx(13.0)
    assert row["clock_error_s"] == pytest.approx(0.002)
    assert row["link_found"] is True


def test_a_place_on_a_link_fixed_to_the_true_one_is_as_good(panda_model):
    unit = random_skin(panda_model, 0).units[-1]
    assert unit.link == "panda_hand"
    kin = panda_model.kinematics(np.linspace(-1.0, -0.5, 7))
    hand, last = (panda_model.link_index(name) for name in ("panda_hand", "panda_link7"))
    R = kin.rotation[last].T @ kin.rotation[hand]
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = R, kin.rotation[last].T @ (kin.position[hand] - kin.position[last])
    covariance = np.diag([0.01, 0.01, 0.01, 0.002, 0.001, 0.001]) ** 2
    here = place(unit, [0.004, 0.0, 0.0], [0.0, 0.03, 0.0], covariance)
    rotated = np.kron(np.diag([1.0, 0.0]), np.eye(3)) + np.kron(np.diag([0.0, 1.0]), R)
    there = replace(
        here, link="panda_link7", T_link_sensor=T @ here.T_link_sensor, covariance=rotated @ covariance @ rotated.T
    )
    assert place_row(panda_model, unit, there, 0.01) == pytest.approx(place_row(panda_model, unit, here, 0.01))


def test_a_place_on_another_link_is_none(panda_model):
    unit = random_skin(panda_model, 0).units[0]
    wrong = replace(place(unit, [0.0] * 3, [0.0] * 3, np.eye(6)), link="panda_link4")
    assert place_row(panda_model, unit, wrong, 0.0) == NOT_FOUND


def unit_row(link: str, error: float) -> dict:
    return {
        "unit": f"on_{link}", "link": link, "position_error_m": error, "orientation_error_deg": 0.1,
        "position_sigma_m": 0.001, "orientation_sigma_deg": 0.05, "nees_position": 3.0, "nees_orientation": 3.0,
        "nees_pose": 6.0, "clock_error_s": -0.001, "link_found": True,
    }  # fmt: skip


def test_the_table_shows_each_link_and_all():
    first = [unit_row("link2", 0.001), unit_row("link3", 0.003)]
    second = [unit_row("link3", 0.002), {"unit": "on_link2", "link": "link2", **NOT_FOUND}]
    (table,) = tables([{"units": units, "compute_s": 2.0} for units in (first, second)], 60.0)
    assert [line[0] for line in table.rows] == ["link2", "link3", "all"]
    assert table.rows[0][:3] == ("link2", "1/2", "1.00")
    assert table.rows[2][:4] == ("all", "3/4", "2.00", "3.00")
    assert table.rows[2][-1] == "1.00"
    assert "2.0 s a skin" in table.note


@pytest.mark.slow
def test_two_skins_are_found_to_a_millimetre(tmp_path):
    place = tmp_path / "rows.json"
    words = ["--skins", "2", "--find-links", "--swing-s", "9", "--out", str(tmp_path / "out"), "--json", str(place)]
    assert cli.main(["bench", "calibration", *words]) == 0
    told = json.loads(place.read_text())
    assert [row["seed"] for row in told["rows"]] == [0, 1]
    assert told["motion_s"] < 55.0
    for unit in (unit for row in told["rows"] for unit in row["units"]):
        assert unit["position_error_m"] < 0.001
        assert unit["orientation_error_deg"] < 0.1
