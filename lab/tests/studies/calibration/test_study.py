import json
from dataclasses import replace

import numpy as np
import pytest
from lab.tests.studies.calibration.motions import short_plan
from scipy.spatial.transform import Rotation

from pretouch.calibration.result import Place
from pretouch.errors import ExperimentError
from pretouch_lab.studies.calibration.errors import NOT_FOUND, place_row
from pretouch_lab.studies.calibration.random_skin import random_skin
from pretouch_lab.studies.calibration.study import OURS, WATANABE, WATANABE_UNBIASED, Study, Trial, study
from pretouch_lab.studies.calibration.table import tables

NONE = np.zeros(3)


def place(unit, shift: list[float], turn: list[float], covariance: np.ndarray) -> Place:
    """An answer that is off the truth by a shift in the link frame [m] and a turn in the sensor frame [rad]."""
    T = unit.T_link_sensor.copy()
    T[:3, :3] = T[:3, :3] @ Rotation.from_rotvec(turn).as_matrix()
    T[:3, 3] += shift
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
    turned = np.kron(np.diag([1.0, 0.0]), np.eye(3)) + np.kron(np.diag([0.0, 1.0]), R)
    there = replace(
        here, link="panda_link7", T_link_sensor=T @ here.T_link_sensor, covariance=turned @ covariance @ turned.T
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


def made_study() -> Study:
    def trial(method: str, motion: str, factor: float, took: float) -> Trial:
        rows = [row("link2", 0.001 * factor), row("link3", 0.003 * factor)]
        return Trial(0, method, motion, rows, took)

    lost = Trial(1, OURS, OURS, [{"skin": 1, "unit": "on_link2", "link": "link2", **NOT_FOUND}, row("link3", 0.002)], 3)
    return Study(
        [trial(OURS, OURS, 1, 1.0), trial(WATANABE, OURS, 10, 2.0), lost, trial(WATANABE, WATANABE, 20, 5.0)],
        {OURS: 60.0, WATANABE: 100.0},
    )


def test_tables_show_each_link_and_each_pair_of_method_and_motion():
    by_link, by_method = tables(made_study())
    assert [line[0] for line in by_link.rows] == ["link2", "link3", "all"]
    assert by_link.rows[0][:3] == ("link2", "1/2", "1.00")
    assert by_link.rows[2][:4] == ("all", "3/4", "2.00", "3.00")
    assert by_link.rows[2][-1] == "1.00"
    assert {line[:4] for line in by_method.rows} == {
        (OURS, OURS, "60", "2.00"),
        (WATANABE, OURS, "60", "20.00"),
        (WATANABE, WATANABE, "100", "40.00"),
    }
    assert "2.0 s a skin" in by_link.note


def test_the_file_holds_our_rows_and_what_they_are_compared_with():
    written = json.loads(json.dumps(made_study().as_json(), allow_nan=False))
    assert written["motion_s"] == 60.0
    assert written["compute_s"] == 2.0
    assert [r["position_error_m"] for r in written["rows"]] == [0.001, 0.003, None, 0.002]
    assert [(c["method"], c["motion"], c["compute_s"]) for c in written["compared"]] == [
        (WATANABE, OURS, 2.0),
        (WATANABE, WATANABE, 5.0),
    ]


def test_no_skins_are_refused(panda_model):
    with pytest.raises(ExperimentError, match="number of skins is 0"):
        study(panda_model, skins=0)


@pytest.mark.slow
def test_a_study_of_one_skin_on_a_short_motion_finds_its_units(panda_model):
    said: list[str] = []
    made = study(
        panda_model,
        1,
        compared=False,
        plan=short_plan(postures=3, swing_s=6.0),
        processes=1,
        progress=lambda: said.append("done"),
    )
    assert said == ["done"]
    assert len(made.rows()) == 7
    assert np.median([r["position_error_m"] for r in made.rows()]) < 0.003
    assert len(tables(made)) == 1


@pytest.mark.slow
def test_of_the_paper_s_skins_ours_find_units_ten_times_better_than_the_baseline(panda_model):
    made = study(panda_model, skins=2, processes=2)

    def median(method: str, motion: str, key: str = "position_error_m") -> float:
        return float(np.median([r[key] for r in made.rows(method, motion)]))

    assert median(OURS, OURS) < 0.003
    assert median(OURS, OURS, "orientation_error_deg") < 0.5
    assert made.motion_s[OURS] <= 90.0
    assert min(median(WATANABE, OURS), median(WATANABE, WATANABE)) > 10 * median(OURS, OURS)
    assert median(WATANABE_UNBIASED, WATANABE) < 0.005
