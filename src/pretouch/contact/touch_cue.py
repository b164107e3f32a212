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

from dataclasses import dataclass, field
from functools import cache
from typing import Any, NamedTuple, Self

import numpy as np

from pretouch.composition import Part
from pretouch.contact.detector import Body, Sample
from pretouch.params import TouchSensorParams
from pretouch.robot.body import Capsules
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.types import FloatArray, IntArray, TouchStatus
from pretouch.values import value


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
    force: FloatArray
    """(C,) size of the force there [N], NaN where the unit measures none; nothing is inferred from it."""


@cache
def no_cues(links: int) -> Cues:
    """Return what units that say nothing say, of an arm with so many links: one for all steps, to be read only."""
    return Cues(np.ones(links), np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros(0), np.zeros(0))


def together(*cues: Cues) -> Cues:
    """Return what several kinds of units say together, at least one kind: gains multiply, places add up."""
    if len(cues) == 1:
        return cues[0]
    return Cues(
        # likelihood ratios of sensors that err independently
        np.prod([c.gain for c in cues], axis=0),
        np.concatenate([c.link for c in cues]),
        np.concatenate([c.point for c in cues]),
        np.concatenate([c.sigma for c in cues]),
        np.concatenate([c.force for c in cues]),
    )


class Cue(Part, group="pretouch.cues"):
    """What the units' touch readings say of a contact. As a detector, it is a frozen dataclass."""

    def on(self, body: Body) -> Self:
        """Return the cue for an arm with all prepared that does not change; by default itself."""
        return self

    def init(self, body: Body) -> Any:
        """Return what is remembered before the first step."""
        return None

    def step(self, state: Any, body: Body, sample: Sample) -> tuple[Cues | None, Any]:
        """Return what the units say in one step, None for nothing, and what to remember."""
        raise NotImplementedError


_TOLERANCE_S = 1e-9
"""A reading stamped later than the step by more than this is of a wrong clock, and not believed [s]."""


@dataclass(frozen=True, eq=False)
class TouchSettings:
    """What is fixed of the M units with a touch sensor."""

    unit: IntArray
    """(M,) index of each in the skin."""
    link: IntArray
    """(M,) index of the link of each."""
    place: FloatArray
    """(M, 3) where each is, link frame [m]."""
    sigma: FloatArray
    """(M,) standard deviation of the touched place in the worst direction [m]: half the radius of the patch, as of an
    even distribution over it, and the uncertainty of where the unit is."""
    gain: FloatArray
    """(M,) G: times the prior of a contact on the link is larger while it is touched [1]."""


@value
class TouchState:
    """What is remembered of M touch sensors."""

    account: FloatArray
    """(M,) time for which each was said to be touched, less what was given back [s]."""


def touch_settings(model: RobotModel, skin: Skin, p: TouchSensorParams) -> TouchSettings | None:
    """Return what is fixed of the units that have a touch sensor; None where none has."""
    if not len(skin.touching):
        return None
    patches = [(k, touch) for k, unit in enumerate(skin.units) if (touch := unit.touch) is not None]
    unit, link = skin.touching, skin.link[skin.touching]
    radius = np.array([touch.radius_m for _, touch in patches])
    area = np.array([surface_area(model.capsules, int(i)) for i in link])
    # s: the patch, taken as flat, of the link's surface
    share = np.minimum(np.pi * radius**2 / area, 1.0)
    return TouchSettings(
        unit, link, skin.T_link_sensor[unit, :3, 3].copy(), np.hypot(radius / 2, skin.position_sigma[unit]),
        gain_of(share, p),
    )  # fmt: skip


def gain_of(share: FloatArray, p: TouchSensorParams) -> FloatArray:
    """Return G (M,) of units whose patches cover these shares (M,) of their links."""
    # p: false touches an hour times how long each lasts
    false = min(1.0, p.false_touches_per_hour * p.false_touch_s / 3600.0)
    return np.asarray(share / false + 1.0 - share)


def surface_area(capsules: Capsules, link: int) -> float:
    """Surface of a link [m^2]: of its capsules, what lies in another one counted too; infinite of one without any."""
    own = capsules.of_links(np.array([link]))
    length = np.linalg.norm(own.b - own.a, axis=1)
    area = float((2 * np.pi * own.radius * length + 4 * np.pi * own.radius**2).sum())
    return area if area > 0.0 else np.inf  # so that s = 0 and G = 1


@dataclass(frozen=True)
class TouchSensors(TouchSensorParams, Cue, name="touch"):
    """The units' touch sensors: a contact is likelier on the link of a unit that is touched, and there is where."""

    State = TouchState

    def on(self, body: Body) -> "_TouchSensorsOn":
        """Return the cue for an arm, its touch sensors looked up."""
        return _TouchSensorsOn(**vars(self), settings=touch_settings(body.model, body.skin, self))


@dataclass(frozen=True)
class _TouchSensorsOn(TouchSensors):
    """Touch sensors of one arm."""

    settings: TouchSettings | None = field(default=None, compare=False)
    """None where no unit has one."""

    def init(self, body: Body) -> TouchState | None:
        return None if self.settings is None else TouchState(np.zeros(len(self.settings.unit)))

    def step(self, state: TouchState | None, body: Body, sample: Sample) -> tuple[Cues | None, TouchState | None]:
        if self.settings is None or state is None:
            return None, None
        return said_by(state, self.settings, sample, body.period, self)


def said_by(
    state: TouchState, settings: TouchSettings, sample: Sample, period: float, p: TouchSensorParams
) -> tuple[Cues | None, TouchState]:
    """Return what units say of a touch in one step, None where none is believed to be touched.

    The touch readings of the sample are of all K units, of known shapes (`sound.sound_touch`); None of a skin that
    gave none. `period` [s] is that of control.
    """
    account, readings, kin = state.account, sample.touches, sample.kin
    if readings is None:
        said = np.zeros(len(account), np.bool_)
    else:
        age = sample.stamp - readings.stamp[settings.unit]
        fresh = (age <= p.fresh_s) & (age >= -_TOLERANCE_S) & (readings.status[settings.unit] == TouchStatus.OK)
        said = fresh & readings.contact[settings.unit]
    believed = np.flatnonzero(said & (account < p.patience_s))
    if said.any() or account.any():
        # filled by all that is said, believed or not: a sensor that stays stuck is never believed again
        filled = np.where(said, account + period, account - p.forgiveness * period)
        state = TouchState(np.clip(filled, 0.0, p.patience_s))
    if readings is None or not len(believed):
        return None, state
    link, gain = settings.link[believed], np.ones(len(kin.position))
    # several touched units of one link count once, by the largest gain
    np.maximum.at(gain, link, settings.gain[believed])
    point = kin.position[link] + np.einsum("mij,mj->mi", kin.rotation[link], settings.place[believed])
    force = readings.force[settings.unit[believed]]
    return Cues(gain, link, point, settings.sigma[believed], force), state
