"""Each switch of `pretouch` off alone: what it is worth."""

from dataclasses import dataclass

BASE = "pretouch"
WITHOUT = "without "
"""Begins the names of these baselines."""

OFF = {
    "perception.self_aside_m": "0",
    "perception.closing": "none",
    "perception.reckon_below_minimum": "no",
    "perception.place_at_stamp": "no",
    "perception.keep_while_silent": "no",
    "perception.outside": "none",
    "task.mid_joint_projected": "no",
    "slow": "on",
    "approach": "none",
    "approach.effective_mass": "none",
    "approach.closing_deadband_m_s": "none",
    "approach.tangential": "none",
    "null_space": "none",
    "detect": "thresholds",
    "window.freeze_while_reacting": "no",
    "detect.proximity": "none",
    "detect.touch": "none",
    "detect.learn": "never",
    "detect.widen_at_turns": "no",
    "detect.misfit": "none",
    "detect.localise": "none",
    "react": "decay",
    "react.clamp": "none",
    "react.pinch": "none",
    "react.give_up": "none",
    "react.soft_hold": "no",
    "react.static_friction_nm": "0",
    "react.lag_s": "0",
}
"""What each switch of `pretouch` is when it is off, as `PATH`: the paper's value, or the part without effect."""

_DETECTION = ("window", "detect")
"""Parts of the profile that streams show."""


@dataclass(frozen=True)
class Ablation:
    """`pretouch` with one switch off."""

    switch: str
    """Path of a part or parameter."""

    @property
    def name(self) -> str:
        """Name of the baseline."""
        return f"{WITHOUT}{self.switch}"

    @property
    def profile_text(self) -> str:
        """As `pretouch.profiles.profile` reads it."""
        return f"{BASE}:{self.switch}={OFF[self.switch]}"


def ablations(*, of_detection: bool) -> tuple[Ablation, ...]:
    """Return the switches of detection, which streams show, or all others, which need the closed loop."""
    return tuple(Ablation(switch) for switch in OFF if (switch.partition(".")[0] in _DETECTION) is of_detection)
