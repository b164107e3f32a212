"""The named profiles, and how to make variants of them.

`replace(profile, ...)` of the standard library makes a variant in a program, `profile("NAME:CHANGE:...")` from a text.
"""

import math
from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Any

from pretouch.composition import at, changed, from_table
from pretouch.contact.admittance import Admittance
from pretouch.contact.moving_thresholds import MovingThresholds
from pretouch.contact.sequential_test import SequentialTest
from pretouch.contact.tactile import TouchSensors
from pretouch.errors import ParameterError
from pretouch.params import (
    AnticipationParams,
    ClampParams,
    GiveUpParams,
    LocalisationParams,
    PerceptionParams,
    PinchParams,
    ReductionParams,
    RestrictionMode,
    RestrictionParams,
    TaskParams,
    WindowParams,
)
from pretouch.plugins import load, names
from pretouch.profile import Profile

GROUP = "pretouch.profiles"
"""Group of entry points under which other distributions name profiles of theirs."""

_PAPER = Profile()
_BLIND = Profile(name="blind", perception=PerceptionParams(enabled=False), restriction=RestrictionParams(mode="off"))


def _avoiding(name: RestrictionMode) -> Profile:
    """Return a published way to avoid obstacles: contacts are felt as without proximity, nothing else slows the arm."""
    return replace(
        _PAPER,
        name=name,
        reduction=ReductionParams(enabled=False),
        restriction=RestrictionParams(mode=name),
        detect=MovingThresholds(f_d_n=0.0),
    )


PROFILES: dict[str, Profile] = {
    "paper": _PAPER,
    "blind": _BLIND,
    "slowing-only": replace(_PAPER, name="slowing-only", detect=MovingThresholds(f_d_n=0.0)),
    "thresholds-only": replace(_PAPER, name="thresholds-only", reduction=ReductionParams(enabled=False)),
    "paper-0.5m": replace(
        _PAPER,
        name="paper-0.5m",
        reduction=ReductionParams(d_max_m=0.5),
        restriction=RestrictionParams(d_notice_m=0.5),
        detect=MovingThresholds(d_max_m=0.5),
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
        window=WindowParams(freeze_while_reacting=True),
        detect=SequentialTest(cues=(TouchSensors(),), localise=LocalisationParams()),
        react=Admittance(
            soft_hold=True, static_friction_nm=3.0, clamp=ClampParams(), pinch=PinchParams(), give_up=GiveUpParams()
        ),
    ),
    "flacco": _avoiding("flacco"),
    "ding": _avoiding("ding"),
}
"""`paper`: the equations and Table I. `blind`: the same without proximity, eqs. 8-10 with F_obs = 0.
`slowing-only` and `thresholds-only`: the paper's ablations, one use of proximity each (restrictions are apart from
both). `paper-0.5m`: in place of Table I's distances the 0.5 m within which obstacles affect the arm by the paper's
text (section V-C). `pretouch`: ours, each departure from the
paper one switch (docs/explanation/detection.md, docs/explanation/anticipation.md, docs/explanation/reaction.md).
`flacco` and `ding`: published ways to avoid obstacles, to compare with (docs/explanation/baselines.md)."""


def profile_names() -> tuple[str, ...]:
    """Return the names of all profiles, those of other distributions last."""
    return tuple(dict.fromkeys((*PROFILES, *names(GROUP))))


def profile(text: str) -> Profile:
    """Look a profile up: by its name, or as `NAME:CHANGE:...`, that profile with some parts or parameters changed.

    A change is a part by its name or a parameter by its value, as `paper:detect=sequential:task.speed_m_s=0.2`, and
    `none` leaves a part out. Names of earlier versions are read as well. Raises ParameterError for a profile, part or
    parameter there is not, naming those there are, and for a value that is not allowed.
    """
    base, *changes = text.split(":")
    found = _named(base)
    return replace(changed(found, _paths(changes)), name=text) if changes else found


def _named(name: str) -> Profile:
    if name in PROFILES:
        return PROFILES[name]
    if name not in names(GROUP):
        raise ParameterError(f"The profile {name!r} is unknown: choose from {', '.join(profile_names())}.")
    found = load(GROUP, name)
    if not isinstance(found, Profile):
        raise ParameterError(f"The profile {name!r} is {found!r} in its distribution: it must be a Profile.")
    return found


def _paths(changes: list[str]) -> dict[str, str]:
    """Read changes, of this version's names or an earlier one's: path -> text."""
    found: dict[str, str] = {}
    groups = [f.name for f in fields(Profile) if f.name != "name"]
    for change in changes:
        path, given, text = change.partition("=")
        if not given:
            raise ParameterError(f"The change {change!r} has no value: write PATH=VALUE.")
        if path in REMOVED:
            raise ParameterError(f"The parameter {path!r} is gone: {REMOVED[path]}")
        found |= of_today(path, text)
        group = next(iter(found)).partition(".")[0]
        if group not in groups:
            raise ParameterError(f"The group {group!r} of {change!r} is unknown: choose from {', '.join(groups)}.")
    return found


def value_of(found: Profile, path: str) -> object:
    """Return a part's or parameter's value, by its name of today or of an earlier version.

    A switch of an earlier version is True or False, or its text. Raises ParameterError for a parameter there is not.
    """
    if path in SWITCHES:
        for text, (today, chosen) in SWITCHES[path].items():
            if changed(found, {today: chosen}) == found:
                return {"yes": True, "no": False}.get(text, text)
    (today,) = _paths([f"{path}=" if path not in SWITCHES else f"{path}={next(iter(SWITCHES[path]))}"])
    return at(found, today)


def of_today(path: str, text: str) -> dict[str, str]:
    """Return what a change by a name of an earlier version is today: path -> text."""
    if path in SWITCHES:
        if text not in SWITCHES[path]:
            raise ParameterError(f"{path} is {text!r}: choose from {', '.join(SWITCHES[path])}.")
        return dict([SWITCHES[path][text]])
    return {RENAMED.get(path, path): text}


_REACT = {
    "clamp_nm": "clamp.torque_nm", "open_m_s": "clamp.open_m_s", "open_s": "clamp.open_s",
    "pinch_gap_m": "pinch.gap_m", "pinch_n": "pinch.force_n",
    "give_up_contacts": "give_up.contacts", "pushed_j": "give_up.push_j", "retry_s": "give_up.retry_s",
} | {
    name: name for name in (
        "compliance_m_s_n", "speed_max_m_s", "decay_cycles", "soft_hold", "lag_s", "inertia_kg_m2", "damping_nm_s",
        "dead_band_nm", "dead_band_fraction", "static_friction_nm", "start_energy_j", "quiet_s", "near_m", "patience_s",
    )
}  # fmt: skip
_WINDOW = {"threshold.window_samples": "samples", "threshold.alpha": "alpha", "threshold.lambda_": "lambda_"}
_THRESHOLDS = ("f_base_n", "f_std_n", "sigma_max_n", "f_d_n", "d_max_m", "d_min_m", "compare")
_PROXIMITY = {"near_gain": "gain", "near_m": "distance_m", "near_horizon_s": "horizon_s"}
_TOUCH = {
    "false_touches_per_hour": "false_touches_per_hour", "false_touch_s": "false_touch_s", "touch_fresh_s": "fresh_s",
    "touch_patience_s": "patience_s", "touch_forgiveness": "forgiveness",
}  # fmt: skip
_IMU = {
    "imu_gain": "gain", "imu_memory_s": "memory_s", "imu_contact_gain": "contact_gain", "imu_tails": "tails",
    "imu_follow_1_s": "follow_1_s", "imu_motion_doubt": "motion_doubt", "rotor_kg_m2": "rotor_kg_m2",
}  # fmt: skip
_DETECT = (
    "joint_torques_nm", "force_n", "false_alarms_per_hour", "slack_nats", "contact_gain", "tails", "clear_m", "suspect",
    "inertia", "relearn_after_s", "widen_at_turns", "memory_s", "spread_memory_s", "observer_gain_1_s",
    "offset_prior_nm", "friction_prior_nm", "mass_prior", "payload_prior_kg", "velocity_prior_rad_s2",
    "torque_prior_nm", "noise_floor_nm", "bias_floor_nm", "still_rad_s", "confirm_samples",
)  # fmt: skip
RENAMED: dict[str, str] = {
    **{old: f"window.{new}" for old, new in _WINDOW.items()},
    "detection.freeze_while_reacting": "window.freeze_while_reacting",
    **{f"threshold.{name}": f"detect.{name}" for name in _THRESHOLDS},
    **{f"detection.{name}": f"detect.{name}" for name in _DETECT},
    **{f"detection.{old}": f"detect.proximity.{new}" for old, new in _PROXIMITY.items()},
    **{f"detection.{old}": f"detect.cues.touch.{new}" for old, new in _TOUCH.items()},
    **{f"detection.{old}": f"detect.cues.imu.{new}" for old, new in _IMU.items()},
    **{f"localisation.{f.name}": f"detect.localise.{f.name}" for f in fields(LocalisationParams)},
    **{f"reaction.{old}": f"react.{new}" for old, new in _REACT.items()},
}
"""Names of earlier versions, and what each is today."""

SWITCHES: dict[str, dict[str, tuple[str, str]]] = {
    "detection.method": {name: ("detect", name) for name in ("thresholds", "fixed", "sequential")},
    "detection.use_proximity": {"yes": ("detect.proximity", "on"), "no": ("detect.proximity", "none")},
    "detection.use_touch": {"yes": ("detect.cues", "touch"), "no": ("detect.cues", "none")},
    "detection.use_imu": {"yes": ("detect.cues", "touch,imu"), "no": ("detect.cues", "touch")},
    "detection.learn": {"yes": ("detect.learn", "watched"), "no": ("detect.learn", "never")},
    "detection.learn_unseen": {"yes": ("detect.learn", "always"), "no": ("detect.learn", "watched")},
    "detection.localise": {"yes": ("detect.localise", "on"), "no": ("detect.localise", "none")},
    "reaction.method": {name: ("react", name) for name in ("decay", "admittance")},
    "reaction.clamps": {"yes": ("react.clamp", "on"), "no": ("react.clamp", "none")},
    "reaction.pinches": {"yes": ("react.pinch", "on"), "no": ("react.pinch", "none")},
    "reaction.gives_up": {"yes": ("react.give_up", "on"), "no": ("react.give_up", "none")},
}
"""Switches of earlier versions: for each value the change that it is today."""


_NO_DETOUR = "the arm no longer goes round what blocks its path, which kept it from none of 8 boards. Leave it out."
_CONSTANT = "it is a constant of pretouch.contact now, with its reason beside it. Leave it out."
_CONSTANTS = (
    "reverse_band", "tank_max_j", "mean_s", "clamp_s", "clamp_window_s", "clamp_turns", "turn_s", "pinch_least_m",
    "pinch_closing_m_s", "pinch_thickness_m", "pinch_along", "pinch_rest", "pinch_explained", "place_m", "clear_s",
)  # fmt: skip
REMOVED = {
    f"anticipation.{name}": _NO_DETOUR for name in ("detour", "detour_distance_m", "detour_speed_m_s", "detour_hold_s")
} | {f"reaction.{name}": _CONSTANT for name in _CONSTANTS}
"""Parameters that earlier versions had, and what to do without each."""


def profile_from(table: Mapping[str, Any]) -> tuple[Profile, tuple[str, ...]]:
    """Make a profile from the table that `composition.as_table` makes of one.

    Names what another version knew that this one does not. Raises ParameterError where a value does not belong.
    """
    unlike: list[str] = []
    made = from_table(Profile, dict(table), "", unlike)
    return made, tuple(unlike)


def at_rate(profile: Profile, rate: float) -> Profile:
    """Return a profile for a controller at another rate [Hz]: what it counts in cycles lasts as long as before.

    That is the fading of eq. 4, the force window, and the decay of a reaction; alpha of eq. 8, the weight of one
    sample, changes so that a lasting push enters the window as fast as before.
    """
    p, more = profile, rate * profile.task.control_period_s
    if not (math.isfinite(rate) and rate * p.failure.overrun_s > 1):
        least = 1 / p.failure.overrun_s
        raise ParameterError(f"The rate is {rate:g} Hz: it must be more than {least:g} Hz, or each step would be late.")
    samples, alpha = max(2, round(p.window.samples * more)), 1 - (1 - p.window.alpha) ** (1 / more)
    return p if more == 1 else replace(
        p,
        task=replace(p.task, control_period_s=1 / rate),
        reduction=replace(p.reduction, l_max_cycles=max(1, round(p.reduction.l_max_cycles * more))),
        window=replace(p.window, samples=samples, alpha=alpha),
        react=p.react.stretched(more),
    )  # fmt: skip
