"""What can be swept: experiments as functions of a setting that return numbers, the existing trials and their rows."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, cast

from pretouch.checks import Checked, Positive
from pretouch.control.approach import ApproachRestriction
from pretouch.errors import ExperimentError
from pretouch.profiles import Profile
from pretouch_lab.benchmarks.detection.arm import model
from pretouch_lab.experiment import Context
from pretouch_lab.experiments import avoidance, dynamic, static
from pretouch_lab.run import Row
from pretouch_lab.sweep.setting import Setting

Numbers = dict[str, float | None]
"""What is measured, by its name; None where there is nothing to measure, as the delay of what was not detected."""


@dataclass(frozen=True)
class Measure:
    """An experiment that can be swept."""

    name: str
    text: str
    """What it plays, for the help and the document."""
    profile: str
    """Profile it starts from, unless a sweep names another."""
    scene: Checked
    """Its own parameters, `scene.FIELD`."""
    metrics: dict[str, str]
    """What it measures: each number's name, and what it is with its unit."""
    run: Callable[[Setting, Any], Numbers]
    """Measures a setting, given what `shared` made of it."""
    cost_s: Callable[[Setting], float]
    """Processor time of `run`, about [s]."""
    groups: tuple[str, ...] | None = None
    """Groups of the profile, or single parameters, that can change something; None: all of them."""
    shared: Callable[[Setting], Any] | None = None
    """Makes what cells with the same `Setting.world` have in common: a recorded stream."""
    shared_cost_s: Callable[[Setting], float] = lambda _: 0.0

    def check(self, name: str) -> None:
        """Refuse a parameter of the profile that cannot change anything here."""
        group = name.partition(".")[0]
        of_profile = group in Profile.__dataclass_fields__
        if self.groups is not None and of_profile and not {group, name} & set(self.groups):
            of = f"take one of {', '.join(self.groups)}, or" if self.groups else "take one of scene, or"
            raise ExperimentError(f"The parameter {name} changes nothing in {self.name}: {of} the experiment static.")


@dataclass(frozen=True)
class StaticScene(Checked):
    """The board of paper IV-A."""

    trajectory: Literal["circle", "line"] = "circle"
    side: Literal["-y", "+y"] = "-y"
    stiffness_n_m: Positive = 25_000.0
    """Of the board [N/m]."""


@dataclass(frozen=True)
class AvoidanceScene(Checked):
    """The person's hand of paper IV-B."""

    place: Literal["beside", "inside"] = "inside"


@dataclass(frozen=True)
class DynamicScene(Checked):
    """The pushes of paper IV-C: the seed says all of them."""


def _played(setting: Setting, trial: Callable[[Row, int, Context], tuple[Row, Any]], where: Row) -> Row:
    context = Context(model(), setting.skin, plant=setting.plant, ranging=setting.sensing)
    return trial(where | {"profile": setting.profile_text}, setting.seed, context)[0]


def _static(setting: Setting, _: None) -> Numbers:
    scene = cast(StaticScene, setting.scene)
    where = {"trajectory": scene.trajectory, "side": scene.side, "stiffness_n_per_m": scene.stiffness_n_m}
    row = _played(setting, static.trial, where)
    return {
        "peak_estimate_n": row["peak_estimate_n"],
        "true_peak_n": row["true_peak_n"],
        "true_peak_20ms_n": row["true_peak_20ms_n"],
        "delay_s": row["detection_delay_s"],
        "impact_speed_m_s": row["impact_speed_m_s"],
        "contact": float(row["contact"]),
        "missed": float(row["contact"] and row["detection_delay_s"] is None),
        "false_detections": float(row["false_detections"]),
    }


def _avoidance(setting: Setting, _: None) -> Numbers:
    place = cast(AvoidanceScene, setting.scene).place
    row = _played(setting, avoidance.trial, {"place": place})
    names = ("least_gap_m", "true_peak_n", "deviation_m", "travelled_m", "contact", "false_detections")
    return {name: float(row[name]) for name in names}


def _dynamic(setting: Setting, _: None) -> Numbers:
    row = _played(setting, dynamic.trial, {})
    contacts = row["contacts"]
    return {
        "peak_estimate_n": row["peak_estimate_n"],
        "true_peak_n": row["true_peak_n"],
        "true_peak_20ms_n": row["true_peak_20ms_n"],
        "delay_s": row["detection_delay_s"],
        "missed": sum(not c["detected"] for c in contacts) / len(contacts) if contacts else None,
        "false_detections": float(row["false_detections"]),
    }


_PEAKS = {
    "peak_estimate_n": "peak of the force estimate [N]",
    "true_peak_n": "peak of the true force [N]",
    "true_peak_20ms_n": "peak of the true force's mean over 20 ms [N]",
}
_FALSE = {"false_detections": "reactions that nothing caused"}


def _static_cost(setting: Setting) -> float:
    slow = isinstance(setting.profile.approach, ApproachRestriction)
    return (1.6 if slow else 0.3) + 0.006 * (setting.units or 7)


CLOSED_LOOP = (
    Measure(
        "static", "the arm runs into a board (paper IV-A)", "paper:approach=none", StaticScene(),
        {
            **_PEAKS, "delay_s": "time from the touch to the reaction [s]",
            "impact_speed_m_s": "speed of the touch [m/s]", "contact": "whether it touched the board",
            "missed": "whether a touch was not detected", **_FALSE,
        },
        _static, _static_cost,
    ),
    Measure(
        "avoidance", "a person's hand beside the circle or in it (paper IV-B)", "paper", AvoidanceScene(),
        {
            "least_gap_m": "least true distance from the person's hand [m]", "true_peak_n": _PEAKS["true_peak_n"],
            "deviation_m": "farthest from the path [m]", "travelled_m": "way along the path [m]",
            "contact": "whether it touched the hand", **_FALSE,
        },
        _avoidance, lambda _: 2.5,
    ),
    Measure(
        "dynamic", "a person pushes the arm now and then (paper IV-C)", "paper", DynamicScene(),
        {**_PEAKS, "delay_s": "median time from a push to the reaction [s]",
         "missed": "part of the pushes not detected", **_FALSE},
        _dynamic, lambda _: 2.5,
    ),
)  # fmt: skip
"""Experiments in which the arm reacts: every parameter of the profile may matter."""
