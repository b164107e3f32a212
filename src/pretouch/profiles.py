"""The named profiles, and how to make variants of them.

`replace(profile, ...)` of the standard library makes a variant in a program, `profile("NAME:CHANGE:...")` from a text.
"""

import math
from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Any, get_args

from pretouch.composition import changed, from_table
from pretouch.control.braking_curve import BrakingCurve
from pretouch.control.interface import Restriction
from pretouch.control.restriction import ApproachRestriction
from pretouch.errors import ParameterError
from pretouch.params import (
    DetectionParams,
    EffectiveMass,
    NullSpaceMotion,
    PerceptionParams,
    ReactionParams,
    RowKind,
    SpeedReduction,
    Tangential,
    TaskParams,
    ThresholdParams,
)
from pretouch.plugins import load, names
from pretouch.profile import Profile

GROUP = "pretouch.profiles"
"""Group of entry points under which other distributions name profiles of theirs."""

_PAPER = Profile()
_BLIND = Profile(name="blind", perception=PerceptionParams(enabled=False), approach=None)

OBSERVER_NM = (3.2, 5.2, 3.2, 4.0, 1.8, 1.1, 1.4)
"""Bounds of the profile `observer` [Nm]: five times what a real Panda's model leaves of its torques in free motion,
0.64 1.03 0.64 0.79 0.35 0.22 0.28 Nm rms."""


PROFILES: dict[str, Profile] = {
    "paper": _PAPER,
    "blind": _BLIND,
    "slowing-only": replace(_PAPER, name="slowing-only", threshold=ThresholdParams(f_d_n=0.0)),
    "thresholds-only": replace(_PAPER, name="thresholds-only", slow=None),
    "paper-0.5m": replace(
        _PAPER,
        name="paper-0.5m",
        slow=SpeedReduction(d_max_m=0.5),
        approach=ApproachRestriction(d_notice_m=0.5),
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
        task=TaskParams(mid_joint_projected=True, blocked_after_s=2.0),
        slow=None,
        approach=BrakingCurve(effective_mass=EffectiveMass(), closing_deadband_m_s=0.05, tangential=Tangential()),
        null_space=NullSpaceMotion(),
        detection=DetectionParams(method="sequential", freeze_while_reacting=True, localise=True, use_touch=True),
        reaction=ReactionParams(
            method="admittance", clamps=True, gives_up=True, soft_hold=True, static_friction_nm=3.0, pinches=True
        ),
    ),
}
"""`paper`: the equations and Table I. `blind`: the same without proximity, eqs. 8-10 with F_obs = 0.
`slowing-only` and `thresholds-only`: the paper's ablations, one use of proximity each (restrictions are apart from
both). `paper-0.5m`: in place of Table I's distances the 0.5 m within which obstacles affect the arm by the paper's
text (section V-C). `fixed`: as `blind`, with the bounds of the vendor's examples on torques and force. `observer`: as
that, with tighter constant bounds on the torques of the momentum observer. `pretouch`: ours, each departure from the
paper one switch (docs/explanation/detection.md, docs/explanation/anticipation.md, docs/explanation/reaction.md)."""


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


def of_today(path: str, text: str) -> dict[str, str]:
    """Return what a change by a name of an earlier version is today: path -> text."""
    if path in SWITCHES:
        if text not in SWITCHES[path]:
            raise ParameterError(f"{path} is {text!r}: choose from {', '.join(SWITCHES[path])}.")
        return dict(SWITCHES[path][text])
    return {RENAMED.get(path, path): text}


_APPROACH = (
    "v_max_m_s", "beta", "d_repulse_m", "d_crit_m", "d_notice_m", "floor_m_s", "slack_weight", "deceleration_m_s2",
    "latency_s", "margin_m", "touch_speed_max_m_s", "retreat_max_m_s", "tighten_m_s2", "loosen_m_s2",
    "closing_deadband_m_s",
)  # fmt: skip
_BASELINES = (
    "flacco_v_max_m_s", "flacco_alpha", "flacco_rho_m", "flacco_size_m", "ding_repulse_m", "ding_zero_low_m",
    "ding_zero_high_m", "ding_notice_m", "ding_approach_m_s", "ding_retreat_m_s", "ding_weighted_m",
)  # fmt: skip
_MASS = ("body_region", "region_force_n", "force_fraction", "rotor_inertia_kg_m2")
RENAMED: dict[str, str] = {
    "reduction.d_max_m": "slow.d_max_m",
    "reduction.l_max_cycles": "task.restore_cycles",
    "anticipation.blocked_after_s": "task.blocked_after_s",
    **{f"{group}.{name}": f"approach.{name}" for group in ("restriction", "anticipation") for name in _APPROACH},
    **{f"anticipation.{name}": f"approach.effective_mass.{name}" for name in _MASS},
    **{f"anticipation.tangential_{name}": f"approach.tangential.{name}" for name in ("distance_m", "speed_m_s")},
    **{f"anticipation.null_{name}": f"null_space.{name}" for name in ("distance_m", "speed_m_s")},
    **{f"anticipation.null_{name}": f"null_space.{name}" for name in ("joint_rad_s", "rate_rad_s2")},
    **{f"baselines.{name}": f"approach.{name.partition('_')[2]}" for name in _BASELINES},
}
"""Names of earlier versions, and what each is today."""


def _switch(path: str, on: str) -> dict[str, dict[str, str]]:
    return {"yes": {path: on}, "no": {path: "none"}}


SWITCHES: dict[str, dict[str, dict[str, str]]] = {
    "reduction.enabled": _switch("slow", "on"),
    "restriction.mode": {
        "off": {"approach": "none"},
        **{rows: {"approach": "paper", "approach.rows": rows} for rows in get_args(RowKind)},
        "braking": {"approach": "braking", "task.blocked_after_s": "2"},
        **{name: {"approach": name} for name in ("flacco", "ding")},
    },
    "anticipation.null_space": _switch("null_space", "on"),
    "anticipation.effective_mass": _switch("approach.effective_mass", "on"),
    "anticipation.tangential": _switch("approach.tangential", "on"),
    "anticipation.closing_speed": _switch("approach.closing_deadband_m_s", "0.05"),
}
"""Switches of earlier versions: for each value the changes that it is today."""


_NO_DETOUR = "the arm no longer goes round what blocks its path, which kept it from none of 8 boards. Leave it out."
REMOVED = {
    f"anticipation.{name}": _NO_DETOUR for name in ("detour", "detour_distance_m", "detour_speed_m_s", "detour_hold_s")
}
"""Parameters that earlier versions had, and what to do without each."""


def restriction_modes() -> tuple[str, ...]:
    """Return the names of all ways to restrict the arm's approach: none, the rows of the paper's, and other parts."""
    others = (name for name in Restriction.choices() if name != ApproachRestriction.name)
    return ("off", *get_args(RowKind), *others)


def restriction_mode(profile: Profile) -> str:
    """Return which of `restriction_modes` a profile has."""
    part = profile.approach
    return "off" if part is None else part.rows if isinstance(part, ApproachRestriction) else part.name


def with_restriction(profile: Profile, mode: str) -> Profile:
    """Return a profile with another of `restriction_modes`; a part that stays keeps its parameters."""
    if mode not in restriction_modes():
        raise ParameterError(f"The restriction {mode!r} is unknown: choose from {', '.join(restriction_modes())}.")
    switch = SWITCHES["restriction.mode"]
    return changed(profile, switch.get(mode, {"approach": mode}))


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
    samples, alpha = max(2, round(p.threshold.window_samples * more)), 1 - (1 - p.threshold.alpha) ** (1 / more)
    return p if more == 1 else replace(
        p,
        task=replace(
            p.task, control_period_s=1 / rate, restore_cycles=max(1, round(p.task.restore_cycles * more))
        ),
        threshold=replace(p.threshold, window_samples=samples, alpha=alpha),
        reaction=replace(p.reaction, decay_cycles=max(1, round(p.reaction.decay_cycles * more))),
    )  # fmt: skip
