"""What units' touch sensors say of a contact: a gain on the prior of their links, and the place that is touched.

By how much a touch raises the prior follows from how often one is false. Let s be the share of a link's surface that a
unit's patch covers, and p the share of the time in which it says that it is touched while it is not. If the link is
touched somewhere, and nothing else is known of where, the unit says so with the probability s + (1 - s) p; if it is
not, with p. The ratio is the gain:

    G = s / p + 1 - s

In free motion the mean of the gain is 1 - p + p G <= 1 + s, so that the expectation of the test's statistic, and with
it the bound on its false alarms, at most doubles however many links have such a unit. A unit that is not touched takes
nothing away: a contact beside a patch keeps the prior it has without one.

A sensor that is stuck breaks the assumption on p. So each unit has an account of the time it was said to be touched,
which fills while it is and empties more slowly while it is not; a unit whose account is full is not believed. It then
neither raises a prior nor keeps free motion from being learnt, and contacts are found as without it.
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
    """(L,) times a contact on each link is likelier than without the units; 1 where they say nothing. What localisation
    makes of a link with a touched place is that place alone."""
    link: IntArray
    """(C,) index of the link of each place that a unit says is touched."""
    point: FloatArray
    """(C, 3) these places, base frame [m]."""
    sigma: FloatArray
    """(C,) standard deviation of each in the worst direction [m]."""


@cache
def no_cues(links: int) -> Cues:
    """Return what units that say nothing say, of an arm with so many links: one for all steps, to be read only."""
    return Cues(np.ones(links), np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros(0))


_TOLERANCE_S = 1e-9
"""A reading stamped later than the step by more than this is of a wrong clock, and not believed [s]."""


def gain_of(share: FloatArray, p: TouchSensorParams) -> FloatArray:
    """Return G (M,) of units whose patches cover these shares (M,) of their links."""
    # p: false touches an hour times how long each lasts
    false = min(1.0, p.false_touches_per_hour * p.false_touch_s / 3600.0)
    return np.asarray(share / false + 1.0 - share)


def surface_areas(capsules: Capsules, links: int) -> FloatArray:
    """Surface of each link (L,) [m^2]: of its capsules, what lies in another one counted too; infinite without any."""
    length, r = np.linalg.norm(capsules.b - capsules.a, axis=1), capsules.radius
    area = np.bincount(capsules.link, 2 * np.pi * r * length + 4 * np.pi * r**2, links)
    return np.where(area > 0.0, area, np.inf)  # so that s = 0 and G = 1


def untouched(body: Body, p: TouchSensorParams | None) -> FloatArray:
    """Return the account of each of M touch sensors (M,): how long it said that it was touched [s]."""
    return np.zeros(0 if p is None else len(body.skin.touching))


def touch_cues(account: FloatArray, body: Body, sample: Sample, p: TouchSensorParams | None) -> tuple[Cues, FloatArray]:
    """Return what units say of a touch in one step, and their accounts; a contact is likelier where one is touched.

    The touch readings of the sample are of all K units, of known shapes; None of a skin that gave none.
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
        # filled by all that is said, believed or not: a sensor that stays stuck is never believed again
        filled = np.where(touched, account + body.period, account - p.forgiveness * body.period)
        account = np.clip(filled, 0.0, p.patience_s)
    if not len(unit):
        return no_cues(links), account
    link, gain = skin.link[unit], np.ones(links)
    radius = np.array([patch.radius_m for k in unit if (patch := skin.units[k].touch) is not None])
    # s: the patch, taken as flat, of the link's surface
    share = np.minimum(np.pi * radius**2 / surface_areas(body.model.capsules, links)[link], 1.0)
    # several touched units of one link count once, by the largest gain
    np.maximum.at(gain, link, gain_of(share, p))
    point = kin.position[link] + np.einsum("mij,mj->mi", kin.rotation[link], skin.T_link_sensor[unit, :3, 3])
    # half the radius of the patch, as of an even distribution over it, and the uncertainty of where the unit is
    return Cues(gain, link, point, np.hypot(radius / 2, skin.arrays.position_sigma[unit])), account
