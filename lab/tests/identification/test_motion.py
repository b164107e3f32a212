import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pretouch_lab.identification.motion import HALVES_S, local_cubic, motions_of, position_noise


def uneven(seed, seconds=4.0):
    """Stamps at about 100 Hz, 0.1 to 20 ms apart, some lost, one gap of 60 ms."""
    rng = np.random.default_rng(seed)
    stamps = np.cumsum(rng.uniform(1e-4, 0.02, round(100 * seconds)))
    stamps = stamps[rng.random(len(stamps)) > 0.02]
    return stamps[(stamps < 1.0) | (stamps > 1.06)]


@settings(deadline=None, max_examples=25)
@given(st.lists(st.floats(-2.0, 2.0), min_size=4, max_size=4), st.integers(0, 1000), st.sampled_from((0.02, *HALVES_S)))
def test_a_cubic_comes_out_as_it_is_whatever_the_stamps(numbers, seed, half):
    stamps = uneven(seed)
    cubic = np.polynomial.Polynomial(numbers)
    at = np.arange(0.1, 3.5, 0.01)
    (place, speed, growth), _ = local_cubic(stamps, cubic(stamps)[:, None], at, half)
    assert place[:, 0] == pytest.approx(cubic(at), abs=1e-6)
    assert speed[:, 0] == pytest.approx(cubic.deriv()(at), abs=1e-4)
    assert growth[:, 0] == pytest.approx(cubic.deriv(2)(at), abs=1e-2)


def test_the_noise_of_each_estimate_is_what_is_told():
    stamps, at = uneven(3), np.arange(0.05, 3.0, 0.05)
    noise = np.random.default_rng(4).standard_normal((len(stamps), 4000))
    estimates, told = local_cubic(stamps, noise, at, 0.09)
    for derivative in range(3):
        assert estimates[derivative].std(axis=1) == pytest.approx(told[:, derivative], rel=0.06)


def test_the_positions_noise_comes_out_of_a_motion():
    stamps = uneven(5, 40.0)
    noise = np.array([2e-5, 1e-4, 5e-4])
    q = 0.5 * np.sin(stamps[:, None] * [1.0, 1.5, 2.0])
    q = q + noise * np.random.default_rng(6).standard_normal(q.shape)
    assert position_noise([stamps], [q], HALVES_S[0]) == pytest.approx(noise, rel=0.1, abs=2e-6)


@pytest.mark.parametrize(("rate", "noise"), [(100, 0.0), (100, 1e-4), (250, 1e-4), (1000, 1e-4), (100, 5e-4)])
def test_a_smooth_motion_is_not_quick_and_its_speed_as_sure_as_told(rate, noise):
    stamps = np.arange(20 * rate) / rate
    phase = stamps[:, None] * [1.0, 2.0]
    q = 0.5 * np.sin(phase) + noise * np.random.default_rng(7).standard_normal((len(stamps), 2))
    (motion,) = motions_of([stamps], [q])
    inner = slice(30, -30)
    assert not motion.quick[inner].any()
    off = motion.qd[inner] - 0.5 * np.array([1.0, 2.0]) * np.cos(motion.at[inner, None] * [1.0, 2.0])
    assert off.std(axis=0) == pytest.approx(motion.speed_noise, rel=0.25, abs=1e-4)


@pytest.mark.parametrize("noise", [0.0, 2e-5, 1e-4])
@pytest.mark.parametrize("jump", [0.3, 0.8])
def test_a_corner_is_quick_and_little_else(noise, jump):
    stamps = np.arange(0.0, 20.0, 0.01)
    q = 0.3 * np.sin(stamps) + jump * np.maximum(stamps - 10.0, 0.0)
    (motion,) = motions_of([stamps], [(q + noise * np.random.default_rng(8).standard_normal(len(q)))[:, None]])
    near = np.abs(motion.at - 10.0) < 0.02
    far = np.abs(motion.at - 10.0) > motion.half_s + 0.02
    assert motion.quick[near].any()
    assert not motion.quick[far & (motion.at > 0.1) & (motion.at < 19.9)].any()
