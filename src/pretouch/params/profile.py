"""A profile is a frozen set of all parameters; the named ones, and how to make variants of them."""

import math
from dataclasses import dataclass, field, fields, replace
from numbers import Integral, Real

from pretouch.checks import Checked
from pretouch.errors import ParameterError
from pretouch.params.anticipation import AnticipationParams
from pretouch.params.baselines import BaselineParams
from pretouch.params.detection import DetectionParams
from pretouch.params.failure import FailureParams
from pretouch.params.localisation import LocalisationParams
from pretouch.params.near import ReductionParams, RestrictionMode, RestrictionParams
from pretouch.params.perception import PerceptionParams
from pretouch.params.reaction import ReactionParams
from pretouch.params.task import TaskParams
from pretouch.params.touch import ThresholdParams


@dataclass(frozen=True)
class Profile(Checked):
    """A named set of parameters for the whole controller."""

    name: str = "paper"
    """Name shown in tables and files."""
    perception: PerceptionParams = field(default_factory=PerceptionParams)
    task: TaskParams = field(default_factory=TaskParams)
    reduction: ReductionParams = field(default_factory=ReductionParams)
    restriction: RestrictionParams = field(default_factory=RestrictionParams)
    anticipation: AnticipationParams = field(default_factory=AnticipationParams)
    threshold: ThresholdParams = field(default_factory=ThresholdParams)
    reaction: ReactionParams = field(default_factory=ReactionParams)
    failure: FailureParams = field(default_factory=FailureParams)
    detection: DetectionParams = field(default_factory=DetectionParams)
    localisation: LocalisationParams = field(default_factory=LocalisationParams)
    baselines: BaselineParams = field(default_factory=BaselineParams)


_PAPER = Profile()
_BLIND = Profile(name="blind", perception=PerceptionParams(enabled=False), restriction=RestrictionParams(mode="off"))

OBSERVER_NM = (3.2, 5.2, 3.2, 4.0, 1.8, 1.1, 1.4)
"""Bounds of the profile `observer` [Nm]: five times what a real Panda's model leaves of its torques in free motion,
0.64 1.03 0.64 0.79 0.35 0.22 0.28 Nm rms."""


def _avoiding(name: RestrictionMode) -> Profile:
    """Return a published way to avoid obstacles: contacts are felt as without proximity, nothing else slows the arm."""
    return replace(
        _PAPER,
        name=name,
        reduction=ReductionParams(enabled=False),
        restriction=RestrictionParams(mode=name),
        threshold=ThresholdParams(f_d_n=0.0),
    )


PROFILES: dict[str, Profile] = {
    "paper": _PAPER,
    "blind": _BLIND,
    "slowing-only": replace(_PAPER, name="slowing-only", threshold=ThresholdParams(f_d_n=0.0)),
    "thresholds-only": replace(_PAPER, name="thresholds-only", reduction=ReductionParams(enabled=False)),
    "paper-0.5m": replace(
        _PAPER,
        name="paper-0.5m",
        reduction=ReductionParams(d_max_m=0.5),
        restriction=RestrictionParams(d_notice_m=0.5),
        threshold=ThresholdParams(d_max_m=0.5),
    ),
    "fixed": replace(_BLIND, name="fixed", detection=DetectionParams(method="fixed")),
    "observer": replace(
        _BLIND,
        name="observer",
        detection=DetectionParams(method="fixed", joint_torques_nm=OBSERVER_NM, force_n=1000.0),
    ),
    "pretouch": Profile(
        name="pretouch",
        perception=PerceptionParams(
            closing_speed=True,
            reckon_below_minimum=True,
            place_at_stamp=True,
            keep_while_silent=True,
            outside_points=2,
        ),
        task=TaskParams(mid_joint_projected=True),
        reduction=ReductionParams(enabled=False),
        restriction=RestrictionParams(mode="braking"),
        anticipation=AnticipationParams(effective_mass=True, closing_speed=True, tangential=True, null_space=True),
        detection=DetectionParams(method="sequential", freeze_while_reacting=True, localise=True, use_touch=True),
        reaction=ReactionParams(
            method="admittance", clamps=True, gives_up=True, soft_hold=True, static_friction_nm=3.0, pinches=True
        ),
    ),
    "flacco": _avoiding("flacco"),
    "ding": _avoiding("ding"),
}
"""`paper`: the equations and Table I. `blind`: the same without proximity, eqs. 8-10 with F_obs = 0.
`slowing-only` and `thresholds-only`: the paper's ablations, one use of proximity each (restrictions are apart from
both). `paper-0.5m`: in place of Table I's distances the 0.5 m within which obstacles affect the arm by the paper's
text (section V-C). `fixed`: as `blind`, with the bounds of the vendor's examples on torques and force. `observer`: as
that, with tighter constant bounds on the torques of the momentum observer. `pretouch`: ours, each departure from the
paper one switch (docs/explanation/detection.md, docs/explanation/anticipation.md, docs/explanation/reaction.md).
`flacco` and `ding`: published ways to avoid obstacles, to compare with (docs/explanation/baselines.md)."""


_NO_DETOUR = "the arm no longer goes round what blocks its path, which kept it from none of 8 boards. Leave it out."
REMOVED = {
    f"anticipation.{name}": _NO_DETOUR for name in ("detour", "detour_distance_m", "detour_speed_m_s", "detour_hold_s")
}
"""Parameters that earlier versions had, and what to do without each."""


def profile(name: str) -> Profile:
    """Look a profile up: by its name, or as `NAME:GROUP.FIELD=VALUE:...`, that profile with some parameters changed.

    `paper:threshold.window_samples=500:reduction.enabled=no`, for example. Raises ParameterError for a profile, group
    or field there is not, naming those there are, and for a value the field does not allow.
    """
    base, *changes = name.split(":")
    try:
        found = PROFILES[base]
    except KeyError:
        raise ParameterError(f"The profile {base!r} is unknown: choose from {', '.join(PROFILES)}.") from None
    values: dict[str, dict[str, object]] = {}
    for change in changes:
        group, field_name, value = _change(found, change)
        values.setdefault(group, {})[field_name] = value
    # all of a group at once, for some are only allowed together
    return replace(found, name=name, **{g: replace(getattr(found, g), **changed) for g, changed in values.items()})


def _change(profile: Profile, change: str) -> tuple[str, str, object]:
    """Read the change of one parameter, given as GROUP.FIELD=VALUE: its group, its name and its value."""
    where, given, text = change.partition("=")
    group, _, name = where.partition(".")
    if not given:
        raise ParameterError(f"The change {change!r} has no value: write GROUP.FIELD=VALUE.")
    groups = [f.name for f in fields(Profile) if f.name != "name"]
    if group not in groups:
        raise ParameterError(f"The group {group!r} of {change!r} is unknown: choose from {', '.join(groups)}.")
    params = getattr(profile, group)
    known = [f.name for f in fields(params)]
    if where in REMOVED:
        raise ParameterError(f"The parameter {where!r} is gone: {REMOVED[where]}")
    if name not in known:
        raise ParameterError(f"The parameter {where!r} is unknown: choose from {', '.join(known)}.")
    return group, name, _read(where, text, getattr(params, name))


def at_rate(profile: Profile, rate: float) -> Profile:
    """Return a profile for a controller at another rate [Hz]: what it counts in cycles lasts as long as before.

    That is the fading of eq. 4, the force window, and the decay of a reaction; alpha of eq. 8, the weight of one
    sample, changes so that a lasting push enters the window as fast as before.
    """
    p, more = profile, rate * profile.task.control_period_s
    if not (math.isfinite(rate) and rate * p.failure.overrun_s > 1):
        least = 1 / p.failure.overrun_s
        raise ParameterError(f"The rate is {rate:g} Hz: it must be more than {least:g} Hz, or each step would be late.")
    samples, alpha = max(2, round(p.threshold.window_samples * more)), 1 - (1 - p.threshold.alpha) ** (1 / more)
    return p if more == 1 else replace(
        p,
        task=replace(p.task, control_period_s=1 / rate),
        reduction=replace(p.reduction, l_max_cycles=max(1, round(p.reduction.l_max_cycles * more))),
        threshold=replace(p.threshold, window_samples=samples, alpha=alpha),
        reaction=replace(p.reaction, decay_cycles=max(1, round(p.reaction.decay_cycles * more))),
    )  # fmt: skip


_WORDS = {"yes": True, "true": True, "no": False, "false": False}


def _read(where: str, text: str, now: object) -> object:
    """Read a value of the kind the parameter has now."""
    if isinstance(now, bool):
        if text not in _WORDS:
            raise ParameterError(f"{where} is {text!r}: write yes or no.")
        return _WORDS[text]
    if not isinstance(now, Real | tuple):
        return text
    try:
        if isinstance(now, tuple):
            return tuple(float(part) for part in text.split(","))
        return int(text) if isinstance(now, Integral) else float(text)
    except ValueError:
        kind = "a whole number" if isinstance(now, Integral) else "a number"
        kind = "numbers with commas between" if isinstance(now, tuple) else kind
        raise ParameterError(f"{where} is {text!r}: write {kind}.") from None
