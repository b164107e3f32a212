"""The detectors that the benchmark of detection compares: each is a profile, so all run through the same code."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from pretouch.contact.detector import Detection
from pretouch.contact.moving_thresholds import MovingThresholds
from pretouch.profiles import Profile, profile
from pretouch.types import FloatArray
from pretouch_lab.benchmarks.ablations import ablations

Sweep = Literal["f_base_n", "scale"]


@dataclass(frozen=True)
class Baseline:
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

    @property
    def default(self) -> float:
        """Return the value of the sweep that the profile itself has."""
        return MovingThresholds.of_kind(self.profile.detect).f_base_n if self.sweep == "f_base_n" else 1.0

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


BASELINES = (
    Baseline("blind", "blind", "f_base_n"),
    Baseline("fixed", "fixed", "scale"),
    Baseline("observer", "observer", "scale"),
    Baseline("paper", "paper", "f_base_n"),
    Baseline("paper-raw", "paper:detect.compare=raw", "f_base_n"),
    Baseline("pretouch", "pretouch", "scale"),
)
"""The detectors; `pretouch` last."""


def ablated() -> tuple[Baseline, ...]:
    """Return `pretouch` with each switch of its detection off alone; the paper's thresholds are swept by F_b."""
    return tuple(
        Baseline(a.name, a.profile_text, "f_base_n" if a.switch == "detect" else "scale")
        for a in ablations(of_detection=True)
    )
