"""A learnt baseline: what free motion's torques look like is learnt, and what it does not explain is held to bounds.

After Lim, Kim and Park, "Momentum observer-based collision detection using LSTM for model uncertainty learning" (ICRA
2021): a network learns, on free motion, what the observer says of the error of the model; what the observer says
beyond that is an external torque. In place of the LSTM stands a network with one hidden layer of random weights, which
sees positions and velocities of now and of the last tenth of a second; only its output is fitted, by ridge regression.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pretouch.profiles import Profile
from pretouch.types import BoolArray, FloatArray
from pretouch_lab.baselines.fixed_bounds import OBSERVER, FixedBounds
from pretouch_lab.benchmarks.real.external import Stream

LEARNT = "learnt"
_LAGS_S = (0.0, 0.03, 0.1)
_HIDDEN, _RIDGE = 200, 1e-3
_TURNING_RAD_S = 0.05
_SHARES = 4
"""Parts of what is learnt from, each of which is judged by the others for the bounds."""
_ROWS = 8192
"""Samples at a time, for memory."""
_NO_FORCE_N = 1000.0
"""Bound on the force, out of reach: torques alone decide, as in the profile `observer`."""


def learnt(stream: Stream, runs: Sequence[int]) -> tuple[Stream, Profile]:
    """Learn from the free motion of some runs; return what is left of all torques, and the detector with its bounds.

    A bound is the largest torque that was left of free motion that the network had not seen, among the same runs.
    """
    r = stream.recording
    seen = stream.free & np.isin(stream.run, runs)
    x, y = _inputs(stream), r.tau_ext
    scale = x[seen].std(axis=0) + 1e-6
    x = (x - x[seen].mean(axis=0)) / scale
    bounds = np.zeros(r.model.n)
    for part in np.array_split(np.flatnonzero(seen), _SHARES):
        others = seen.copy()
        others[part] = False
        left = y[part] - _answer(x[part], _fit(x, y, others))
        bounds = np.maximum(bounds, np.abs(left).max(axis=0))
    tau = y - _answer(x, _fit(x, y, seen))
    profile = replace(OBSERVER, name=LEARNT, detect=FixedBounds(tuple(bounds), _NO_FORCE_N))
    return replace(stream, recording=replace(r, tau_ext=tau)), profile


def _inputs(stream: Stream) -> FloatArray:
    """Positions and velocities (M, D) at some delays; before a run's begin those of its begin."""
    r, columns = stream.recording, []
    first = np.searchsorted(stream.run, stream.run)
    for lag in _LAGS_S:
        at = np.maximum(np.arange(len(r.time)) - round(lag * r.rate), first)
        columns += [np.sin(r.q[at]), np.cos(r.q[at]), r.qd[at], np.tanh(r.qd[at] / _TURNING_RAD_S)]
    return np.hstack(columns)


def _hidden(x: FloatArray) -> FloatArray:
    rng = np.random.default_rng(0)
    weights = rng.standard_normal((x.shape[1], _HIDDEN)) / np.sqrt(x.shape[1])
    return np.hstack([np.ones((len(x), 1)), x, np.tanh(x @ weights + rng.uniform(-1.0, 1.0, _HIDDEN))])


def _fit(x: FloatArray, y: FloatArray, rows: BoolArray) -> FloatArray:
    """Weights (H, n) of the output."""
    at = np.flatnonzero(rows)
    size = 1 + x.shape[1] + _HIDDEN
    gram, right = _RIDGE * len(at) * np.eye(size), np.zeros((size, y.shape[1]))
    for some in np.array_split(at, max(1, len(at) // _ROWS)):
        h = _hidden(x[some])
        gram += h.T @ h
        right += h.T @ y[some]
    return np.asarray(np.linalg.solve(gram, right), np.float64)


def _answer(x: FloatArray, weights: FloatArray) -> FloatArray:
    parts = np.array_split(x, max(1, len(x) // _ROWS))
    return np.vstack([_hidden(part) @ weights for part in parts])
