"""Where the localiser says that contacts are, held against where they are."""

import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from pretouch.atomic_write import write_json
from pretouch.profiles import profile
from pretouch.robot.kinematics import Kinematics
from pretouch.types import FloatArray, Touched
from pretouch_lab.benchmarks.detection.arm import model
from pretouch_lab.benchmarks.detection.contacts import Touching, touches_of
from pretouch_lab.benchmarks.detection.replay import NOTHING
from pretouch_lab.benchmarks.detection.stream import Stream, load_stream
from pretouch_lab.benchmarks.localization.contacts import TouchedCell
from pretouch_lab.benchmarks.localization.limit import position_limit
from pretouch_lab.benchmarks.scenario_files import scenario
from pretouch_lab.replay import DetectorAlone
from pretouch_lab.run import Row
from pretouch_lab.table import rounded

PROFILE = "pretouch"
WITHOUT = ("none", "none, nothing learnt")
"""Skins of which there is no stream: that of 32 units is replayed as if it saw nothing. Free motion is learnt in the
warm-up, in which somebody sees to it that nobody is near, or not at all."""
_BEFORE_S, _AFTER_S = 0.1, 0.2
"""Time about each contact of which what was said is kept [s]."""


@dataclass(frozen=True)
class Said:
    """What the localiser said about contacts."""

    stamp: FloatArray
    """(S,) [s]"""
    touched: list[Touched]
    """Of each of these steps."""
    q: FloatArray
    """(S, n) postures [rad]."""
    spread: FloatArray
    """(S, n, n) of a sample of the torques, standing in for that of each step [Nm^2]."""
    busy: FloatArray
    """(B,) processor time of steps in which something was localised [s]."""

    def at(self, instant: float) -> int:
        """Return the last step not later than an instant [s]."""
        return step_at(self.stamp, instant)


def step_at(stamp: FloatArray, instant: float) -> int:
    """Return the last of steps at these instants (S,) [s] not later than another one [s]."""
    return max(0, int(np.searchsorted(stamp, instant + 1e-9, side="right")) - 1)


def name_of(link: int) -> str:
    """Name the rigid body of a link by its last link, as `hand` for link 7, flange and hand."""
    arm = model()
    named = [scenario("localization")["contact"]["links"], arm.description.name]
    last = [n for n in named[0] if arm.rigid[arm.link_index(f"{named[1]}_{n}")] == arm.rigid[link]]
    return str(last[-1])


def judge_touched(cell: TouchedCell, skin: str, stream: Path, file: Path) -> None:
    """Replay a cell's stream and hold what is said against its contacts; one JSON object."""
    kept = load_stream(stream)
    touches = touches_of(kept)
    said = replayed(kept, skin, touches)
    found = [_one(touch, said) for touch in touches]
    busy = np.sort(said.busy) if len(said.busy) else np.array([np.nan])
    row: Row = {
        **asdict(cell), "skin": skin, "found": found,
        "median_s": rounded(float(np.median(busy)), 7), "p99_s": rounded(float(np.percentile(busy, 99)), 7),
    }  # fmt: skip
    write_json(row, file)


def replayed(stream: Stream, skin: str, touches: list[Touching]) -> Said:
    """Give the profile each step of a stream, as with the skin that is named."""
    params, arm = profile(PROFILE), model()
    detector, blind = DetectorAlone(params, arm), skin in WITHOUT
    warm = scenario("localization")["duration"]["warm_up_s"]
    start, end = (np.array([getattr(touch, name) for touch in touches]) for name in ("start", "end"))
    start, end = np.sort(start) - _BEFORE_S, np.sort(end) + _AFTER_S
    stamps, touched, q, spread, busy = [], [], [], [], []
    for robot, obstacles, _, watched in stream.steps():
        near = NOTHING if blind else obstacles
        sees = watched and skin != WITHOUT[1] and (not blind or robot.stamp < warm - 1.0)
        kin = arm.kinematics(robot.q)
        begun = time.thread_time()
        found = detector.step(kin, robot, near, False, sees)
        taken = time.thread_time() - begun
        if len(found.touched.link):
            busy.append(taken)
        k = int(np.searchsorted(start, robot.stamp, side="right")) - 1
        if k >= 0 and robot.stamp <= end[k]:
            stamps.append(robot.stamp)
            touched.append(found.touched)
            q.append(robot.q)
            spread.append(detector.state.test.model.spread)
    return Said(np.array(stamps), touched, np.array(q), np.array(spread), np.array(busy))


def place_of(touch: Touching, kin: Kinematics) -> FloatArray:
    """Where a contact is in a posture (3,) [m], base frame."""
    return np.asarray(kin.position[touch.link] + kin.rotation[touch.link] @ touch.point)


def judged_s(touch: Touching) -> float:
    """Time after its start at which a contact is judged [s]: the scenario file's, or its end if that is earlier."""
    return float(min(scenario("localization")["judged"]["after_s"], touch.duration_s))


def place_said(touch: Touching, found: Touched, q: FloatArray, when: str = "") -> Row:
    """Hold what was said in a posture (n,) [rad] against where the contact was; `when` ends the names of values."""
    rigid, kin = model().rigid, model().kinematics(q)
    detected = len(found.link) > 0
    off = float(np.linalg.norm(found.point[0] - place_of(touch, kin))) if detected else None
    return {
        f"detected{when}": detected,
        f"right{when}": detected and bool(rigid[found.link[0]] == rigid[touch.link]),
        f"error{when}_m": None if off is None else rounded(off, 5),
        f"taken_for{when}": name_of(int(found.link[0])) if detected else None,
        f"sigma{when}_m": rounded(float(found.sigma[0]), 5) if detected else None,
    }


def said_of(touch: Touching, stamp: FloatArray, touched: Sequence[Touched], q: FloatArray) -> Row:
    """Hold what S steps said of a contact, at instants (S,) [s] in postures (S, n) [rad], against where it was."""
    i = step_at(stamp, touch.start + judged_s(touch))
    return place_said(touch, touched[i], q[i])


def _one(touch: Touching, said: Said) -> Row:
    """Judge one contact, some time after it began and at its end."""
    row: Row = {"link": name_of(touch.link), "force_n": touch.force_n, "duration_s": touch.duration_s}
    for when, after in (("", judged_s(touch)), ("_end", touch.duration_s)):
        i = said.at(touch.start + after)
        row |= place_said(touch, said.touched[i], said.q[i], when)
    i = said.at(touch.start + judged_s(touch))
    limit = position_limit(touch, model().kinematics(said.q[i]), said.q[i], said.spread[i])
    return row | {"limit_m": rounded(limit, 5)}
