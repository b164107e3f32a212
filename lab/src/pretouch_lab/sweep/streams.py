"""Experiments on streams of arms that do not react: recorded once for each arm and skin, replayed for each detector."""

from dataclasses import dataclass
from typing import Annotated, Literal, cast

import numpy as np

from pretouch.checks import Check, Checked, NonNegative
from pretouch.contact.reaction import DecayingVelocity
from pretouch.errors import ExperimentError
from pretouch_lab.baselines.detection import Baseline
from pretouch_lab.benchmarks.detection.arm import Sensing, model
from pretouch_lab.benchmarks.detection.contacts import ContactCell, contact_stream, touches_of
from pretouch_lab.benchmarks.detection.free import FreeCell, free_stream
from pretouch_lab.benchmarks.detection.judge import BUSY, PERIOD_S, matched
from pretouch_lab.benchmarks.detection.replay import begun, replay
from pretouch_lab.benchmarks.detection.stream import Stream
from pretouch_lab.sweep.measures import CLOSED_LOOP, Measure, Numbers
from pretouch_lab.sweep.setting import Setting

_HAND_RADIUS_M = 0.05
_DETECTION = ("window", "detect")
_REPLAY_S = 0.0015
"""Processor time of a replayed second [s]."""


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


def _detector(setting: Setting) -> Baseline:
    by_force = not setting.profile.detect.by_torques
    return Baseline("swept", setting.profile_text, "f_base_n" if by_force else "scale")


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


def _units(setting: Setting) -> int:
    return setting.units or 7


def _free_s(setting: Setting) -> float:
    scene = cast(FreeScene, setting.scene)
    return scene.warm_up_s + scene.counted_s


def _contacts_s(setting: Setting) -> float:
    scene = cast(ContactScene, setting.scene)
    return scene.warm_up_s + 3.5 * scene.contacts


ON_STREAMS = (
    Measure(
        "free-motion", "an arm that nothing touches, somebody passing", "paper", FreeScene(),
        {
            "false_alarms_per_hour": "false alarms an hour [1/h]", "alarms": "false alarms counted",
            "least_margin_n": "what the force missed of a threshold, at the least [N]; negative with an alarm",
        },
        _free, lambda s: _REPLAY_S * _free_s(s), (*_DETECTION, "react.decay_cycles"),
        _free_stream, lambda s: (0.04 + 0.0006 * _units(s)) * _free_s(s),
    ),
    Measure(
        "contacts", "an arm that is touched on all links and does not react", "paper", ContactScene(),
        {"delay_s": "median time from a contact to its alarm [s]", "missed": "part of the contacts not detected"},
        _contacts, lambda s: _REPLAY_S * _contacts_s(s), _DETECTION,
        _contact_stream, lambda s: (0.05 + 0.0006 * _units(s)) * _contacts_s(s),
    ),
)  # fmt: skip
"""Experiments whose arm does nothing: only detection and what it is given matter."""
MEASURES: dict[str, Measure] = {m.name: m for m in (*CLOSED_LOOP, *ON_STREAMS)}
"""All experiments that can be swept, by name."""


def measure(name: str) -> Measure:
    """Look an experiment up. Raises ExperimentError."""
    if name not in MEASURES:
        raise ExperimentError(f"The experiment {name!r} cannot be swept: choose from {', '.join(MEASURES)}.")
    return MEASURES[name]
