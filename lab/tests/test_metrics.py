import numpy as np
import pytest

from pretouch.traces import mean_over
from pretouch_lab.rows import angle_deg, peak, spread


def test_moving_mean_by_numbers():
    np.testing.assert_allclose(mean_over(np.array([1.0, 2.0, 6.0, 4.0]), 2), [1.5, 4.0, 5.0])


def test_moving_mean_of_less_than_a_window_is_the_mean():
    np.testing.assert_allclose(mean_over(np.array([1.0, 3.0]), 20), [2.0])
    assert mean_over(np.zeros(0), 20).shape == (0,)


def test_the_peak_of_nothing_is_nothing():
    assert peak(np.zeros(0)) == 0.0
    assert peak(np.array([1.0, 7.0, 2.0])) == 7.0


@pytest.mark.parametrize(("b", "angle"), [((2, 0, 0), 0), ((0, 5, 0), 90), ((-1, 0, 0), 180), ((1, 1, 0), 45)])
def test_angles_by_numbers(b, angle):
    assert angle_deg(np.array([1.0, 0.0, 0.0]), np.array(b, float)) == pytest.approx(angle)


def test_there_is_no_angle_to_nothing():
    assert angle_deg(np.zeros(3), np.ones(3)) is None


def test_spread_by_numbers():
    assert spread([float(v) for v in range(11)]) == {"median": 5.0, "p10": 1.0, "p90": 9.0, "n": 11}
    assert spread([]) is None
