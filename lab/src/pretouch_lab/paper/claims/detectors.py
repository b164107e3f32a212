"""Contact detectors held against a recorded course of the force estimate: nothing reacts, all see the same."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from pretouch.contact.thresholds import noise_force
from pretouch.contact.window import add_force, window_init
from pretouch.params import ThresholdParams, WindowParams
from pretouch.types import BoolArray, FloatArray

TABLE_I, WINDOW = ThresholdParams(), WindowParams()


@dataclass(frozen=True)
class Windowed:
    """A course of S force estimates and what the window of eq. 8 makes of it. All (S, 3) [N]."""

    force: FloatArray
    filtered: FloatArray
    """Value that entered the window, eq. 8."""
    mean: FloatArray
    sigma: FloatArray
    """Sample standard deviation of the window."""


def windowed(force: FloatArray, params: WindowParams = WINDOW) -> Windowed:
    """Send forces (S, 3) [N] through the window of eq. 8, and leave out the samples that only fill it."""
    state, course = window_init(params.samples), []
    for sample in force:
        armed = state.full
        state = add_force(state, sample, params)
        if armed:
            course.append((state.newest, state.mean(), state.std()))
    filtered, mean, sigma = np.array(course).reshape(-1, 3, 3).swapaxes(0, 1)
    return Windowed(force[params.samples :], filtered, mean, sigma)


def smooth(force: FloatArray, alpha: float) -> Windowed:
    """As `windowed`, with another influence of outliers than Table I's."""
    return windowed(force, replace(WINDOW, alpha=alpha))


def band(course: Windowed, f_base: float, f_obs: float = 0.0) -> FloatArray:
    """Width F_b + F_sigma - F_obs (S, 3) [N] of eq. 9, with an object of F_obs [N] on both sides of each axis."""
    return f_base + noise_force(course.sigma, TABLE_I.f_std_n, TABLE_I.sigma_max_n) - f_obs


Detector = Callable[[Windowed, float, float], BoolArray]
"""Says of each of S samples whether a contact is detected, given F_b and F_obs [N]."""


def filtered(course: Windowed, f_base: float, f_obs: float = 0.0) -> BoolArray:
    """Hold the newest value in the window against the thresholds, as the paper does."""
    return np.any(np.abs(course.filtered - course.mean) > band(course, f_base, f_obs), axis=1)


def steady(course: Windowed, f_base: float, f_obs: float = 0.0) -> BoolArray:
    """As `filtered`, but without F_sigma: thresholds that stay equally far from the mean whatever the noise."""
    return np.any(np.abs(course.filtered - course.mean) > f_base - f_obs, axis=1)


def raw(course: Windowed, f_base: float, f_obs: float = 0.0) -> BoolArray:
    """Hold the estimate itself against the thresholds, as the authors' code does."""
    return np.any(np.abs(course.force - course.mean) > band(course, f_base, f_obs), axis=1)


def raw_twice(course: Windowed, f_base: float, f_obs: float = 0.0) -> BoolArray:
    """Hold the estimate against the thresholds, and believe it the second time in a row."""
    over = raw(course, f_base, f_obs)
    return over & np.concatenate([[False], over[:-1]])


def fixed(course: Windowed, threshold: float, _f_obs: float = 0.0) -> BoolArray:
    """Hold the estimate against a fixed force [N] on each axis, without a window: no thresholding of the paper's."""
    return np.any(np.abs(course.force) > threshold, axis=1)


def onsets(detected: BoolArray, rest: int) -> list[int]:
    """Samples at which a contact is detected anew: while one is answered, for `rest` samples, none is looked for."""
    found: list[int] = []
    for i in np.flatnonzero(detected).tolist():
        if not found or i >= found[-1] + rest:
            found.append(i)
    return found


def rate_bounds(events: float, hours: float, dispersion: float = 1.0) -> tuple[float, float]:
    """95 % bounds on a rate [1/h] of which `events` were counted in some hours: exact for a Poisson count.

    Where counts scatter `dispersion` times as much as Poisson counts do, so many events tell as much as one.
    """
    from scipy.stats import chi2

    effective, time = events / dispersion, hours / dispersion
    low = chi2.ppf(0.025, 2 * effective) / 2 if effective else 0.0
    return float(low / time), float(chi2.ppf(0.975, 2 * effective + 2) / 2 / time)


def dispersion_of(counts: list[int]) -> float:
    """Variance of counts by their mean, 1 for Poisson counts and taken as 1 where it is less or unknown."""
    mean = float(np.mean(counts)) if counts else 0.0
    return max(1.0, float(np.var(counts, ddof=1)) / mean) if len(counts) > 1 and mean > 0 else 1.0
