"""The methods that the benchmark of avoidance compares: short names for profiles."""

from pretouch.errors import ParameterError
from pretouch.profiles import profile
from pretouch_lab.benchmarks.ablations import ablations

BASELINES = {
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
ABLATED = {ablation.name: ablation.profile_text for ablation in ablations(of_detection=False)}
"""Profile of `pretouch` with each switch off alone."""
ABLATED_IN = ("circle +y", "line -y", "person +y")
"""Scenarios in which those are played too, in a full run with `ABLATED_SEEDS` seeds each."""
ABLATED_SEEDS = 4
TUNINGS = {
    "flacco-free": "flacco:task.orientation=free",
    "ding-free": "ding:task.orientation=free",
}
"""Further tunings of the published methods, by name only."""


def profile_text(baseline: str) -> str:
    """Return the profile a baseline stands for; other than by its name it may be given as the profile itself."""
    text = {**BASELINES, **ABLATED, **TUNINGS}.get(baseline, baseline)
    try:
        profile(text)
    except ParameterError as error:
        raise ParameterError(f"{error} Baselines are {', '.join([*BASELINES, *TUNINGS])}.") from error
    return text
