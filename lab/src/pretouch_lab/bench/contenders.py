"""Profiles that benchmarks compare, by short names; and each switch of `pretouch` off alone: what it is worth."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from pretouch.contact.detector import Detection
from pretouch.contact.moving_thresholds import MovingThresholds
from pretouch.errors import ParameterError
from pretouch.profiles import Profile, profile
from pretouch.types import FloatArray

Sweep = Literal["f_base_n", "scale"]
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
_UNSHOWN = ("window.freeze_while_reacting", "detect.touch")
"""But these: no arm reacts in a stream, and none has touch sensors."""


def ablations(*, of_detection: bool) -> dict[str, str]:
    """Return the profile of `pretouch` with one switch off, by the name of that contender.

    Either the switches of detection, which streams show, or all others, which need the closed loop.
    """
    return {
        f"{WITHOUT}{switch}": f"{BASE}:{switch}={value}"
        for switch, value in OFF.items()
        if (switch.partition(".")[0] in _DETECTION) is of_detection
    }


AVOIDANCE = {
    "blind": "blind",
    "flacco": "flacco",
    "flacco-surface": "flacco:approach.size_m=0.1",
    "ding": "ding",
    "ding-near": "ding:approach.weighted_m=0.3",
    "paper": "paper:approach.rows=slack",
    "paper-off": "paper:approach=none",
    "pretouch": "pretouch",
}
"""Profile of each baseline: the published methods as published, and with another tuning."""
ABLATED = ablations(of_detection=False)
"""Profile of `pretouch` with each switch off alone."""
ABLATED_IN = ("circle +y", "line -y", "person +y")
"""Scenarios in which those are played too, in a full run with `ABLATED_SEEDS` seeds each."""
ABLATED_SEEDS = 4


def profile_text(baseline: str) -> str:
    """Return the profile a baseline stands for; other than by its name it may be given as the profile itself."""
    text = {**AVOIDANCE, **ABLATED}.get(baseline, baseline)
    try:
        profile(text)
    except ParameterError as error:
        raise ParameterError(f"{error} Baselines are {', '.join(AVOIDANCE)}.") from error
    return text


@dataclass(frozen=True)
class Contender:
    """A detector by name, and what is swept of it."""

    name: str
    profile_text: str
    """As `pretouch.profiles.profile` reads it."""
    sweep: Sweep
    """Base force of the paper's thresholds [N], or a factor on the evidence that makes an alarm."""

    @property
    def profile(self) -> Profile:
        """Return its parameters."""
        return profile(self.profile_text)

    def statistic(self, found: Detection, filtered: FloatArray, wrench: FloatArray | None) -> float:
        """Return the largest value of the sweep at which a step would still be an alarm; -inf where none would.

        With the paper's thresholds that is exact: neither window, F_sigma nor F_obs depends on F_b. Other detectors say
        how much evidence they have; held against a factor that is exact as long as nothing they remember depends on
        their own alarms.
        """
        if not found.armed:
            return -np.inf
        if self.sweep == "scale":
            return found.evidence
        if wrench is None:
            return -np.inf
        limits = found.thresholds
        params = MovingThresholds.of_kind(self.profile.detect)
        force = filtered if params.compare == "filtered" else wrench[:3]
        return float(np.max(np.maximum(force - limits.upper, limits.lower - force))) + params.f_base_n


DETECTORS = (
    Contender("blind", "blind", "f_base_n"),
    Contender("fixed", "fixed", "scale"),
    Contender("observer", "observer", "scale"),
    Contender("paper", "paper", "f_base_n"),
    Contender("paper-raw", "paper:detect.compare=raw", "f_base_n"),
    Contender("pretouch", "pretouch", "scale"),
)
"""The detectors; `pretouch` last."""


def ablated() -> tuple[Contender, ...]:
    """Return `pretouch` with each switch of its detection off alone; the paper's thresholds are swept by F_b."""
    return tuple(
        Contender(name, text, "f_base_n" if name == f"{WITHOUT}detect" else "scale")
        for name, text in ablations(of_detection=True).items()
        if name.removeprefix(WITHOUT) not in _UNSHOWN
    )
