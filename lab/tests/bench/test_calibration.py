import json
from dataclasses import replace

import numpy as np
import pytest
from tests.calibrated_arm import swinging
from tests.calibration.made import MovingArm, turned

from pretouch import cli
from pretouch.calibration.motion.plan import Plan
from pretouch.calibration.values import Place
from pretouch.errors import ExperimentError
from pretouch.sim.imu import ImuParams
from pretouch.sim.random_skin import random_skin
from pretouch_lab.bench.calibration import NOT_FOUND, clock_errors, place_row, simulate, tables

NONE = np.zeros(3)
START = np.array([0.0, -0.4, 0.0, -2.0, 0.0, 1.8, 0.6])
STILL = Plan(np.array([0.0, 1.0]), np.array([START, START]))
EXACT = ImuParams(
    rate_error=0.0, scale_error=0.0, misalignment_deg=0.0, acceleration_bias_mg=0.0, angular_rate_bias_dps=0.0,
    acceleration_noise_ug=0.0, angular_rate_noise_mdps=0.0,
)  # fmt: skip


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


def test_a_place_on_a_link_fixed_to_the_true_one_is_as_good_and_on_another_is_none(panda_model):
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
    assert place_row(panda_model, unit, replace(here, link="panda_link4"), 0.01) == NOT_FOUND


def unit_row(link: str, error: float) -> dict:
    return dict.fromkeys(NOT_FOUND, -0.001) | {"link": link, "position_error_m": error, "link_found": True}


def test_the_table_shows_each_link_and_all():
    first = [unit_row("link2", 0.001), unit_row("link3", 0.003)]
    second = [unit_row("link3", 0.002), {"link": "link2", **NOT_FOUND}]
    (table,) = tables([{"units": units, "compute_s": 2.0} for units in (first, second)], 60.0)
    assert [line[0] for line in table.rows] == ["link2", "link3", "all"]
    assert table.rows[0][:3] == ("link2", "1/2", "1.00")
    assert table.rows[2][:4] == ("all", "3/4", "2.00", "3.00")
    assert table.rows[2][-1] == "1.00"
    assert "2.0 s a skin" in table.note


@pytest.fixture(scope="module")
def skin(panda_model):
    return random_skin(panda_model, 0)


class Planned(MovingArm):
    """An arm that follows a plan exactly."""

    def _at(self, time):
        return np.array([swinging(self.model, 5.0).at(t)[0] for t in time])


def test_units_measure_what_the_plan_does_at_the_same_instants(panda_model, skin):
    plan, ideal = swinging(panda_model, 5.0), Planned(panda_model, 5.0)
    data = simulate(panda_model, skin, plan, 0, EXACT, clock_error_s=0.0)
    swings = (ideal.time > 1.5) & (ideal.time < 3.5)
    for unit, sensed in zip(skin.units, data.units, strict=True):
        expected, at = ideal.imu(unit), ideal.time[swings]
        for name, tolerance in (("acceleration", 0.3), ("angular_velocity", 0.015)):
            measured = [np.interp(at, sensed.imu.stamp, axis) for axis in getattr(sensed.imu, name).T]
            off = np.array(measured).T - getattr(expected, name)[swings]
            assert np.sqrt(np.mean(off**2)) < tolerance  # the arm follows the plan to some milliseconds
    planned = np.array([plan.at(time)[0] for time in data.joints.stamp])
    assert np.abs(planned - data.joints.q).max() < 0.02


def test_each_units_stamps_are_late_by_its_own_clock_and_full_scales_are_those_of_sixteen_bits(panda_model, skin):
    right = simulate(panda_model, skin, STILL, 3, clock_error_s=0.0, links_known=False)
    wrong = simulate(panda_model, skin, STILL, 3)
    late = clock_errors(len(skin), 3)
    assert np.ptp(late) > 0.01
    assert np.abs(late).max() <= 0.02
    for k in range(len(skin)):
        assert wrong.units[k].imu.stamp - right.units[k].imu.stamp == pytest.approx(late[k])
        assert np.array_equal(wrong.units[k].imu.acceleration, right.units[k].imu.acceleration)
    assert [unit.acceleration_max for unit in right.units] == pytest.approx([4 * 9.80665] * len(skin), rel=1e-3)
    assert right.units[0].angular_velocity_max == pytest.approx(np.deg2rad(32767 * 0.0175))
    assert {unit.link for unit in right.units} == {None}


def test_a_plan_the_arm_cannot_follow_is_said_to_be_so(panda_model, skin):
    jump = Plan(np.array([0.0, 0.05]), np.array([START, START + 0.8]))
    with pytest.raises(ExperimentError, match=r"did not follow the plan to its end. The arm has left the plan"):
        simulate(panda_model, skin, jump, 0)


@pytest.mark.slow
def test_two_skins_are_found_to_a_millimetre(tmp_path):
    place = tmp_path / "rows.json"
    words = ["--skins", "2", "--find-links", "--swing-s", "9", "--out", str(tmp_path / "out"), "--json", str(place)]
    assert cli.main(["bench", "calibration", *words]) == 0
    numbers = json.loads(place.read_text())
    assert [row["seed"] for row in numbers["rows"]] == [0, 1]
    assert numbers["motion_s"] < 55.0
    for unit in (unit for row in numbers["rows"] for unit in row["units"]):
        assert unit["position_error_m"] < 0.001
        assert unit["orientation_error_deg"] < 0.1
