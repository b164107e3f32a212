"""Recordings as arms make them: noise and steps of encoders, uneven stamps, lost samples, no velocities."""

import re
from dataclasses import replace

import numpy as np
import pytest
from lab.tests.identification.made import FRICTION, MODEL, USUAL, Made, row, sigmas_off, usual_motion

from pretouch.errors import CalibrationError
from pretouch_lab.identification.arm_file import arm_toml
from pretouch_lab.identification.identify import identify

pytestmark = pytest.mark.slow

MADE = Made()


@pytest.fixture(scope="module")
def fast():
    return usual_motion()


def every(count):
    """Indices of one in so many of the samples of 60 s at 1 kHz."""
    return np.arange(count - 1, 60_000, count)


def encoders(samples, seed=3):
    """White noise of 2e-5 rad, and steps of 1e-5 rad."""
    rng = np.random.default_rng(seed)
    return replace(samples, q=1e-5 * np.round((samples.q + 2e-5 * rng.standard_normal(samples.q.shape)) / 1e-5))


def received(samples, seed=7):
    """Stamps late by up to 2 ms, one in 200 samples lost, and 60 ms of samples every five seconds."""
    rng, count = np.random.default_rng(seed), len(samples.stamp)
    rate = round(1.0 / np.diff(samples.stamp).mean())
    kept = rng.random(count) > 0.005
    for begin in range(4 * rate, count, 5 * rate):
        kept[begin : begin + round(0.06 * rate)] = False
    left = samples.at(kept)
    return replace(left, stamp=left.stamp + rng.uniform(0.0, 0.002, len(left.stamp)))


def hurried(fast, seed=9):
    """States that a busy machine reads: those of 2 to 12 ms ago, some of them twice, stamped when they are read."""
    rng = np.random.default_rng(seed)
    read = np.arange(0.1, 59.9, 0.01) + np.minimum(rng.exponential(0.0015, 5980), 0.009)
    age = np.clip(rng.laplace(0.006, 0.002, len(read)), 0.002, 0.012)
    state = 2 * np.round(np.maximum.accumulate(read - age) / 0.002).astype(int)
    return replace(fast.at(state), stamp=read)


ROUGH = {
    "encoders at 100 Hz": lambda fast: encoders(fast.at(every(10))),
    "encoders at 250 Hz": lambda fast: encoders(fast.at(every(4))),
    "encoders at 1 kHz": encoders,
    "received at 100 Hz": lambda fast: received(encoders(fast.at(every(10)))),
    "read on a busy machine": hurried,
}


@pytest.mark.parametrize("rough", ROUGH)
def test_an_arm_comes_out_of_a_rough_recording(fast, rough):
    found = identify(ROUGH[rough](fast), MODEL, USUAL)
    assert found.seconds > 57.0
    assert found.spans == ()
    assert sigmas_off(found, 0, MADE.offset) < 4.0
    assert np.abs(found.fit.of_joints(found.fit.numbers)[:, 0] - MADE.offset).max() < 0.06
    assert sigmas_off(found, 1, FRICTION) < 4.0
    assert row(found, "ripple_nm").values == pytest.approx(MADE.ripple, abs=0.025)
    assert abs(found.fit.numbers[-2] - MADE.payload) < 4.0 * found.fit.errors[-2]
    assert found.fit.gain == pytest.approx(MADE.gain, rel=0.01)
    assert found.noise.velocity_rad_s == pytest.approx(MADE.velocity_noise, rel=0.02)
    ratio = found.noise.torque_nm / MADE.torque_noise
    assert np.all((ratio > 0.8) & (ratio < (2.5 if "busy" in rough else 1.6 if "received" in rough else 1.2)))


@pytest.mark.parametrize("rough", ["encoders at 100 Hz", "received at 100 Hz", "read on a busy machine"])
def test_without_velocities_too_and_the_noise_stays_as_it_was(fast, rough):
    found = identify(replace(ROUGH[rough](fast), qd=None), MODEL, USUAL)
    assert sigmas_off(found, 0, MADE.offset) < 6.0
    assert np.abs(found.fit.of_joints(found.fit.numbers)[:, 0] - MADE.offset).max() < 0.15
    text = arm_toml(found, MODEL, "x")
    assert "plant.torque_noise_nm" not in text
    assert "torque_noise_nm stays as well" in text


def test_noise_of_positions_is_not_taken_for_noise_of_torques(fast):
    smooth = fast.at(every(10))
    noisy = replace(smooth, q=smooth.q + 1e-4 * np.random.default_rng(1).standard_normal(smooth.q.shape))
    found = identify(noisy, MODEL, USUAL)
    assert found.fit.gain == pytest.approx(MADE.gain, rel=0.01)
    assert found.noise.velocity_rad_s == pytest.approx(MADE.velocity_noise, rel=0.02)
    assert np.all(found.noise.torque_nm < 1.25 * MADE.torque_noise)


@pytest.mark.parametrize("rough", ["encoders at 100 Hz", "received at 100 Hz"])
def test_a_path_of_sharp_corners_is_refused_with_noise_as_well(fast, rough):
    smooth = fast.at(every(10))
    phase = 2 * np.pi * smooth.stamp / 0.6
    edges = 0.06 * np.arcsin(np.sin(phase)) * 2 / np.pi  # the speed turns round by 0.8 rad/s every 0.3 s
    slope = 0.06 * 4 / 0.6 * np.sign(np.cos(phase))
    sharp = replace(smooth, q=smooth.q + edges[:, None], qd=smooth.qd + slope[:, None])
    sharp = received(encoders(sharp)) if "received" in rough else encoders(sharp)
    with pytest.raises(CalibrationError, match=re.escape("changes too often: 0.")):
        identify(sharp, MODEL, USUAL)
