"""Names of parameters in earlier versions, and what they are today: texts and recordings may hold them."""

from dataclasses import fields

from pretouch.errors import ParameterError
from pretouch.params import LocalisationParams

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


def of_today(path: str, text: str) -> dict[str, str]:
    """Return what a change by a name of an earlier version is today: path -> text."""
    if path in SWITCHES:
        if text not in SWITCHES[path]:
            raise ParameterError(f"{path} is {text!r}: choose from {', '.join(SWITCHES[path])}.")
        return dict([SWITCHES[path][text]])
    return {RENAMED.get(path, path): text}
