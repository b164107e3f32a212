"""Contact detectors held against each other: each is given the recorded streams, and its alarms are judged.

In free motion alarms are counted; on arms that are touched they are matched with the contacts that caused them.
"""

from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from pretouch.contact.reaction import DecayingVelocity
from pretouch.params import TaskParams
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.types import NOT_TOUCHED, BoolArray, FloatArray, Touched, TouchReadings
from pretouch_lab.bench.contacts import ContactCell, Touching, contact_cells, contact_stream, touches_of
from pretouch_lab.bench.contenders import DETECTORS, Contender, ablated
from pretouch_lab.bench.free import FreeCell, free_cells, free_stream, warm_up_s
from pretouch_lab.bench.hard import HardCell, hard_cells, hard_stream
from pretouch_lab.bench.scenes import SeedRange, model, plant_of, scenario, sensing_of
from pretouch_lab.bench.streams import NOTHING, Stream, load_stream, save_stream
from pretouch_lab.replay import DetectorAlone, FirstMotion
from pretouch_lab.run import Cell, Play, Row
from pretouch_lab.table import rounded

FAMILIES = ("free", "contacts", "hard")
ABLATED_ARMS = 2
"""Arms of each path and neighbour in free motion that ablations are given."""
REST = DecayingVelocity().decay_cycles
"""Control cycles for which an alarm is answered, and no other is looked for."""
PERIOD_S = TaskParams().control_period_s
BUSY = -1.0
"""In place of a delay: an earlier alarm was still being answered when the contact began."""
Touches = Callable[[int], TouchReadings | None]
"""Gives what the units' touch sensors said in a step, by its number."""
Match = tuple[float | None, int | None]
"""Delay [s] of the first alarm a contact caused, and the step of that alarm: (None, None) of a missed contact, (BUSY,
None) where an earlier alarm was still being answered."""
ArmCell = FreeCell | ContactCell | HardCell


def arm_cells(seeds: SeedRange, quick: bool, world: str = "") -> dict[str, list[ArmCell]]:
    """Return the arms of each family; those of the family hard have a world of their own, and with another are none."""
    return {
        "free": [replace(cell, world=world) for cell in free_cells(seeds, quick)],
        "contacts": [replace(cell, world=world) for cell in contact_cells(seeds, quick)],
        "hard": [] if world else [*hard_cells(seeds, quick)],
    }


def stream_plays(cells: dict[str, list[ArmCell]]) -> list[Play]:
    """Return the streams to record, the long ones of contacts first."""
    return [
        ({"family": family, "name": cell.name}, cell.seed) for family in reversed(FAMILIES) for cell in cells[family]
    ]


def plays(cells: dict[str, list[ArmCell]]) -> list[Play]:
    """Return the replays: each stream with each detector that it is given to."""
    return [
        ({"family": family, "name": cell.name, "contender": contender.name}, cell.seed)
        for family in FAMILIES
        for cell in cells[family]
        for contender in _contenders(cell, cells["free"])
    ]


def _contenders(cell: ArmCell, free: list[ArmCell]) -> tuple[Contender, ...]:
    """Return the detectors that are given an arm's stream: ablations only what the goals are about."""
    if isinstance(cell, HardCell):
        return DETECTORS
    whole = cell.kind == "nominal" and cell.speed_m_s == scenario("contacts")["goal"]["speed_m_s"]
    if isinstance(cell, FreeCell):
        same = [c for c in free if isinstance(c, FreeCell) and _where(c) == _where(cell)]
        whole = whole and cell in same[:ABLATED_ARMS]
    else:
        whole = whole and cell.sensing == "nominal"
    return (*DETECTORS, *ablated()) if whole else DETECTORS


def _where(cell: FreeCell) -> tuple[str, str, float, str]:
    return cell.kind, cell.path, cell.speed_m_s, cell.near


@dataclass(frozen=True)
class Streams:
    """The streams of a run, in its folder."""

    out: Path
    seeds: SeedRange
    quick: bool
    world: str = ""

    def cell(self, family: str, name: str) -> ArmCell:
        """Return an arm by the name of its cell."""
        return _by_name(self.seeds, self.quick, self.world)[family, name]

    def stream(self, family: str, name: str) -> Stream:
        """Return the stream of an arm, recorded now where none can be read."""
        arm = self.cell(family, name)
        file = self.out / "streams" / f"{family}_{name}.npz"
        stored = load_stream(file)
        if stored is not None:
            return stored
        if isinstance(arm, FreeCell):
            stream = free_stream(arm, plant_of(arm.kind), sensing_of("seven", arm.seed), warm_up_s())
        elif isinstance(arm, ContactCell):
            stream = contact_stream(arm, plant_of(arm.kind), sensing_of(arm.sensing, arm.seed))
        else:
            stream = hard_stream(arm, self.quick)
        save_stream(stream, file)
        return stream

    def record(self, cell: Cell, _seed: int) -> Row:
        """Record the stream of one arm, before several detectors are given it."""
        return {"steps": len(self.stream(cell["family"], cell["name"]).count)}

    def judge(self, cell: Cell, _seed: int) -> Row:
        """Give one arm's stream to one detector, and judge its alarms."""
        arm, stream = self.cell(cell["family"], cell["name"]), self.stream(cell["family"], cell["name"])
        contender = next(c for c in (*DETECTORS, *ablated()) if c.name == cell["contender"])
        touched = isinstance(arm, ContactCell) or (isinstance(arm, HardCell) and arm.near == "touched")
        return asdict(arm) | (judged_contacts(stream, contender) if touched else judged_free(stream, contender))


@cache
def _by_name(seeds: SeedRange, quick: bool, world: str) -> dict[tuple[str, str], ArmCell]:
    cells = arm_cells(seeds, quick, world)
    return {(family, cell.name): cell for family, some in cells.items() for cell in some}


@dataclass(frozen=True)
class Replayed:
    """What a detector made of S steps."""

    stamp: FloatArray
    """(S,) [s]."""
    alarm: BoolArray
    """(S,) whether a contact was found."""
    force: FloatArray
    """(S, 3) force it was taken for [N], NaN where none was found."""
    motion: FloatArray
    """(S, n) joint velocities with which the arm would begin to move in answer to an alarm [rad/s], else NaN."""
    statistic: FloatArray
    """(S,) see `Contender.statistic`."""
    touched: list[Touched]
    """Where the arm was said to be touched in each of these steps."""

    def onsets(self, value: float | None = None) -> list[int]:
        """Return the steps at which an alarm begins; with another value of the sweep than the detector's, if given."""
        return begun(self.alarm if value is None else self.statistic > value)


def begun(alarm: BoolArray, rest: int = REST) -> list[int]:
    """Steps at which an alarm begins, given those (S,) with one: each is answered for `rest` steps."""
    at, found, i = np.flatnonzero(alarm), [], 0
    while i < len(at):
        found.append(int(at[i]))
        i = int(np.searchsorted(at, at[i] + rest))
    return found


def replay(
    stream: Stream, contender: Contender, model: RobotModel, touch: Touches = lambda step: None,
    skin: Skin | None = None,
) -> Replayed:  # fmt: skip
    """Give a detector each step of a stream, from its beginning, and what units said of a touch."""
    params = contender.profile
    sees = params.perception is not None
    detector, steps = DetectorAlone(params, model, skin), len(stream.count)
    alarm, statistic = np.zeros(steps, np.bool_), np.empty(steps)
    force, touched = np.full((steps, 3), np.nan), [NOT_TOUCHED] * steps
    motion, first = np.full((steps, model.n), np.nan), FirstMotion(model, params, stream.robot["q"][0], REST)
    for i, (robot, obstacles, reacting, watched) in enumerate(stream.steps()):
        near = obstacles if sees else NOTHING
        kin = model.kinematics(robot.q)
        found = detector.step(kin, robot, near, reacting, sees and watched, touch(i))
        touched[i] = found.touched
        statistic[i] = contender.statistic(found, detector.window.newest, robot.wrench)
        if found.contact is not None:
            alarm[i], force[i] = True, found.contact.force
        begins = first.step(kin, robot, found, near)
        if begins is not None:
            motion[i] = begins
    return Replayed(stream.stamp, alarm, force, motion, statistic, touched)


def sweep_values(contender: Contender) -> list[float]:
    """Return the values at which a contender's swept parameter is looked at."""
    return [float(value) for value in scenario("free")["curve"][contender.sweep]]


def judged_free(stream: Stream, contender: Contender) -> Row:
    """Count a detector's alarms in free motion after the warm-up, as it is and at each value of its sweep."""
    made = replay(stream, contender, model())
    counted = made.stamp >= warm_up_s()

    def alarms(onsets: list[int]) -> int:
        return int(counted[onsets].sum())

    return {
        "hours": float(counted.sum()) * PERIOD_S / 3600,
        "alarms": alarms(made.onsets()),
        "sweep": [alarms(made.onsets(value)) for value in sweep_values(contender)],
    }


def judged_contacts(stream: Stream, contender: Contender) -> Row:
    """Match a detector's alarms with the contacts of a stream, as it is and at each value of its sweep."""
    made = replay(stream, contender, model())
    touches = touches_of(stream)
    found = matched(touches, made.stamp, made.onsets())
    swept = [matched(touches, made.stamp, made.onsets(value)) for value in sweep_values(contender)]
    noise = quiet_spread(stream, touches[0].start)
    contacts = [
        {
            **about(touch, stream, noise),
            "delay_s": _delay(found[k]),
            "towards": _towards(found[k], touch, stream, made),
            "sweep_s": [_delay(at[k]) for at in swept],
        }
        for k, touch in enumerate(touches)
    ]
    return {"contacts": contacts}


def matched(touches: list[Touching], stamp: FloatArray, onsets: list[int]) -> list[Match]:
    """Match alarms, by the steps at which they begin, with contacts.

    A contact has the first alarm from its onset until some time after its end; both are said by the scenario file.
    """
    judged = scenario("contacts")["judged"]
    at = stamp[onsets]
    found: list[Match] = []
    for touch in touches:
        onset = touch.onset(judged["onset_n"])
        first = int(np.searchsorted(at, onset, side="right"))
        if first > 0 and at[first - 1] > onset - REST * PERIOD_S:
            found.append((BUSY, None))
        elif first < len(at) and at[first] <= touch.end + judged["late_s"]:
            found.append((float(at[first]) - onset, onsets[first]))
        else:
            found.append((None, None))
    return found


def quiet_spread(stream: Stream, until: float) -> FloatArray:
    """Standard deviation (n,) of each joint's external torque [Nm] in the second half of the time until an instant [s].

    That is the free motion of the very arm that is touched afterwards.
    """
    quiet = (stream.stamp >= 0.5 * until) & (stream.stamp < until)
    return np.asarray(stream.robot["tau_ext"][quiet].std(axis=0))


def about(touch: Touching, stream: Stream, noise: FloatArray) -> dict[str, Any]:
    """Say of a contact where and how it was, whether it was seen, and whether its torques stand out of the noise."""
    family = scenario("contacts")
    judged, kinds = family["judged"], family["contact"]["kind"]
    step = max(0, int(np.searchsorted(stream.stamp, touch.onset(judged["onset_n"]), side="right")) - 1)
    kin = model().kinematics(stream.robot["q"][step])
    rotation, origin = kin.rotation[touch.link], kin.position[touch.link]
    radius = float(stream.truth["hand_radius"])
    hand = origin + rotation @ (touch.point + radius * touch.normal)
    away = np.linalg.norm(stream.obstacle_points(step) - hand, axis=1).min(initial=np.inf) - radius
    jacobian = model().jacobian(kin, touch.link, origin + rotation @ touch.point)[:3]
    torque = np.abs(jacobian.T @ (touch.force_n * (rotation @ touch.inwards)))
    name = model().links[touch.link].removeprefix(f"{model().description.name}_")
    return {
        "link": name,
        "kind": kinds[touch.kind]["name"],
        "force_n": touch.force_n,
        "duration_s": touch.duration_s,
        "seen": bool(away <= judged["seen_m"]),
        "detectable": bool(np.any(torque > judged["feelable_sigmas"] * noise)),
    }


def _delay(match: Match) -> float | None:
    return None if match[0] is None else rounded(match[0], 4)


def _towards(match: Match, touch: Touching, stream: Stream, made: Replayed) -> bool | None:
    """Whether the touched point would begin to move against the force on it, towards the person."""
    if match[1] is None:
        return None
    moving = np.flatnonzero(np.isfinite(made.motion[match[1] : match[1] + REST, 0]))
    if not len(moving):
        return False
    step = match[1] + int(moving[0])
    kin = model().kinematics(stream.robot["q"][step])
    rotation = kin.rotation[touch.link]
    there = model().jacobian(kin, touch.link, kin.position[touch.link] + rotation @ touch.point)[:3]
    return bool((rotation @ touch.inwards) @ there @ made.motion[step] < 0.0)
