"""Names of parameters in earlier versions, and what they are today: texts and recordings may hold them."""

from dataclasses import fields
from typing import get_args

from pretouch.errors import ParameterError
from pretouch.params import LocalisationParams, NullSpaceMotion, RowKind

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
    "relearn_after_s", "widen_at_turns", "memory_s", "spread_memory_s", "observer_gain_1_s",
    "offset_prior_nm", "friction_prior_nm", "mass_prior", "payload_prior_kg", "velocity_prior_rad_s2",
    "torque_prior_nm", "noise_floor_nm", "bias_floor_nm", "still_rad_s",
)  # fmt: skip
_APPROACH = (
    "v_max_m_s", "beta", "d_repulse_m", "d_crit_m", "d_notice_m", "floor_m_s", "slack_weight", "deceleration_m_s2",
    "latency_s", "margin_m", "touch_speed_max_m_s", "retreat_max_m_s", "tighten_m_s2", "loosen_m_s2",
    "closing_deadband_m_s",
)  # fmt: skip
_OUTSIDE = ("margin_m", "persistence_s", "hidden_s", "slow_after_s", "silent_after_s")
_MASS = ("body_region", "region_force_n", "force_fraction", "rotor_inertia_kg_m2")
_BASELINES = (
    "flacco_v_max_m_s", "flacco_alpha", "flacco_rho_m", "flacco_size_m", "ding_repulse_m", "ding_zero_low_m",
    "ding_zero_high_m", "ding_notice_m", "ding_approach_m_s", "ding_retreat_m_s", "ding_weighted_m",
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
    "reduction.d_max_m": "slow.d_max_m",
    "reduction.l_max_cycles": "task.restore_cycles",
    "anticipation.blocked_after_s": "task.blocked_after_s",
    "perception.closing_memory_s": "perception.closing.memory_s",
    **{f"perception.outside_{name}": f"perception.outside.{name}" for name in _OUTSIDE},
    **{f"{group}.{name}": f"approach.{name}" for group in ("restriction", "anticipation") for name in _APPROACH},
    **{f"anticipation.{name}": f"approach.effective_mass.{name}" for name in _MASS},
    **{f"anticipation.tangential_{name}": f"approach.tangential.{name}" for name in ("distance_m", "speed_m_s")},
    **{f"anticipation.null_{f.name}": f"null_space.{f.name}" for f in fields(NullSpaceMotion)},
    **{f"baselines.{name}": f"approach.{name.partition('_')[2]}" for name in _BASELINES},
}
"""Names of earlier versions, and what each is today."""


def _switch(path: str, yes: str = "on", no: str = "none") -> dict[str, dict[str, str]]:
    return {"yes": {path: yes}, "no": {path: no}}


SWITCHES: dict[str, dict[str, dict[str, str]]] = {
    "perception.enabled": _switch("perception"),
    "perception.filter_views": _switch("perception.self_margin_m", "0.06"),
    "perception.closing_speed": _switch("perception.closing"),
    "perception.outside_points": {
        "0": {"perception.outside": "none"},
        **{str(n): {"perception.outside": "on", "perception.outside.per_link": str(n)} for n in range(1, 33)},
    },
    "detection.method": {name: {"detect": name} for name in ("thresholds", "fixed", "sequential")},
    "detection.use_proximity": _switch("detect.proximity"),
    "detection.use_touch": _switch("detect.cues", "touch"),
    "detection.use_imu": _switch("detect.cues", "touch,imu", "touch"),
    "detection.learn": _switch("detect.learn", "watched", "never"),
    "detection.learn_unseen": _switch("detect.learn", "always", "watched"),
    "detection.localise": _switch("detect.localise"),
    "reaction.method": {name: {"react": name} for name in ("decay", "admittance")},
    "reaction.clamps": _switch("react.clamp"),
    "reaction.pinches": _switch("react.pinch"),
    "reaction.gives_up": _switch("react.give_up"),
    "reduction.enabled": _switch("slow"),
    "restriction.mode": {
        "off": {"approach": "none"},
        **{rows: {"approach": "paper", "approach.rows": rows} for rows in get_args(RowKind)},
        "braking": {"approach": "braking", "task.blocked_after_s": "2"},
        **{name: {"approach": name} for name in ("flacco", "ding")},
    },
    "anticipation.null_space": {
        "yes": {"null_space": "on", "task.blocked_after_s": "2"},
        "no": {"null_space": "none"},
    },
    "anticipation.effective_mass": _switch("approach.effective_mass"),
    "anticipation.tangential": _switch("approach.tangential"),
    "anticipation.closing_speed": _switch("approach.closing_deadband_m_s", "0.05"),
}
"""Switches of earlier versions: for each value the changes that it is today."""


_NO_DETOUR = "the arm no longer goes round what blocks its path, which kept it from none of 8 boards. Leave it out."
_CONSTANT = "it is a constant of pretouch.contact now, with its reason beside it. Leave it out."
_ONE_VALUE = "it had one value in every profile. Leave it out."
_CONSTANTS = (
    "reverse_band", "tank_max_j", "mean_s", "clamp_s", "clamp_window_s", "clamp_turns", "turn_s", "pinch_least_m",
    "pinch_closing_m_s", "pinch_thickness_m", "pinch_along", "pinch_rest", "pinch_explained", "place_m", "clear_s",
)  # fmt: skip
REMOVED = (
    {
        f"anticipation.{name}": _NO_DETOUR
        for name in ("detour", "detour_distance_m", "detour_speed_m_s", "detour_hold_s")
    }
    | {f"reaction.{name}": _CONSTANT for name in _CONSTANTS}
    | {f"{group}.{name}": _ONE_VALUE for group in ("detection", "detect") for name in ("inertia", "confirm_samples")}
)
"""Parameters that earlier versions had, and what to do without each."""


def path_today(path: str) -> str:
    """Return what a parameter or switch of an earlier version is called today; another name as it is."""
    return next(iter(next(iter(SWITCHES[path].values())))) if path in SWITCHES else RENAMED.get(path, path)


def of_today(path: str, text: str) -> dict[str, str]:
    """Return what a change by a name of an earlier version is today: path -> text."""
    if path in SWITCHES:
        if text not in SWITCHES[path]:
            raise ParameterError(f"{path} is {text!r}: choose from {', '.join(SWITCHES[path])}.")
        return dict(SWITCHES[path][text])
    return {RENAMED.get(path, path): text}
