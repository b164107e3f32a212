from dataclasses import replace

import numpy as np
import pytest
from tests.calibration.made import turned

from pretouch.calibration.values import Place
from pretouch.errors import ExperimentError
from pretouch.sim.random_skin import random_skin
from pretouch_lab.studies.calibration.errors import NOT_FOUND, place_row
from pretouch_lab.studies.calibration.study import Study, study
from pretouch_lab.studies.calibration.table import by_link

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


def row(link: str, error: float) -> dict:
    return {
        "skin": 0, "unit": f"on_{link}", "link": link, "position_error_m": error, "orientation_error_deg": 0.1,
        "position_sigma_m": 0.001, "orientation_sigma_deg": 0.05, "nees_position": 3.0, "nees_orientation": 3.0,
        "nees_pose": 6.0, "clock_error_s": -0.001, "link_found": True,
    }  # fmt: skip


def test_the_table_shows_each_link_and_all():
    rows = [row("link2", 0.001), row("link3", 0.003), row("link3", 0.002)]
    rows.append({"skin": 1, "unit": "on_link2", "link": "link2", **NOT_FOUND})
    table = by_link(Study(rows, 60.0, 2.0))
    assert [line[0] for line in table.rows] == ["link2", "link3", "all"]
    assert table.rows[0][:3] == ("link2", "1/2", "1.00")
    assert table.rows[2][:4] == ("all", "3/4", "2.00", "3.00")
    assert table.rows[2][-1] == "1.00"
    assert "2.0 s a skin" in table.note


def test_no_skins_are_refused(panda_model):
    with pytest.raises(ExperimentError, match="number of skins is 0"):
        study(panda_model, skins=0)
