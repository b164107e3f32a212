"""Profiles that benchmarks compare, by short names, and ablations: `pretouch` with one switch off at a time."""

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
"""Prefix of the names of ablations."""

OFF = {
    "perception.self_aside_m": "0",
    "perception.memory": "none:perception.outside=none",
    "perception.outside": "none",
    "task.mid_joint_projected": "no",
    "slow": "on",
    "approach": "none",
    "approach.untouched_s": "0",
    "approach.closing_deadband_m_s": "none",
    "approach.tangential": "none",
    "null_space": "none",
    "detect": "thresholds",
    "window.freeze_while_reacting": "no",
    "detect.proximity": "none",
    "detect.touch": "none",
    "detect.learn": "never",
    "detect.localise": "none",
    "react": "decay",
    "react.clamp": "none",
    "react.pinch": "none",
    "react.give_up": "none",
    "react.soft_hold": "no",
    "react.static_friction_nm": "0",
    "react.lag_s": "0",
}
"""Value of each switch of `pretouch`, by its path in the profile, when it is off: the paper's value, or no effect."""

_DETECTION = ("window", "detect")
"""Parts of the profile whose effect streams show."""
_UNSHOWN = ("window.freeze_while_reacting", "detect.touch")
"""Exceptions: no arm in a stream reacts or has touch sensors."""


def ablations(*, of_detection: bool) -> dict[str, str]:
    """Return the profile of `pretouch` with one switch off, by the contender's name.

    They are the switches of detection, whose effect streams show, or the others, which need the closed loop.
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
"""Profile of each baseline: published methods with their published tuning, and with another one."""
ABLATED = ablations(of_detection=False)
"""Profiles of `pretouch` with one switch off each, by name."""
ABLATED_IN = ("circle +y", "line -y", "person +y")
"""Scenarios that also play the ablations, with `ABLATED_SEEDS` seeds each in a full run."""
ABLATED_SEEDS = 4


def profile_text(baseline: str) -> str:
    """Return the profile of a baseline's name; a profile's own text is returned unchanged."""
    text = {**AVOIDANCE, **ABLATED}.get(baseline, baseline)
    try:
        profile(text)
    except ParameterError as error:
        raise ParameterError(f"{error} Baselines are {', '.join(AVOIDANCE)}.") from error
    return text


@dataclass(frozen=True)
class Contender:
    """A detector by name, and its swept parameter."""

    name: str
    profile_text: str
    """As `pretouch.profiles.profile` reads it."""
    sweep: Sweep
    """Base force of the paper's thresholds [N], or a factor on the evidence for an alarm."""

    @property
    def profile(self) -> Profile:
        """Parameters of the detector's profile."""
        return profile(self.profile_text)

    def statistic(self, detection: Detection, filtered: FloatArray, wrench: FloatArray | None) -> float:
        """Return the largest value of the sweep at which a step is still an alarm; -inf if no value makes it one.

        This is exact for the paper's thresholds: window, F_sigma and F_obs do not depend on F_b. Other detectors return
        their evidence. Comparing it with a factor is exact as long as no state of the detector depends on its own
        alarms.
        """
        if not detection.armed:
            return -np.inf
        if self.sweep == "scale":
            return detection.evidence
        if wrench is None:
            return -np.inf
        limits = detection.thresholds
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
"""Detectors of the benchmark; `pretouch` is the last one."""


def ablated() -> tuple[Contender, ...]:
    """Return `pretouch` with one switch of its detection off at a time; F_b sweeps the paper's thresholds."""
    return tuple(
        Contender(name, text, "f_base_n" if name == f"{WITHOUT}detect" else "scale")
        for name, text in ablations(of_detection=True).items()
        if name.removeprefix(WITHOUT) not in _UNSHOWN
    )
