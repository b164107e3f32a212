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
    slipped,
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


def clipped(data: CalibrationData, unit: str, sensor: str) -> CalibrationData:
    """A sensor's y axis is cut off at a range that nobody declared."""
    values = getattr(unit_of(data, unit).imu, sensor).copy()
    values[:, 1] = np.minimum(values[:, 1], np.quantile(values[:, 1], 0.5))
    return changed(data, unit, **{sensor: values})


def narrow(data: CalibrationData, unit: str, share: float) -> CalibrationData:
    """A gyroscope's full scale is a share of the largest that it measures."""
    return saturated(data, unit, share * float(np.abs(unit_of(data, unit).imu.angular_velocity).max()))


def zeros(data: CalibrationData, unit: str, sensor: str) -> CalibrationData:
    return changed(data, unit, **{sensor: np.zeros((len(unit_of(data, unit).imu.stamp), 3))})


def shaken(data: CalibrationData, unit: str, share: float) -> CalibrationData:
    """A unit on the table, which turns by a share of what the first link does."""
    stamp, rng = unit_of(data, unit).imu.stamp, np.random.default_rng(0)
    turning = np.interp(stamp, data.joints.stamp, np.gradient(data.joints.q[:, 0], data.joints.stamp))
    w = share * turning[:, None] * [0.0, 0.0, 1.0] + 0.002 * rng.standard_normal((len(stamp), 3))
    felt = [0.1, -0.2, 9.8] + 0.015 * rng.standard_normal((len(stamp), 3))
    return changed(data, unit, acceleration=felt, angular_velocity=w)


def fallen(data: CalibrationData, unit: str, at: float) -> CalibrationData:
    return slipped(data, on_the_table(data, unit), unit, at)


LOST, STUCK, TOO_MUCH = ("left_out",), ("stuck",), ("saturated", "unusable")
FAULTS = {
    "none at all": (("too_little",), lambda d, u: thinned(d, u, slice(0)), "It has 0 samples"),
    "few seconds": (("too_little",), lambda d, u: silent(d, u, 3.0, 99.0), "at least 15 s at 48 Hz"),
    "slow": (("too_little",), lambda d, u: thinned(d, u, slice(None, None, 8)), "1170 samples in 45 s"),
    "cut off": (("saturated", "too_little"), lambda d, u: saturated(d, u, 0.3), "Less than 15 s"),
    "many saturated": (TOO_MUCH, lambda d, u: narrow(d, u, 0.6), "out of range"),
    "restarted": (LOST, begun_anew, "42.7% of its samples .* whether the unit restarted"),
    "broken": (LOST, lambda d, u: with_nan(d, u, 2), "50.0% of its samples are not finite"),
    "stuck": (STUCK, lambda d, u: stuck(d, u, "acceleration", 1, 20.0), "accelerometer y .* for 25.0 s"),
    "no acceleration": (STUCK, lambda d, u: zeros(d, u, "acceleration"), "accelerometer x stays at 0"),
    "no rotation": (STUCK, lambda d, u: zeros(d, u, "angular_velocity"), "gyroscope x stays at 0"),
    "range": (STUCK, lambda d, u: clipped(d, u, "acceleration"), "accelerometer y .* ends there, set a larger one"),
    "rates": (STUCK, lambda d, u: clipped(d, u, "angular_velocity"), "gyroscope y .* ends there, set a larger one"),
    "g": (("gravity",), lambda d, u: scaled(d, u, 1 / 9.80665), "look like g: multiply by 9.80665"),
    "degrees": (("gyroscope_scale",), lambda d, u: scaled(d, u, 1.0, np.rad2deg(1.0)), "look like degrees/s"),
    "mirrored": (("mirrored",), lambda d, u: scaled(d, u, 1.0, np.array([1, 1, -1])), "axes are mirrored"),
    "sign": (("scale",), lambda d, u: scaled(d, u, np.array([1, 1, -1])), "accelerometer z .* its sign"),
    "lying": (("no_link",), on_the_table, "fits no link"),
    "shaken": (("wrong_link", "gyroscope_scale"), lambda d, u: shaken(d, u, 0.06), r"measures 0\.060\d times"),
    "backwards": (("no_link",), backwards, "fits no link"),
    "early end": (("unusable",), lambda d, u: silent(d, u, 20.0, 99.0), "it measured nothing or was out of range"),
    "fallen early": (("slipped",), lambda d, u: fallen(d, u, 40.5), "from 40.[345] s after"),
    "fallen late": (("slipped",), lambda d, u: fallen(d, u, 43.5), "from 43.[345] s after"),
    # what can be borne
    "unordered": (LOST, jittered, "1.0% of its samples"),
    "some broken": (LOST, lambda d, u: with_nan(d, u, 20), "5.0% of its samples"),
    "few saturated": (("saturated",), lambda d, u: narrow(d, u, 0.97), "set a larger range"),
    "knocked": (("outliers",), lambda d, u: with_knocks(d, u, 20), "did not move with its link"),
}
BEARABLE = tuple(FAULTS)[-4:]


@pytest.mark.parametrize("case", FAULTS)
def test_what_is_wrong_with_a_unit_is_named_and_refused_or_left_out(panda_model, good, pair, case):
    kinds, fault, words = FAULTS[case]
    link4, hand = calibrate(panda_model, fault(good, LINK4)).units
    assert (hand.accepted, hand.findings) == (True, ())
    assert tuple(finding.kind for finding in link4.findings) == kinds
    assert re.search(words, link4.findings[-1].sentence), link4.findings[-1].sentence
    assert link4.findings[-1].refused == (not link4.accepted) == (case not in BEARABLE)
    if link4.accepted:
        assert np.linalg.norm((link4.place.T_link_sensor - pair.units[0].T_link_sensor)[:3, 3]) < 1e-3


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


def fast_at_first(data: CalibrationData) -> CalibrationData:
    """After ten seconds one joint state in six is left."""
    return cut(data, (data.joints.stamp < 10) | (np.arange(len(data.joints.stamp)) % 6 == 0))


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
    ("fault", "words"),
    [
        (lambda data: without_joints(data, 10.0, 14.0), r"Gaps in the joint states: 1, 4\.01 s in all"),
        (repeated_and_broken, r"564 joint states of 9360 are not finite"),
        # nearly the same stamp: all but the last
        (lambda data: some_late(data, 0.0045), r"82 joint states of 9360 .* stamp"),
        (lambda data: in_pairs(data, 1e-4), r"4680 joint states of 9360 .* stamp"),
        # values given more than once are taken once
        (lambda data: held_for(data, 2), r"4679 joint states of 9360 .* repeat"),
        (lambda data: held_for(data, 8), r"8183 joint states of 9360 .* repeat"),
        # a fast stretch is thinned, not lost
        (fast_at_first, r"1040 joint states of 3293"),
    ],
)
def test_joint_states_that_are_missing_or_wrong_are_named_and_left_out(panda_model, good, pair, fault, words):
    found = calibrate(panda_model, fault(good))
    (finding,) = found.findings
    assert re.match(words, finding.sentence), finding.sentence
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
