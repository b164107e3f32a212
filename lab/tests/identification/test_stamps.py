from dataclasses import replace

import numpy as np
import pytest

from pretouch_lab.identification.motion import moved
from pretouch_lab.identification.recording import ArmSamples, usable

RATES = np.array([0.7, 0.9, 1.1, 1.3])


def at(time, noise=0.0, seed=1):
    """Four joints along sines, told at these times."""
    rng = np.random.default_rng(seed)
    q, qd = 0.5 * np.sin(RATES * time[:, None]), 0.5 * RATES * np.cos(RATES * time[:, None])
    return ArmSamples(
        time, q + noise * rng.standard_normal(q.shape), qd + 0.008 * rng.standard_normal(q.shape),
        rng.standard_normal(q.shape),
    )  # fmt: skip


TIME = np.arange(0.0, 40.0, 0.01)


def test_stamps_off_by_milliseconds_are_put_right():
    late = np.random.default_rng(2).uniform(0.0, 0.006, len(TIME))
    given = replace(at(TIME, 1e-5), stamp=TIME + late)
    found, motions = moved(usable(given))
    # what they are off for long is of no matter: from one to the next is
    before, after = np.diff(given.stamp - TIME), np.diff(found.samples.stamp - TIME)
    assert before.std() == pytest.approx(np.sqrt(2.0) * late.std(), rel=0.1)
    assert after[50:-50].std() < 0.1 * before.std()
    assert "Stamps are off by 2.1 ms" in " ".join(found.notes)
    assert motions[0].half_s == 0.06


@pytest.mark.parametrize(("noise", "told"), [(0.0, False), (2e-5, False), (1e-4, True), (5e-4, True)])
def test_noise_of_encoders_moves_no_stamp_and_a_wide_fit_is_told(noise, told):
    found, motions = moved(usable(at(TIME, noise)))
    assert np.array_equal(found.samples.stamp, TIME)
    assert (f"fits over {2 * motions[0].half_s:.2g} s" in " ".join(found.notes)) is told


def test_time_that_goes_slow_for_a_while_shows_in_measured_velocities():
    rng = np.random.default_rng(3)
    slow = 0.004 * np.sin(2 * np.pi * 0.8 * TIME)  # 2 % faster and slower
    given = replace(at(TIME), stamp=TIME + slow + rng.uniform(0.0, 0.004, len(TIME)))
    found, motions = moved(usable(given))
    off = given.qd - motions[0].between()(found.samples.stamp, 1)
    blind, without = moved(usable(replace(given, qd=None)))
    worse = given.qd - without[0].between()(blind.samples.stamp, 1)
    inner = slice(100, -100)
    assert off[inner].std() < 0.0084
    assert worse[inner].std() > 0.009


def test_states_that_are_told_again_count_once():
    given = at(TIME)
    again = np.sort(np.append(np.arange(len(TIME)), np.arange(0, len(TIME), 10)))
    twice = given.at(again)
    twice = replace(twice, stamp=twice.stamp + 0.004 * np.append(0.0, np.diff(again) == 0))
    found = usable(twice)
    assert found.samples.stamp == pytest.approx(TIME)
    assert "400 of 4400 samples repeat the one before them" in " ".join(found.notes)


@pytest.mark.parametrize(("missing", "segments"), [(8, 1), (12, 2)])
def test_a_short_gap_is_bridged_and_a_long_one_parts(missing, segments):
    given = at(TIME)
    left = np.delete(np.arange(len(TIME)), np.arange(2000, 2000 + missing))
    found = usable(given.at(left))
    assert len(found.stretches) == segments
    (motion, *_), path = moved(found)[1], 0.5 * RATES * np.cos(RATES * 20.04)
    assert segments == 2 or motion.between()(20.04, 1) == pytest.approx(path, abs=1e-4)


@pytest.mark.parametrize(("rate", "left"), [(250, 250), (255, 255), (500, 250), (1000, 250)])
def test_samples_are_thinned_to_about_250_a_second(rate, left):
    found = usable(at(np.arange(30 * rate) / rate + 1e-5 * np.sin(np.arange(30 * rate))))
    assert len(found.samples.stamp) == 30 * left
