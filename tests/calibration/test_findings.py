"""What is wrong with data is recognised and named."""

import re

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from pretouch.calibration.calibrate import calibrate
from pretouch.calibration.checks import checked_joints
from pretouch.calibration.values import Calibration, CalibrationData
from pretouch.errors import CalibrationError
from pretouch.sensing.skin import Skin
from pretouch.traces import JointTrace
from tests.calibration.faulty import (
    changed,
    cut,
    joints,
    kept,
    on_the_table,
    saturated,
    silent,
    stuck,
    swapped,
    traced,
    unit_of,
    with_knocks,
    without_joints,
)  # fmt: skip
from tests.calibration.made import turned

LINK4, HAND = "on_panda_link4", "on_panda_hand"


def scaled(data: CalibrationData, unit: str, acceleration=1.0, angular_velocity=1.0) -> CalibrationData:
    imu = unit_of(data, unit).imu
    felt, turning = imu.acceleration * acceleration, imu.angular_velocity * angular_velocity
    return changed(data, unit, acceleration=felt, angular_velocity=turning)


def with_nan(data: CalibrationData, unit: str, every: int) -> CalibrationData:
    felt = unit_of(data, unit).imu.acceleration.copy()
    felt[::every] = np.nan
    return changed(data, unit, acceleration=felt)


def begun_anew(data: CalibrationData, unit: str) -> CalibrationData:
    stamp = unit_of(data, unit).imu.stamp.copy()
    stamp[4000:] -= stamp[4000]
    return changed(data, unit, stamp=stamp)


def jittered(data: CalibrationData, unit: str) -> CalibrationData:
    stamp = unit_of(data, unit).imu.stamp.copy()
    stamp[10::100] = stamp[9::100][: len(stamp[10::100])]
    return changed(data, unit, stamp=stamp)


def thinned(data: CalibrationData, unit: str, which: slice) -> CalibrationData:
    return traced(data, unit, kept(unit_of(data, unit).imu, which))


def backwards(data: CalibrationData, unit: str) -> CalibrationData:
    imu = unit_of(data, unit).imu
    return changed(data, unit, acceleration=imu.acceleration[::-1], angular_velocity=imu.angular_velocity[::-1])


REFUSED = {
    "none at all": ("too_little", lambda data, unit: thinned(data, unit, slice(0)), "It has 0 samples"),
    "few seconds": ("too_little", lambda data, unit: silent(data, unit, 3.0, 99.0), "at least 15 s at 48 Hz"),
    "slow": ("too_little", lambda data, unit: thinned(data, unit, slice(None, None, 8)), "1170 samples in 45 s"),
    "cut off": ("too_little", lambda data, unit: saturated(data, unit, angular_velocity_max=0.3), "Less than 15 s"),
    "restarted": ("left_out", begun_anew, "42.7% of its samples .* whether the unit restarted"),
    "broken": ("left_out", lambda data, unit: with_nan(data, unit, 2), "50.0% of its samples are not finite"),
    "stuck": ("stuck", lambda data, unit: stuck(data, unit, "acceleration", 1, 20.0), "accelerometer y .* for 25.0 s"),
    "g": ("gravity", lambda data, unit: scaled(data, unit, 1 / 9.80665), "look like g: multiply by 9.80665"),
    "degrees": ("gyroscope_scale", lambda data, unit: scaled(data, unit, 1.0, np.rad2deg(1.0)), "look like degrees/s"),
    "mirrored": ("mirrored", lambda data, unit: scaled(data, unit, 1.0, np.array([1, 1, -1])), "axes are mirrored"),
    "sign": ("scale", lambda data, unit: scaled(data, unit, np.array([1, 1, -1])), "accelerometer z .* its sign"),
    "lying": ("no_link", on_the_table, "fits no link"),
    "backwards": ("no_link", backwards, "fits no link"),
    "early end": (
        "unusable",
        lambda data, unit: silent(data, unit, 20.0, 99.0),
        "it measured nothing or was out of range",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_unit_whose_data_cannot_be_trusted_is_refused_with_the_reason(panda_model, good, case):
    kind, fault, words = REFUSED[case]
    found = {unit.id: unit for unit in calibrate(panda_model, fault(good, LINK4)).units}
    assert not found[LINK4].accepted
    assert found[HAND].accepted
    assert found[HAND].findings == ()
    (finding,) = [one for one in found[LINK4].findings if one.kind == kind]
    assert finding.refused
    assert re.search(words, finding.sentence), finding.sentence


BEARABLE = {
    "unordered": ("left_out", jittered, "1.0% of its samples"),
    "broken": ("left_out", lambda data, unit: with_nan(data, unit, 20), "5.0% of its samples"),
    "knocked": ("outliers", lambda data, unit: with_knocks(data, unit, 20), "did not move with its link"),
}


@pytest.mark.parametrize("case", BEARABLE)
def test_what_can_be_borne_is_named_and_the_place_is_still_found(panda_model, good, pair, case):
    kind, fault, words = BEARABLE[case]
    unit = calibrate(panda_model, fault(good, LINK4)).units[0]
    assert unit.accepted
    (finding,) = unit.findings
    assert finding.kind == kind
    assert words in finding.sentence
    assert np.linalg.norm(unit.place.T_link_sensor[:3, 3] - pair.units[0].T_link_sensor[:3, 3]) < 1e-3


@pytest.mark.parametrize("sensor", ["acceleration", "angular_velocity"])
def test_a_sensor_that_gives_zeros_is_named_once(panda_model, good, sensor):
    zeros = np.zeros((len(unit_of(good, LINK4).imu.stamp), 3))
    unit = calibrate(panda_model, changed(good, LINK4, **{sensor: zeros})).units[0]
    assert [finding.kind for finding in unit.findings] == ["stuck"]


def test_few_saturated_samples_are_left_out_and_many_refuse(panda_model, good, pair):
    peak = np.abs(unit_of(good, HAND).imu.angular_velocity).max()
    few = calibrate(panda_model, saturated(good, HAND, angular_velocity_max=0.97 * peak)).units[1]
    assert few.accepted
    assert [finding.kind for finding in few.findings] == ["saturated"]
    assert "set a larger range" in few.findings[0].sentence
    assert np.linalg.norm(few.place.T_link_sensor[:3, 3] - pair.units[1].T_link_sensor[:3, 3]) < 1e-3
    many = calibrate(panda_model, saturated(good, HAND, angular_velocity_max=0.6 * peak)).units[1]
    assert not many.accepted


def test_of_swapped_units_each_is_told_which_link_its_data_fit(panda_model, good):
    link4, hand = calibrate(panda_model, swapped(good, LINK4, HAND)).units
    for unit, said, link in ((link4, "panda_link4", "panda_hand"), (hand, "panda_hand", "panda_link4")):
        assert (unit.findings[0].kind, unit.findings[0].refused) == ("wrong_link", True)
        assert f"It is said to sit on {said}, but its data fit " in unit.findings[0].sentence
        assert link in unit.findings[0].sentence
        assert not unit.accepted
    assert hand.place.link == "panda_link4"


def test_a_clock_that_is_off_by_more_than_expected_is_measured(panda_model, good):
    for unit in calibrate(panda_model, joints(good, stamp=good.joints.stamp + 12.0)).units:
        (finding,) = unit.findings
        assert finding.kind == "clock"
        assert finding.refused
        assert unit.place.clock_offset == pytest.approx(-12.0, abs=0.05)


def test_a_board_that_is_mounted_upside_down_is_refused(panda_model, moving_arm, pair):
    unit = turned(pair.units[0], np.array([np.pi, 0.0, 0.0]), np.zeros(3))
    (finding,) = calibrate(panda_model, moving_arm.data(Skin([unit], panda_model))).units[0].findings
    assert (finding.kind, finding.refused) == ("inwards", True)


def errors(found: Calibration, skin: Skin) -> np.ndarray:
    """Errors of the positions [m]."""
    pairs = zip(found.units, skin.units, strict=True)
    return np.array([np.linalg.norm((unit.place.T_link_sensor - true.T_link_sensor)[:3, 3]) for unit, true in pairs])


def repeated_and_broken(data: CalibrationData) -> CalibrationData:
    stamp, q = data.joints.stamp.copy(), data.joints.q.copy()
    stamp[5::50], q[7::50] = stamp[4::50], np.nan
    return joints(data, stamp=stamp, q=q)


def some_late(data: CalibrationData, late: float) -> CalibrationData:
    """One in a hundred joint states is stamped late [s], but no later than the next one."""
    stamp = data.joints.stamp
    chosen = np.random.default_rng(0).random(len(stamp)) < 0.01
    return joints(data, stamp=np.maximum.accumulate(stamp + late * chosen))


def in_pairs(data: CalibrationData, apart: float) -> CalibrationData:
    """Joint states come two at a time, stamped on receipt [s]."""
    stamp = data.joints.stamp.copy()
    stamp[:-1:2] = stamp[1::2][: len(stamp[:-1:2])] - apart
    return joints(data, stamp=stamp)


def held_for(data: CalibrationData, states: int) -> CalibrationData:
    """Joint positions are read anew for one in so many states only."""
    return joints(data, q=data.joints.q[np.arange(len(data.joints.q)) // states * states])


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        (lambda data: joints(data, q=data.joints.q[:, :6]), "of the 7 joints of panda"),
        (lambda data: joints(data, stamp=data.joints.stamp[::-1]), "go back"),
        (lambda data: joints(data, q=np.rad2deg(data.joints.q)), "give radians"),
        (lambda data: joints(data, q=np.tile(data.joints.q[0], (len(data.joints.q), 1))), "did not move"),
        (lambda data: cut(data, slice(0, 0)), "0 joint states in 0 s"),
        (lambda data: cut(data, slice(0, 400)), "make up 1.92 s"),
        (lambda data: cut(data, slice(None, None, 20)), "at least 15 s at 25 Hz"),
        (lambda data: held_for(data, 20), "at least 15 s at 25 Hz"),
        (lambda data: without_joints(data, 2.0, 42.0), "s without gaps"),
        (lambda data: joints(data, stamp=data.joints.stamp + 1e6 * (data.joints.stamp > 20)), "on one clock"),
    ],
)  # fmt: skip
def test_joints_that_nothing_can_be_made_from_are_an_error_with_the_reason(panda_model, good, fault, words):
    with pytest.raises(CalibrationError, match=words):
        calibrate(panda_model, fault(good))


@pytest.mark.parametrize(
    ("fault", "kind", "words"),
    [
        (lambda data: without_joints(data, 10.0, 14.0), "joints_missing", r".* 4\.01 s in all"),
        (repeated_and_broken, "joints_left_out", ""),
        # nearly the same stamp: all but the last
        (lambda data: some_late(data, 0.0045), "joints_left_out", r"\d\d joint states of \d+ .* stamp"),
        (lambda data: in_pairs(data, 1e-4), "joints_left_out", r"\d{4} joint states of \d+ .* stamp"),
    ],
)
def test_joint_states_that_are_missing_or_wrong_are_named_and_left_out(panda_model, good, pair, fault, kind, words):
    found = calibrate(panda_model, fault(good))
    (finding,) = found.findings
    assert finding.kind == kind
    assert re.match(words, finding.sentence), finding.sentence
    assert all(unit.accepted for unit in found.units)
    assert errors(found, pair).max() < 1e-3


def test_a_fast_stretch_of_joint_states_is_thinned_not_lost(panda_model, good, pair):
    keep = (good.joints.stamp < 10) | (np.arange(len(good.joints.stamp)) % 6 == 0)
    found = calibrate(panda_model, cut(good, keep))
    assert all(unit.accepted for unit in found.units)
    assert not [finding for finding in found.findings if finding.kind == "joints_missing"]
    assert errors(found, pair).max() < 1e-3


@pytest.mark.parametrize("states", [2, 4, 8])
def test_joint_values_given_more_than_once_are_named_and_taken_once(panda_model, good, pair, states):
    found = calibrate(panda_model, held_for(good, states))
    (finding,) = found.findings
    assert finding.kind == "joints_left_out"
    assert int(finding.sentence.split()[0]) == pytest.approx(len(good.joints.stamp) * (1 - 1 / states), abs=states)
    assert all(unit.accepted for unit in found.units)
    assert errors(found, pair).max() < 1e-3


def test_an_arm_that_stands_repeats_its_values_for_good_reason(panda_model, good):
    q = good.joints.q.copy()
    q[4000:4400] = q[4000]
    joints_then, findings = checked_joints(panda_model, JointTrace(good.joints.stamp, q))
    assert findings == ()
    assert len(joints_then.stamp) == len(q)


@pytest.mark.parametrize("jitter", [0.0, 0.1])
def test_joint_states_at_the_least_rate_will_do_and_below_it_the_rate_is_named(panda_model, good, pair, jitter):
    was, rng = good.joints, np.random.default_rng(0)
    exact = CubicSpline(was.stamp, was.q)

    def at(rate: float) -> CalibrationData:
        stamp = np.arange(0.5, was.stamp[-1] - 0.5, 1 / rate)
        stamp += jitter / rate * rng.uniform(-1, 1, len(stamp))
        return joints(good, stamp=stamp, q=exact(stamp))

    assert errors(calibrate(panda_model, at(25.0)), pair).max() < 1e-3
    with pytest.raises(CalibrationError, match="at least 15 s at 25 Hz"):
        calibrate(panda_model, at(20.5))


@pytest.mark.parametrize(("sensor", "axis"), [("acceleration", "accelerometer"), ("angular_velocity", "gyroscope")])
def test_an_axis_that_is_cut_off_at_a_range_nobody_declared_is_refused(panda_model, good, sensor, axis):
    cut_off = getattr(unit_of(good, LINK4).imu, sensor).copy()
    cut_off[:, 1] = np.minimum(cut_off[:, 1], np.quantile(cut_off[:, 1], 0.5))
    unit = calibrate(panda_model, changed(good, LINK4, **{sensor: cut_off})).units[0]
    (finding,) = unit.findings
    assert (finding.kind, finding.refused) == ("stuck", True)
    assert f"{axis} y stays at " in finding.sentence
    assert "if its range ends there, set a larger one" in finding.sentence
