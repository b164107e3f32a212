"""Each switch of `pretouch` off alone: what it is worth."""

from dataclasses import dataclass

BASE = "pretouch"
WITHOUT = "without "
"""Begins the names of these baselines."""

OFF = {
    "perception.closing_speed": "no",
    "perception.reckon_below_minimum": "no",
    "perception.place_at_stamp": "no",
    "perception.keep_while_silent": "no",
    "perception.outside_points": "0",
    "task.mid_joint_projected": "no",
    "reduction.enabled": "yes",
    "restriction.mode": "off",
    "anticipation.effective_mass": "no",
    "anticipation.closing_speed": "no",
    "anticipation.tangential": "no",
    "anticipation.null_space": "no",
    "detection.method": "thresholds",
    "detection.freeze_while_reacting": "no",
    "detection.use_proximity": "no",
    "detection.use_touch": "no",
    "detection.learn": "no",
    "detection.widen_at_turns": "no",
    "detection.localise": "no",
    "reaction.method": "decay",
    "reaction.clamps": "no",
    "reaction.pinches": "no",
    "reaction.gives_up": "no",
    "reaction.soft_hold": "no",
    "reaction.static_friction_nm": "0",
    "reaction.lag_s": "0",
}
"""What each switch of `pretouch` is when it is off, as `GROUP.FIELD`: the paper's value, or the part without effect."""


@dataclass(frozen=True)
class Ablation:
    """`pretouch` with one switch off."""

    switch: str
    """`GROUP.FIELD`."""

    @property
    def name(self) -> str:
        """Name of the baseline."""
        return f"{WITHOUT}{self.switch}"

    @property
    def profile_text(self) -> str:
        """As `pretouch.params.profile` reads it."""
        return f"{BASE}:{self.switch}={OFF[self.switch]}"


def ablations(*, of_detection: bool) -> tuple[Ablation, ...]:
    """Return the switches of detection, which streams show, or all others, which need the closed loop."""
    return tuple(Ablation(switch) for switch in OFF if switch.startswith("detection.") is of_detection)
