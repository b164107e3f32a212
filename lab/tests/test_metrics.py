import numpy as np
import pytest

from pretouch.traces import mean_over
from pretouch_lab.rows import angle_deg, peak, spread


@pytest.mark.parametrize(
    ("values", "count", "means"), [([1.0, 2.0, 6.0, 4.0], 2, [1.5, 4.0, 5.0]), ([1.0, 3.0], 20, [2.0]), ([], 20, [])]
)
def test_a_moving_mean_by_numbers_is_the_mean_of_less_than_a_window(values, count, means):
    np.testing.assert_allclose(mean_over(np.array(values), count), means)


@pytest.mark.parametrize(
    ("b", "angle"), [((2, 0, 0), 0), ((0, 5, 0), 90), ((-1, 0, 0), 180), ((1, 1, 0), 45), ((0, 0, 0), None)]
)
def test_angles_by_numbers_and_none_to_nothing(b, angle):
    assert angle_deg(np.array([1.0, 0.0, 0.0]), np.array(b, float)) == pytest.approx(angle)


def test_peak_and_spread_by_numbers_and_of_nothing():
    assert (peak(np.zeros(0)), peak(np.array([1.0, 7.0, 2.0]))) == (0.0, 7.0)
    assert spread([float(v) for v in range(11)]) == {"median": 5.0, "p10": 1.0, "p90": 9.0, "n": 11}
    assert spread([]) is None
