"""Spans of a recording that look like contacts, and are left out."""

import numpy as np

from pretouch.errors import CalibrationError
from pretouch.types import BoolArray, FloatArray
from pretouch_lab.identification.fit import Fit
from pretouch_lab.identification.params import IdentifyParams
from pretouch_lab.identification.samples import Usable, joint_scale


def free_samples(found: Usable, fitted: Fit, p: IdentifyParams) -> tuple[BoolArray, tuple[tuple[float, float], ...]]:
    """Say which samples (N,) are of free motion, and from when to when [s] something else is.

    What a contact does lasts longer than noise: means over `contact_s` are compared with how far such means usually
    are off. CalibrationError if too much looks like that.
    """
    s = found.samples
    left = s.tau - fitted.expected
    means = smoothed(found, left, p.contact_s)
    inside = np.zeros(len(s.stamp), np.bool_)
    for a, b in found.segments:
        inside[a:b] = True
    off = np.abs(means - np.median(means[inside], axis=0))
    far: BoolArray = np.any(off > p.contact_sigmas * joint_scale(means[inside]), axis=1)
    used, spans = inside.copy(), []
    for a, b in found.segments:
        times = s.stamp[a:b][far[a:b]]
        for group in np.split(times, np.flatnonzero(np.diff(times) > 2.0 * p.contact_margin_s) + 1):
            if len(group):
                begin, end = group[0] - p.contact_margin_s, group[-1] + p.contact_margin_s
                spans.append((float(begin), float(end)))
                used &= (s.stamp < begin) | (s.stamp > end)
    share = 1.0 - float(used.sum()) / max(int(inside.sum()), 1)
    if share > p.contact_share:
        raise CalibrationError(
            f"{100 * share:.0f} % of the recording looks like contacts: nothing may touch the arm while it is"
            " identified. Record free motion, or cut the contacts out."
        )
    return used, tuple(spans)


def smoothed(found: Usable, values: FloatArray, over_s: float) -> FloatArray:
    """Moving means (N, n) within each segment."""
    length = max(round(over_s / found.period), 1)
    means = np.zeros_like(values)
    for a, b in found.segments:
        total = np.cumsum(np.vstack([np.zeros((1, values.shape[1])), values[a:b]]), axis=0)
        ends = np.minimum(np.arange(b - a) + length // 2 + 1, b - a)
        begins = np.maximum(np.arange(b - a) - (length - 1) // 2 - (1 - length % 2), 0)
        means[a:b] = (total[ends] - total[begins]) / (ends - begins)[:, None]
    return means
