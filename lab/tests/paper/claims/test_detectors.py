import numpy as np
import pytest

from pretouch.contact.moving_thresholds import MovingThresholds
from pretouch.contact.window import add_force, window_init
from pretouch.types import Obstacles
from pretouch_lab.paper.claims import detectors
from pretouch_lab.paper.claims.detectors import TABLE_I, WINDOW, Windowed, dispersion_of, rate_bounds

NEAR = np.vstack([np.eye(3), -np.eye(3)]) * TABLE_I.d_min_m


def course(force=None, filtered=None, sigma=0.0):
    """Samples along x about a mean of 1 N on each axis; `force` and `filtered` are what x is above it."""
    deviations = [np.zeros_like(filtered if force is None else force) if d is None else d for d in (force, filtered)]
    samples = [np.ones((len(d), 3)) + np.outer(d, [1.0, 0.0, 0.0]) for d in deviations]
    return Windowed(*samples, mean=np.ones_like(samples[0]), sigma=np.full_like(samples[0], sigma))


def obstacles(points):
    n = len(points)
    return Obstacles(
        unit=np.arange(n),
        point=points,
        ee_distance=np.linalg.norm(points, axis=1),
        body_point=np.zeros((n, 3)),
        link=np.zeros(n, np.int64),
        direction=np.zeros((n, 3)),
        body_distance=np.zeros(n),
        closing_speed=np.zeros(n),
    )


@pytest.mark.parametrize(
    ("detector", "params"), [(detectors.filtered, MovingThresholds()), (detectors.raw, MovingThresholds(compare="raw"))]
)
@pytest.mark.parametrize(("points", "f_obs"), [(np.zeros((0, 3)), 0.0), (NEAR, TABLE_I.f_d_n)])
def test_a_course_is_judged_as_the_controller_judges_it(detector, params, points, f_obs):
    rng = np.random.default_rng([100, 40])
    force = 2.0 * rng.standard_normal((600, 3)) + [1.0, -2.0, 4.0]
    force[300:330, 1] += 25.0
    force[450:454, 2] -= 40.0
    window, felt = window_init(WINDOW.samples), []
    for sample in force:
        armed, window = window.full, add_force(window, sample, WINDOW)
        detection = params.judged(window, sample, armed, np.zeros(3), obstacles(points))
        felt.append(detection.contact is not None)
    found = detector(detectors.windowed(force), params.f_base_n, f_obs)
    assert found.tolist() == felt[WINDOW.samples :]
    assert 0 < found.sum() < len(found)


def test_samples_that_fill_the_window_are_left_out():
    force = np.zeros((105, 3))
    force[100:, 0] = 10.0
    seen = detectors.windowed(force)
    assert len(seen.force) == len(seen.filtered) == len(seen.mean) == len(seen.sigma) == 5
    # with sigma 0 a change is an outlier of weight alpha; the window holds 99 zeros and it
    assert seen.filtered[0] == pytest.approx([1.0, 0.0, 0.0])
    assert seen.mean[0] == pytest.approx([0.01, 0.0, 0.0])
    assert seen.sigma[0] == pytest.approx([0.1, 0.0, 0.0])
    assert detectors.smooth(force, 0.3).filtered[0, 0] == pytest.approx(3.0)


def test_a_course_that_fills_no_window_has_no_samples():
    seen = detectors.windowed(np.zeros((100, 3)))
    assert seen.force.shape == seen.filtered.shape == seen.mean.shape == seen.sigma.shape == (0, 3)
    assert detectors.raw_twice(seen, 10.0).shape == (0,)


def test_the_band_widens_with_the_deviation_up_to_f_std():
    seen = Windowed(*np.zeros((3, 1, 3)), sigma=np.array([[0.0, 1.5, 6.0]]))
    assert detectors.band(seen, 10.0).tolist() == [[10.0, 11.5, 13.0]]
    assert detectors.band(seen, 10.0, 4.0).tolist() == [[6.0, 7.5, 9.0]]


def test_filtered_and_raw_compare_their_own_value_with_the_band():
    seen = course(force=[0.0, 11.9, -12.1, 0.0], filtered=[0.0, 0.0, 11.9, -12.1], sigma=2.0)
    assert detectors.filtered(seen, 10.0).tolist() == [False, False, False, True]
    assert detectors.raw(seen, 10.0).tolist() == [False, False, True, False]
    assert detectors.raw(seen, 10.0, 4.0).tolist() == [False, True, True, False]


def test_steady_has_no_f_sigma():
    seen = course(filtered=[9.9, -10.1, 5.9, 6.1], sigma=2.0)
    assert detectors.steady(seen, 10.0).tolist() == [False, True, False, False]
    assert detectors.steady(seen, 10.0, 4.0).tolist() == [True, True, False, True]
    assert not detectors.filtered(seen, 10.0).any()


def test_raw_twice_believes_the_second_sample():
    seen = course(force=[20.0, 0.0, 20.0, -20.0, 20.0, 0.0])
    assert detectors.raw_twice(seen, 10.0).tolist() == [False, False, False, True, True, False]


def test_a_fixed_threshold_knows_no_mean():
    seen = Windowed(np.array([[0, 0, 10.0], [0, -10.1, 0], [10.1, 0, 0]]), *np.full((3, 3, 3), 100.0))
    assert detectors.fixed(seen, 10.0).tolist() == [False, True, True]
    assert detectors.fixed(seen, 10.0, 4.0).tolist() == [False, True, True]


def test_an_onset_is_answered_before_the_next():
    felt = np.zeros(20, bool)
    felt[[2, 3, 6, 7, 11, 19]] = True
    assert detectors.onsets(felt, 5) == [2, 7, 19]
    assert detectors.onsets(felt, 1) == [2, 3, 6, 7, 11, 19]
    assert detectors.onsets(np.zeros(5, bool), 5) == []


def test_bounds_of_a_rate_are_those_of_the_poisson_table():
    assert detectors.rate_bounds(0, 2.0) == pytest.approx((0.0, 3.6889 / 2), abs=1e-4)
    assert detectors.rate_bounds(1, 1.0) == pytest.approx((0.0253, 5.5716), abs=1e-4)
    assert detectors.rate_bounds(3, 2.0) == pytest.approx((0.6187 / 2, 8.7673 / 2), abs=1e-4)


def test_counts_that_scatter_more_tell_less():
    assert dispersion_of([3, 3, 3, 3]) == 1.0  # less than Poisson counts scatter
    assert dispersion_of([0, 0]) == dispersion_of([5]) == dispersion_of([]) == 1.0
    assert dispersion_of([0, 10]) == pytest.approx(50 / 5)
    plain, wide = rate_bounds(40, 2.0), rate_bounds(40, 2.0, 10.0)
    assert wide[0] < plain[0] < 20 < plain[1] < wide[1]
    # forty events that come in tens tell as much as four in a tenth of the time
    assert wide == pytest.approx(rate_bounds(4, 0.2))
