"""Cues of touch sensors for a contact: a gain on the prior of their links, and the place of the touch.

The gain by a touch follows from the rate of false touches. Let s be the share of a link's surface under a unit's patch,
and p the share of the time in which the unit reports a touch without one. If the link is touched at a random place, the
unit reports it with the probability s + (1 - s) p; if not, with p. The ratio is the gain:

    G = s / p + 1 - s

In free motion the mean of the gain is 1 - p + p G <= 1 + s, so that the expectation of the test's statistic, and with
it the bound on its false alarms, at most doubles for any number of links with such a unit. An untouched unit lowers no
prior: a contact beside a patch keeps the prior it has without one.

A stuck sensor violates the assumption on p. So each unit has an account of the time of its touches, which fills while
it reports one and empties more slowly while it does not; a unit with a full account is ignored. It then neither raises
a prior nor stops the learning of free motion, and contacts are detected as without it.
"""

from functools import cache
from typing import NamedTuple

import numpy as np

from pretouch.contact.detector import Body, Sample
from pretouch.params import TouchSensorParams
from pretouch.robot.body import Capsules
from pretouch.types import FloatArray, IntArray, TouchStatus


class Cues(NamedTuple):
    """Evidence of the units of one step, for detection and localisation. L links of the arm, C touched places."""

    gain: FloatArray
    """(L,) factor of the units on the prior of a contact on each link; 1 without a touch. For a link with a touched
    place, localisation uses that place alone."""
    link: IntArray
    """(C,) index of the link of each touched place."""
    point: FloatArray
    """(C, 3) touched places, base frame [m]."""
    sigma: FloatArray
    """(C,) standard deviation of each in the worst direction [m]."""


@cache
def no_cues(links: int) -> Cues:
    """Return the cues without a touch, for an arm with a number of links; all steps share them, read only."""
    return Cues(np.ones(links), np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros(0))


_TOLERANCE_S = 1e-9
"""A reading with a stamp later than the step by more than this comes from a wrong clock, and is ignored [s]."""


def gain_of(share: FloatArray, p: TouchSensorParams) -> FloatArray:
    """Return the gain G (M,) of units whose patches cover these shares (M,) of their links."""
    # p: false touches an hour times their duration
    false = min(1.0, p.false_touches_per_hour * p.false_touch_s / 3600.0)
    return np.asarray(share / false + 1.0 - share)


def surface_areas(capsules: Capsules, links: int) -> FloatArray:
    """Return the surface of each link's capsules (L,) [m^2], overlaps included; infinite for a link without any."""
    length, r = np.linalg.norm(capsules.b - capsules.a, axis=1), capsules.radius
    area = np.bincount(capsules.link, 2 * np.pi * r * length + 4 * np.pi * r**2, links)
    return np.where(area > 0.0, area, np.inf)  # so that s = 0 and G = 1


def untouched(body: Body, p: TouchSensorParams | None) -> FloatArray:
    """Return the accounts of M touch sensors (M,) before the first touch [s]."""
    return np.zeros(0 if p is None else len(body.skin.touching))


def touch_cues(account: FloatArray, body: Body, sample: Sample, p: TouchSensorParams | None) -> tuple[Cues, FloatArray]:
    """Return the cues of one step, and the accounts of the units after it.

    The touch readings of the sample are those of all K units, with checked shapes; None for a skin without any.
    """
    links = len(body.model.links)
    if p is None or not len(account):
        return no_cues(links), account
    skin, readings, kin, touched = body.skin, sample.touches, sample.kin, np.zeros(len(account), np.bool_)
    if readings is not None:
        age = sample.stamp - readings.stamp[skin.touching]
        fresh = (age <= p.fresh_s) & (age >= -_TOLERANCE_S)
        touched = fresh & (readings.status[skin.touching] == TouchStatus.OK) & readings.contact[skin.touching]
    unit = skin.touching[touched & (account < p.patience_s)]
    if touched.any() or account.any():
        # filled by all touches, ignored ones too: a sensor that stays stuck is never used again
        filled = np.where(touched, account + body.period, account - p.forgiveness * body.period)
        account = np.clip(filled, 0.0, p.patience_s)
    if not len(unit):
        return no_cues(links), account
    link, gain = skin.link[unit], np.ones(links)
    radius = np.array([patch.radius_m for k in unit if (patch := skin.units[k].touch) is not None])
    # s: the patch, taken as flat, of the link's surface
    share = np.minimum(np.pi * radius**2 / surface_areas(body.model.capsules, links)[link], 1.0)
    # of several touched units of one link, the largest gain counts
    np.maximum.at(gain, link, gain_of(share, p))
    point = kin.position[link] + np.einsum("mij,mj->mi", kin.rotation[link], skin.T_link_sensor[unit, :3, 3])
    # half the radius of the patch, for an even distribution over it, and the uncertainty of the unit's position
    return Cues(gain, link, point, np.hypot(radius / 2, skin.arrays.position_sigma[unit])), account
