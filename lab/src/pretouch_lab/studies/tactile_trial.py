"""One trial of `tactile`: an arm is recorded while touched; contacts are detected with touch sensors and without."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from pretouch.profiles import profile
from pretouch.robot.vectors import placed
from pretouch.sensing.skin import Skin
from pretouch.sensing.unit import SensorUnit, TouchPatch
from pretouch.sim.plant import Plant
from pretouch.sim.touch_sensor import TouchSensorParams, TouchSensors
from pretouch.types import BoolArray, FloatArray, TouchReadings
from pretouch_lab.baselines.detection import Baseline
from pretouch_lab.benchmarks.dense_skin import gap
from pretouch_lab.benchmarks.detection.arm import AWAY, Alone, model, path_of, plant_of, record, sensing_of
from pretouch_lab.benchmarks.detection.contacts import Toucher, Touching, place_on, start_posture
from pretouch_lab.benchmarks.detection.judge import matched
from pretouch_lab.benchmarks.detection.replay import replay
from pretouch_lab.benchmarks.detection.stream import Stream
from pretouch_lab.benchmarks.localization.judge import said_of
from pretouch_lab.cell import Cell, Context
from pretouch_lab.rows import Row, rounded
from pretouch_lab.studies.calibration.random_skin import random_skin
from pretouch_lab.studies.located import SIDES
from pretouch_lab.studies.tactile_kinds import (
    BESIDE,
    COUNT,
    FORCES_N,
    FREE_S,
    INNER,
    INNER_KINDS,
    INNER_LINKS,
    INNER_N,
    KINDS,
    NOWHERE,
    PROFILE,
    WARM_UP_S,
)

DETECTORS = dict(zip(SIDES, ("pretouch:detect.cues=none", "pretouch"), strict=True))
"""Profiles that are given the same stream and the same touches."""
FALSE_PER_HOUR = 600.0
"""Rate of false touches of each unit where there are no contacts [1/h]: often enough to be counted, and for the unit's
account to stay nearly empty."""

_SPEED_M_S = 0.3
_GAP_S = (2.6, 3.2)
"""From the end of a contact to the start of the next, uniform [s]: as in the benchmark."""
_TILT = 0.25
_TRIES = 400
_LATE_S = 0.4


def with_touch_sensors(skin: Skin) -> Skin:
    """Return a skin whose units have touch sensors: its own, or the usual one at each unit where none has one."""
    return skin if len(skin.touching) else Skin([replace(unit, touch=TouchPatch()) for unit in skin.units], model())


def inner_skin(skin: Skin) -> Skin:
    """Return a skin with more units, all with touch sensors: those of the skin of 32 on links 2 to 4, and one on 1."""
    links = [f"{model().description.name}_{name}" for name in INNER_LINKS]
    more = [unit for unit in sensing_of("nominal", 0).skin.units if unit.link in links]
    units = [*skin.units, *more, _within_reach(links[0])]
    return Skin([unit if unit.touch else replace(unit, touch=TouchPatch()) for unit in units], model())


def _within_reach(link: str) -> SensorUnit:
    """Return a unit on a link, the first of random ones that a hand can come to."""
    arm, kin = model(), model().kinematics(start_posture())
    a, b = placed(arm.capsules, kin)
    index = arm.link_index(link)
    for seed in range(_TRIES):
        unit = next(unit for unit in random_skin(arm, seed, first_link=True).units if unit.link == link)
        T = unit.T_link_sensor
        beam = T[:3, 3] + np.outer(np.linspace(_CLEAR_M, _FROM_M, 9), T[:3, 2])
        if gap(beam @ kin.rotation[index].T + kin.position[index], a, b, arm.capsules.radius).min() > 0.5 * _CLEAR_M:
            break
    return unit


def plan(skin: Skin, place: str, seed: int, hand_radius: float) -> list[Touching]:
    """Draw the contacts of a trial: where, how hard, how long and when."""
    rng, at, found = np.random.default_rng([seed, 51]), WARM_UP_S, []
    own, kinds, forces = skin.touching, KINDS, FORCES_N
    inner = [model().link_index(f"{model().description.name}_{name}") for name in INNER_LINKS]
    if place == INNER:
        kinds, forces = INNER_KINDS, INNER_N
    for _ in range(COUNT if place != NOWHERE else 0):
        if place == INNER:
            own = skin.touching[skin.link[skin.touching] == rng.choice(inner)]
        unit = int(rng.choice(own))
        point, normal = _beside(skin, unit, hand_radius, rng) if place == BESIDE else _on_patch(skin, unit, rng)
        kind, duration, rise = kinds[int(rng.integers(len(kinds)))]
        inwards = _TILT * rng.uniform(-1, 1, 3) - normal
        found.append(Touching(
            int(skin.link[unit]), kind, float(rng.choice(forces)), rise, duration, at, point, normal,
            inwards / np.linalg.norm(inwards),
        ))  # fmt: skip
        at = found[-1].end + rng.uniform(*_GAP_S)
    return found


def _on_patch(skin: Skin, unit: int, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Draw a point of a unit's patch, evenly, and the unit's axis (3,), link frame."""
    T, touch = skin.T_link_sensor[unit], skin.units[unit].touch or TouchPatch()
    out, turn = touch.radius * np.sqrt(rng.uniform()), rng.uniform(0, 2 * np.pi)
    return T[:3, 3] + T[:3, :3] @ np.array([out * np.cos(turn), out * np.sin(turn), 0.0]), T[:3, 2].copy()


def _beside(skin: Skin, unit: int, hand_radius: float, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Draw a point of the link's surface that no patch reaches, and its normal (3,), link frame."""
    link = int(skin.link[unit])
    own = [k for k in skin.touching if skin.link[k] == link]
    reach = max(touch.radius for k in own if (touch := skin.units[k].touch) is not None)
    for _ in range(_TRIES):
        point, normal = place_on(link, start_posture(), hand_radius, rng, _FROM_M)
        if all(np.linalg.norm(point - skin.T_link_sensor[k, :3, 3]) > 2 * reach for k in own):
            break
    return point, normal


_FROM_M = 0.4
"""How far away the hand comes from [m]: as in the benchmark."""
_CLEAR_M = 0.05
"""From where on its way has to be free [m]."""


@dataclass(frozen=True)
class Course:
    """One recorded arm: its stream, what its touch sensors said in each step, and the contacts laid on it."""

    stream: Stream
    touch: list[TouchReadings]
    touches: list[Touching]


def recorded(skin: Skin, place: str, seen: bool, seed: int, free_s: float = FREE_S) -> Course:
    """Let an arm run that goes on whatever touches it, and record it."""
    sensing = sensing_of("seven", seed, skin)
    touches = plan(skin, place, seed, sensing.hand_radius)
    end = touches[-1].end + _LATE_S if touches else WARM_UP_S + free_s
    params = TouchSensorParams(false_per_hour=0.0 if touches else FALSE_PER_HOUR)
    what = Alone(path_of("circle"), _SPEED_M_S, plant_of("nominal"), sensing, sensing.hand_radius, seed, end)
    attached: list[TouchSensors] = []
    said: list[TouchReadings] = []

    def prepare(plant: Plant) -> Callable[[float], FloatArray]:
        toucher = Toucher(plant, touches, sensing.hand_radius)
        attached.append(TouchSensors(plant, skin, params, seed, toucher.forces))
        return toucher.hand if seen else lambda _time: AWAY

    stream = record(what, prepare, lambda *_: said.append(attached[0].touch()))
    return Course(stream, said, touches)


def played(cell: Cell, seed: int, context: Context, free_s: float = FREE_S) -> tuple[Row, None]:
    """Run one trial; return its row of results."""
    place = str(cell.where["place"])
    skin = inner_skin(context.skin) if place == INNER else with_touch_sensors(context.skin)
    course = recorded(skin, place, cell.where["hand"] == "seen", seed, free_s)
    made = {
        name: replay(course.stream, Baseline(name, text, "scale"), model(), course.touch.__getitem__, skin)
        for name, text in DETECTORS.items()
    }
    row: Row = cell.row(seed)
    if not course.touches:
        counted = course.stream.stamp >= WARM_UP_S
        row["free"] = {
            "hours": rounded(float(counted.sum()) * profile(PROFILE).task.control_period_s / 3600, 6),
            "false_touches": _false_touches(course, counted),
            **{name: int(counted[found.onsets()].sum()) for name, found in made.items()},
        }
        return row, None
    delays = {
        name: [delay for delay, _ in matched(course.touches, found.stamp, found.onsets())]
        for name, found in made.items()
    }
    row["contacts"] = [
        {
            "link": model().links[touch.link],
            "force_n": touch.force_n,
            "duration_s": touch.duration_s,
            "heard_s": _heard(course, touch),
            **{name: None if found[k] is None else rounded(found[k] or 0.0, 4) for name, found in delays.items()},
            "where": {
                name: said_of(touch, found.stamp, found.touched, course.stream.robot["q"])
                for name, found in made.items()
            },
        }
        for k, touch in enumerate(course.touches)
    ]
    return row, None


def _said(course: Course) -> BoolArray:
    """Return whether each unit (S, K) said that it is touched."""
    return np.array([t.contact & np.isfinite(t.stamp) for t in course.touch])


def _false_touches(course: Course, counted: BoolArray) -> int:
    begun = np.diff(_said(course).astype(np.int64), axis=0, prepend=0) > 0
    return int(begun[counted].sum())


def _heard(course: Course, touch: Touching) -> float | None:
    """Time from a contact's onset until a unit's touch was heard of [s], None if none was."""
    stamp, onset = course.stream.stamp, touch.onset(1.0)
    during = (stamp > onset) & (stamp <= touch.end + 0.1)
    heard = stamp[during & _said(course).any(axis=1)]
    return rounded(float(heard[0]) - onset, 4) if len(heard) else None
