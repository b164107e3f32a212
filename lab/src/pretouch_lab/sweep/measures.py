"""What can be swept: experiments as functions of a setting that return numbers, the existing trials and their rows."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any, Literal, cast

import numpy as np

from pretouch.checks import Check, Checked, NonNegative, Positive
from pretouch.contact.reaction import DecayingVelocity
from pretouch.errors import ExperimentError
from pretouch.profiles import Profile
from pretouch_lab.bench.contacts import ContactCell, contact_stream, touches_of
from pretouch_lab.bench.contenders import Contender
from pretouch_lab.bench.detection import BUSY, PERIOD_S, begun, matched, replay
from pretouch_lab.bench.free import FreeCell, free_stream
from pretouch_lab.bench.scenes import Sensing, model
from pretouch_lab.bench.streams import Stream
from pretouch_lab.experiment import Context
from pretouch_lab.experiments import avoidance, dynamic, static
from pretouch_lab.run import Row
from pretouch_lab.sweep.parameters import Setting

_HAND_RADIUS_M = 0.05
_DETECTION = ("window", "detect")
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
    groups: tuple[str, ...] | None = None
    """Groups of the profile, or single parameters, that can change something; None: all of them."""
    shared: Callable[[Setting], Any] | None = None
    """Makes what cells with the same `Setting.world` have in common: a recorded stream."""

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


CLOSED_LOOP = (
    Measure(
        "static",
        "the arm runs into a board (paper IV-A)",
        "paper:approach=none",
        StaticScene(),
        {
            **_PEAKS,
            "delay_s": "time from the touch to the reaction [s]",
            "impact_speed_m_s": "speed of the touch [m/s]",
            "contact": "whether it touched the board",
            "missed": "whether a touch was not detected",
            **_FALSE,
        },
        _static,
    ),
    Measure(
        "avoidance",
        "a person's hand beside the circle or in it (paper IV-B)",
        "paper",
        AvoidanceScene(),
        {
            "least_gap_m": "least true distance from the person's hand [m]",
            "true_peak_n": _PEAKS["true_peak_n"],
            "deviation_m": "farthest from the path [m]",
            "travelled_m": "way along the path [m]",
            "contact": "whether it touched the hand",
            **_FALSE,
        },
        _avoidance,
    ),
    Measure(
        "dynamic",
        "a person pushes the arm now and then (paper IV-C)",
        "paper",
        DynamicScene(),
        {
            **_PEAKS,
            "delay_s": "median time from a push to the reaction [s]",
            "missed": "part of the pushes not detected",
            **_FALSE,
        },
        _dynamic,
    ),
)
"""Experiments in which the arm reacts: every parameter of the profile may matter."""


@dataclass(frozen=True)
class FreeScene(Checked):
    """An arm that nothing touches."""

    path: Literal["circle", "line", "rest"] = "circle"
    speed_m_s: NonNegative = 0.3
    near: Literal["nothing", "standing", "passing"] = "passing"
    """Who is near."""
    warm_up_s: Annotated[float, Check(low=2.0, high=3600.0)] = 5.0
    """Time in which no alarm counts [s]; detectors that learn need a minute."""
    counted_s: Annotated[float, Check(low=1.0, high=36_000.0)] = 60.0
    """Time that counts [s]."""


@dataclass(frozen=True)
class ContactScene(Checked):
    """An arm that is touched again and again, with forces and durations of the detection benchmark."""

    speed_m_s: NonNegative = 0.3
    warm_up_s: Annotated[float, Check(low=2.0, high=3600.0)] = 5.0
    """Time before the first contact [s]; detectors that learn need a minute."""
    contacts: Annotated[int, Check(low=1, high=1000)] = 10


def _sensing(setting: Setting) -> Sensing:
    return Sensing(setting.skin, setting.skin, setting.sensing, _HAND_RADIUS_M)


def _detector(setting: Setting) -> Contender:
    by_force = not setting.profile.detect.by_torques
    return Contender("swept", setting.profile_text, "f_base_n" if by_force else "scale")


def _free_stream(setting: Setting) -> Stream:
    scene = cast(FreeScene, setting.scene)
    cell = FreeCell("swept", scene.path, scene.speed_m_s, scene.near, setting.seed, scene.counted_s)
    return free_stream(cell, setting.plant, _sensing(setting), scene.warm_up_s)


def _free(setting: Setting, stream: Stream) -> Numbers:
    """Count alarms, and say how far the force came from its threshold, on the axis where it came nearest."""
    scene, detector = cast(FreeScene, setting.scene), _detector(setting)
    made = replay(stream, detector, model())
    counted = made.stamp >= scene.warm_up_s
    busy = DecayingVelocity.of(setting.profile.react, PERIOD_S).decay_cycles
    alarms = int(counted[begun(made.alarm, busy)].sum())
    most = float(made.statistic[counted].max(initial=-np.inf))
    margin = detector.default - most if detector.sweep == "f_base_n" and np.isfinite(most) else None
    hours = float(counted.sum()) * PERIOD_S / 3600
    return {"false_alarms_per_hour": alarms / hours, "alarms": float(alarms), "least_margin_n": margin}


def _contact_stream(setting: Setting) -> Stream:
    scene = cast(ContactScene, setting.scene)
    cell = ContactCell("swept", "swept", scene.speed_m_s, setting.seed, scene.contacts)
    return contact_stream(cell, setting.plant, _sensing(setting), scene.warm_up_s)


def _contacts(setting: Setting, stream: Stream) -> Numbers:
    """Delay of what was detected, and how much was missed; what fell into the answer to an earlier alarm is neither."""
    made = replay(stream, _detector(setting), model())
    found = [delay for delay, _ in matched(touches_of(stream), made.stamp, made.onsets()) if delay != BUSY]
    delays = [delay for delay in found if delay is not None]
    return {
        "delay_s": float(np.median(delays)) if delays else None,
        "missed": 1.0 - len(delays) / len(found) if found else None,
    }


ON_STREAMS = (
    Measure(
        "free-motion",
        "an arm that nothing touches, somebody passing",
        "paper",
        FreeScene(),
        {
            "false_alarms_per_hour": "false alarms an hour [1/h]",
            "alarms": "false alarms counted",
            "least_margin_n": "what the force missed of a threshold, at the least [N]; negative with an alarm",
        },
        _free,
        (*_DETECTION, "react.decay_cycles"),
        _free_stream,
    ),
    Measure(
        "contacts",
        "an arm that is touched on all links and does not react",
        "paper",
        ContactScene(),
        {"delay_s": "median time from a contact to its alarm [s]", "missed": "part of the contacts not detected"},
        _contacts,
        _DETECTION,
        _contact_stream,
    ),
)
"""Experiments whose arm does nothing: only detection and what it is given matter."""
MEASURES: dict[str, Measure] = {m.name: m for m in (*CLOSED_LOOP, *ON_STREAMS)}
"""All experiments that can be swept, by name."""


def measure(name: str) -> Measure:
    """Look an experiment up. Raises ExperimentError."""
    if name not in MEASURES:
        raise ExperimentError(f"The experiment {name!r} cannot be swept: choose from {', '.join(MEASURES)}.")
    return MEASURES[name]
