"""Who takes part: short names for profiles."""

from pretouch.errors import ParameterError
from pretouch.profiles import profile
from pretouch_lab.benchmarks.ablations import ablations

CONTENDERS = {
    "blind": "blind",
    "flacco": "flacco",
    "flacco-surface": "flacco:baselines.flacco_size_m=0.1",
    "ding": "ding",
    "ding-near": "ding:baselines.ding_weighted_m=0.3",
    "paper": "paper:restriction.mode=slack",
    "paper-off": "paper:restriction.mode=off",
    "pretouch": "pretouch",
}
"""Profile of each contender: the published methods as published, and with another tuning."""
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


def profile_text(contender: str) -> str:
    """Return the profile a contender stands for; other than by its name it may be given as the profile itself."""
    text = {**CONTENDERS, **ABLATED, **TUNINGS}.get(contender, contender)
    try:
        profile(text)
    except ParameterError as error:
        raise ParameterError(f"{error} Contenders are {', '.join([*CONTENDERS, *TUNINGS])}.") from error
    return text
