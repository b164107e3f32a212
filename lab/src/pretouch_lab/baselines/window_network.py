"""A supervised classifier of torque windows, retrained on the runs to learn from.

After Zhang, Qian, Schuller, Wollherr, "An online robot collision detection and identification scheme by supervised
learning and Bayesian decision theory", IEEE T-ASE 18(3), 2021. docs/explanation/baselines.md states which parts are
reproduced. Its examples of contacts are pushes on the same runs, see `pushes`.
"""

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.optimize import minimize
from scipy.special import expit

from pretouch.imported_data.torques import TorqueRecording
from pretouch.types import BoolArray, FloatArray
from pretouch_lab.bench.players import Alarms, sampled
from pretouch_lab.bench.pushes import LASTING_S, in_any_direction, pushed, starts
from pretouch_lab.bench.real_sets import TorqueStream

_WINDOW = 30
"""Cycles of a window: 0.3 s, as published."""
_NEURONS = 48
"""Logistic neurons of the hidden layer, as published."""
_VOTES, _OF = 3, 5
"""Decisions for a contact among the last ones that make an alarm, as in the authors' program."""
_DECAY = 1e-4
"""Weight of the squared weights, the default of the authors' library."""
_ITERATIONS = 200
_EXAMPLES = 6
"""Number of copies of the runs with pushes."""
_EVERY_S = 1.5
"""Time between two pushes of a copy [s]."""
_FORCES_N = (5.0, 40.0)
"""Range of the pushes' forces [N]."""
_FIRST_S = 0.02
"""Time after the start of a push from which a window is an example of one [s]."""
_NYQUIST_HZ, _BANDS_HZ = 50.0, (0.0, 10.0, 25.0, 50.1)
_SEED = 1000
"""First seed of the pushes to learn from; those that are judged have others."""


def features(tau: FloatArray) -> FloatArray:
    """Return features (S - 29, 10 n) of each window of torques (S, n) [Nm], in time and frequency; NaN from NaN."""
    windows = sliding_window_view(tau, _WINDOW, axis=0)
    power = np.abs(np.fft.rfft(windows - windows.mean(axis=2, keepdims=True), axis=2)) ** 2
    frequency = np.linspace(0.0, _NYQUIST_HZ, power.shape[2])
    bands = [
        np.log(1e-6 + power[:, :, (frequency >= low) & (frequency < high)].sum(axis=2))
        for low, high in pairwise(_BANDS_HZ)
    ]
    steps = np.diff(windows, axis=2)
    parts = [windows.mean(axis=2), windows.std(axis=2), windows.min(axis=2), windows.max(axis=2), windows[:, :, -1]]
    return np.concatenate([*parts, np.abs(steps).mean(axis=2), np.abs(steps).max(axis=2), *bands], axis=1)


def learnt(learn: TorqueStream) -> Callable[[TorqueRecording], Alarms]:
    """Train the classifier on some runs; return it as a detector."""
    inputs, contact = examples(learn)
    middle, width = inputs.mean(axis=0), inputs.std(axis=0) + 1e-9
    weights = trained((inputs - middle) / width, contact)

    def play(recording: TorqueRecording) -> Alarms:
        time, newest = sampled(recording)
        decisions = np.zeros(len(time), np.bool_)
        window = (features(recording.tau_ext[newest]) - middle) / width
        decisions[_WINDOW - 1 :] = _output(weights, window)[0] > 0.5  # NaN is none
        votes = np.convolve(decisions, np.ones(_OF))[: len(time)]
        return Alarms(time, votes >= _VOTES, np.full(len(time), np.nan))

    return play


def examples(learn: TorqueStream) -> tuple[FloatArray, BoolArray]:
    """Return features (N, d) of windows in free motion and in pushes, and which of them (N,) are in pushes."""
    time, newest = sampled(learn.recording)
    free = np.array([not part.any() for part in sliding_window_view(learn.label[newest] != 0, _WINDOW)])
    inputs, contact = [features(learn.recording.tau_ext[newest])[free]], [np.zeros(int(free.sum()), np.bool_)]
    runs = list(dict.fromkeys(learn.run.tolist()))
    for seed in range(_SEED, _SEED + _EXAMPLES):
        start = starts(learn, runs, _EVERY_S, seed)
        copy = pushed(learn, in_any_direction(start, np.random.default_rng(seed).uniform(*_FORCES_N, len(start)), seed))
        age = time[_WINDOW - 1 :, None] - start
        within = free & ((age >= _FIRST_S) & (age < LASTING_S)).any(axis=1)
        inputs.append(features(copy.recording.tau_ext[newest])[within])
        contact.append(np.ones(int(within.sum()), np.bool_))
    every, kinds = np.concatenate(inputs), np.concatenate(contact)
    whole = np.isfinite(every).all(axis=1)
    return every[whole], kinds[whole]


_Weights = tuple[FloatArray, FloatArray, FloatArray, FloatArray]


def trained(inputs: FloatArray, contact: BoolArray) -> _Weights:
    """Return the weights of least cross entropy from a random start, for inputs (N, d) and classes (N,)."""
    d = inputs.shape[1]
    ends, shapes = np.cumsum([d * _NEURONS, _NEURONS, _NEURONS]), ((d, _NEURONS), (_NEURONS,), (_NEURONS,), (1,))

    def parts(flat: FloatArray) -> _Weights:
        first, bias, second, last = (part.reshape(s) for part, s in zip(np.split(flat, ends), shapes, strict=True))
        return first, bias, second, last

    def loss(flat: FloatArray) -> tuple[float, FloatArray]:
        weights = parts(flat)
        output, hidden = _output(weights, inputs)
        error = (output - contact) / len(contact)
        back = np.outer(error, weights[2]) * hidden * (1.0 - hidden)
        slope = [inputs.T @ back, back.sum(axis=0), hidden.T @ error, np.array([error.sum()])]
        entropy = -np.log(np.maximum(np.where(contact, output, 1.0 - output), 1e-12)).mean()
        gradient = np.concatenate([part.ravel() for part in slope]) + _DECAY / len(contact) * flat
        return float(entropy + 0.5 * _DECAY / len(contact) * (flat @ flat)), gradient

    begin = np.random.default_rng(0).normal(0.0, 1.0 / np.sqrt(d), int(ends[-1]) + 1)
    best = minimize(loss, begin, jac=True, method="L-BFGS-B", options={"maxiter": _ITERATIONS})
    return parts(best.x)


def _output(weights: _Weights, inputs: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the probability of a contact (N,), and the hidden layer (N, neurons)."""
    first, bias, second, last = weights
    hidden = expit(inputs @ first + bias)
    return expit(hidden @ second + last[0]), hidden
