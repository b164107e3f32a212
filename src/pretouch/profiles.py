"""Profiles: the named choices of parts and parameters of a whole controller, and how to make variants.

`replace(profile, ...)` of the standard library makes a variant in a program, `profile("NAME:CHANGE:...")` from a text.
"""

import math
from dataclasses import dataclass, field, fields, replace

from pretouch.checks import Checked
from pretouch.composition import changed
from pretouch.contact.admittance import Admittance
from pretouch.contact.detector import Detector
from pretouch.contact.moving_thresholds import MovingThresholds
from pretouch.contact.reaction import DecayingVelocity, Reaction
from pretouch.contact.sequential_test import SequentialTest
from pretouch.control.approach import ApproachRestriction, BrakingCurve, Restriction
from pretouch.errors import ParameterError
from pretouch.params import (
    ClampParams,
    FailureParams,
    GiveUpParams,
    LocalisationParams,
    LocalMapParams,
    NullSpaceMotion,
    OutsidePoints,
    PerceptionParams,
    PinchParams,
    SpeedReduction,
    Tangential,
    TaskParams,
    TouchSensorParams,
    WindowParams,
)
from pretouch.plugins import load, names

GROUP = "pretouch.profiles"
"""Group of entry points under which other distributions name profiles of theirs."""


@dataclass(frozen=True)
class Profile(Checked):
    """A named set of parameters for the whole controller."""

    name: str = "paper"
    """Name shown in tables and files."""
    perception: PerceptionParams | None = field(default_factory=PerceptionParams)
    """How readings become obstacle points (eq. 1); none: no obstacles."""
    task: TaskParams = field(default_factory=TaskParams)
    """How the hand follows its path (eq. 2)."""
    slow: SpeedReduction | None = field(default_factory=SpeedReduction)
    """Reduction of the speed near obstacles (eq. 3); none: only silent units slow the arm."""
    approach: Restriction | None = field(default_factory=ApproachRestriction)
    """Restriction of the body's approach to obstacles (eqs. 5-7, or other rows of the QP); none: no restriction."""
    null_space: NullSpaceMotion | None = None
    """Motion of links before the hand away from obstacles, in the null space of the task; none: no such motion."""
    window: WindowParams = field(default_factory=WindowParams)
    """The window of the external force: contacts are detected once it is full (eq. 8)."""
    detect: Detector = field(default_factory=MovingThresholds)
    """How a contact is distinguished from free motion (eqs. 9-11)."""
    react: Reaction = field(default_factory=DecayingVelocity)
    """How the arm answers a contact (eq. 12)."""
    failure: FailureParams = field(default_factory=FailureParams)
    """When an input counts as missing, late or wrong."""

    @property
    def sight(self) -> PerceptionParams:
        """Parameters of perception; the paper's for a profile without perception, for pages that show the units."""
        return self.perception or PerceptionParams()

    @property
    def d_max_m(self) -> float:
        """Distance from the end-effector origin within which an obstacle is near it [m]: of eq. 3, or Table I's."""
        return (self.slow or SpeedReduction()).d_max_m


_PAPER = Profile()

PROFILES: dict[str, Profile] = {
    "paper": _PAPER,
    "blind": Profile(name="blind", perception=None, approach=None),
    "slowing-only": replace(_PAPER, name="slowing-only", detect=MovingThresholds(f_d_n=0.0)),
    "thresholds-only": replace(_PAPER, name="thresholds-only", slow=None),
    "paper-0.5m": replace(
        _PAPER,
        name="paper-0.5m",
        slow=SpeedReduction(d_max_m=0.5),
        approach=ApproachRestriction(d_notice_m=0.5),
        detect=MovingThresholds(d_max_m=0.5),
    ),
    "pretouch": Profile(
        name="pretouch",
        perception=PerceptionParams(self_aside_m=0.03, memory=LocalMapParams(), outside=OutsidePoints()),
        task=TaskParams(mid_joint_projected=True),
        slow=None,
        approach=BrakingCurve(margin_m=0.03, untouched_s=6.0, closing_deadband_m_s=0.05, tangential=Tangential()),
        null_space=NullSpaceMotion(),
        window=WindowParams(freeze_while_reacting=True),
        detect=SequentialTest(touch=TouchSensorParams(), localise=LocalisationParams()),
        react=Admittance(
            soft_hold=True, static_friction_nm=3.0, clamp=ClampParams(), pinch=PinchParams(), give_up=GiveUpParams()
        ),
    ),
}
"""Each departure of `pretouch` from the paper is one switch (docs/explanation/detection.md,
docs/explanation/anticipation.md, docs/explanation/reaction.md)."""

SHORT = {"paper-off": "paper:approach=none"}
"""Short names of variants in tables of results."""


def profile_names() -> tuple[str, ...]:
    """Return the names of all profiles: ours, those of other distributions, and the short ones."""
    return tuple(dict.fromkeys((*PROFILES, *names(GROUP), *SHORT)))


def profile(text: str) -> Profile:
    """Look a profile up: by its name, or as `NAME:CHANGE:...`, that profile with some parts or parameters changed.

    A change is a part by its name or a parameter by its value, as `paper:detect=sequential:task.speed_m_s=0.2`, and
    `none` leaves a part out. Raises ParameterError for an unknown profile, part or parameter, with a list of the known
    ones, and for a value that is not allowed.
    """
    base, *changes = text.split(":")
    return replace(changed(_named(base), _paths(changes)), name=text) if changes else _named(base)


def _named(name: str) -> Profile:
    if name in PROFILES:
        return PROFILES[name]
    if name in SHORT:
        return replace(profile(SHORT[name]), name=name)
    if name not in names(GROUP):
        raise ParameterError(f"The profile {name!r} is unknown: choose from {', '.join(profile_names())}.")
    loaded = load(GROUP, name)
    if not isinstance(loaded, Profile):
        raise ParameterError(f"The profile {name!r} is {loaded!r} in its distribution: it must be a Profile.")
    return loaded


def _paths(changes: list[str]) -> dict[str, str]:
    """Read changes: path -> text."""
    texts = dict[str, str]()
    groups = [f.name for f in fields(Profile) if f.name != "name"]
    for change in changes:
        path, equals, texts[path] = change.partition("=")
        if not equals:
            raise ParameterError(f"The change {change!r} has no value: write PATH=VALUE.")
        if (group := path.partition(".")[0]) not in groups:
            raise ParameterError(f"The group {group!r} of {change!r} is unknown: choose from {', '.join(groups)}.")
    return texts


def at_rate(profile: Profile, rate: float) -> Profile:
    """Return a profile for a controller at another rate [Hz]: times that it counts in cycles stay the same.

    These are the fading of eq. 4, the force window, and the decay of a reaction; alpha of eq. 8, the weight of one
    sample, changes so that a lasting push enters the window as fast as before.
    """
    p, more = profile, rate * profile.task.control_period_s
    if not (math.isfinite(rate) and rate * p.failure.overrun_s > 1):
        least = 1 / p.failure.overrun_s
        raise ParameterError(f"The rate is {rate:g} Hz: it must be more than {least:g} Hz, or each step would be late.")
    samples, alpha = max(2, round(p.window.samples * more)), 1 - (1 - p.window.alpha) ** (1 / more)
    if more == 1:
        return p
    task = replace(p.task, control_period_s=1 / rate, restore_cycles=max(1, round(p.task.restore_cycles * more)))
    window = replace(p.window, samples=samples, alpha=alpha)
    return replace(p, task=task, window=window, react=p.react.stretched(more))
