"""Where contacts are said to be, held against where they are: on an arm that wanders, with skins and without."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from pretouch.profiles import profile
from pretouch.robot.kinematics import Kinematics
from pretouch.sim.plant import Plant
from pretouch.text_table import TextTable
from pretouch.types import FloatArray, Touched
from pretouch_lab.bench.contacts import Toucher, Touching, described, place_on, touches_of
from pretouch_lab.bench.localization_limit import position_limit
from pretouch_lab.bench.motions import Wandering, WanderingController, wandering
from pretouch_lab.bench.scenes import SeedRange, model, numbered, path_of, plant_of, scenario, sensing_of
from pretouch_lab.bench.streams import NOTHING, PROFILE, Alone, Stream, load_stream, record, save_stream
from pretouch_lab.replay import DetectorAlone
from pretouch_lab.run import Cell, Play, Row
from pretouch_lab.table import Column, rounded, table

_TAIL_S = 0.6
"""Time after the last contact [s]."""
SKINS = {"nominal": "32 units", "seven": "seven", "misplaced": "32 units, misplaced"}
"""What the kinds of sensing are called."""
JUDGED = "pretouch"
WITHOUT = ("none", "none, nothing learnt")
"""Skins of which there is no stream: that of 32 units is replayed as if it saw nothing. Free motion is learnt in the
warm-up, in which somebody sees to it that nobody is near, or not at all."""
_BEFORE_S, _AFTER_S = 0.1, 0.2
"""Time about each contact of which what was said is kept [s]."""


def stream_plays(seeds: SeedRange, quick: bool) -> list[Play]:
    """Return the streams to record; an arm has the same seed, and so the same contacts, with each skin."""
    family = scenario("localization")
    return [
        ({"sensing": sensing}, seed)
        for cell, seed in numbered(family, family["cell"], seeds, quick)
        for sensing in cell["sensing"]
    ]


def plays(streams: list[Play]) -> list[Play]:
    """Return the replays of streams, with their skins and without any."""
    return [
        ({"sensing": cell["sensing"], "skin": skin}, seed)
        for cell, seed in streams
        for skin in (SKINS[cell["sensing"]], *(WITHOUT if cell["sensing"] == "nominal" else ()))
    ]


def planned(seed: int) -> tuple[Wandering, list[Touching]]:
    """Draw an arm's motion and its contacts. The seed says which: with each skin they are the same."""
    family, rng = scenario("localization"), np.random.default_rng([seed, 42])
    course = wandering(seed, 2.0 * (family["duration"]["warm_up_s"] + 3.6 * family["contact"]["number"]))
    touches: list[Touching] = []
    at = float(family["duration"]["warm_up_s"])
    for number in range(family["contact"]["number"]):
        touches.append(_drawn(course, at, number, rng))
        at = touches[-1].end + rng.uniform(*family["duration"]["gap_s"])
    return course, touches


def _drawn(course: Wandering, at: float, number: int, rng: np.random.Generator) -> Touching:
    """Draw a contact that begins at a time [s]; links take turns, so that all are touched as often."""
    family, arm = scenario("localization"), model()
    chosen, hand = family["contact"], scenario("contacts")["hand"]
    radius = sensing_of("nominal", 0).hand_radius
    every = [(k, duration) for k, kind in enumerate(chosen["kind"]) for duration in kind["durations_s"]]
    k, duration = every[int(rng.integers(len(every)))]
    name = chosen["links"][number % len(chosen["links"])]
    link = arm.link_index(f"{arm.description.name}_{name}")
    point, normal = place_on(link, course.at(at)[0], radius, rng, hand["from_m"])
    inwards = chosen["tilt"] * rng.uniform(-1, 1, 3) - normal
    force = float(rng.choice(chosen["forces_n"]))
    inwards /= np.linalg.norm(inwards)
    return Touching(link, k, force, chosen["kind"][k]["rise_s"], duration, at, point, normal, inwards)


def record_stream(out: Path, cell: Cell, seed: int) -> Row:
    """Record the stream of an arm with a skin, before it is replayed in several ways."""
    return {"steps": len(_stream(out, cell["sensing"], seed).count)}


def _stream(out: Path, skin: str, seed: int) -> Stream:
    """Return the stream of an arm with a skin, with its contacts in it, recorded now where none can be read."""
    file = out / "streams" / f"{skin}_{seed:04d}.npz"
    stored = load_stream(file)
    if stored is not None:
        return stored
    course, touches = planned(seed)
    sensing = sensing_of(skin, seed)
    what = Alone(
        path_of("rest"),
        profile(PROFILE).task.speed_m_s,
        plant_of(scenario("localization")["arm"]["kind"]),
        sensing,
        sensing.hand_radius,
        seed,
        touches[-1].end + _TAIL_S,
        start=course.at(0.0)[0],
        controller=partial(WanderingController, course),
    )

    def prepare(plant: Plant) -> Callable[[float], FloatArray]:
        return Toucher(plant, touches, sensing.hand_radius).hand

    stream = replace(record(what, prepare), truth=described(touches, sensing.hand_radius))
    save_stream(stream, file)
    return stream


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


def trial(out: Path, cell: Cell, seed: int) -> Row:
    """Replay a stream as with the skin that is named, and hold what is said against its contacts."""
    stream = _stream(out, cell["sensing"], seed)
    touches = touches_of(stream)
    said = replayed(stream, cell["skin"], touches)
    busy = np.sort(said.busy) if len(said.busy) else np.array([np.nan])
    median, p99 = (rounded(float(np.percentile(busy, percent)), 7) for percent in (50, 99))
    return {"found": [_one(touch, said) for touch in touches], "median_s": median, "p99_s": p99}


def replayed(stream: Stream, skin: str, touches: list[Touching]) -> Said:
    """Give the profile each step of a stream, as with the skin that is named."""
    params, arm = profile(JUDGED), model()
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


def results(replays: list[Row]) -> list[Row]:
    """Return a row for each skin and rigid body."""
    rows = []
    for skin in dict.fromkeys(replay["skin"] for replay in replays):
        own = [replay for replay in replays if replay["skin"] == skin]
        rate = rounded(1.0 / max(replay["p99_s"] for replay in own), 1)
        singles = [found for replay in own for found in replay["found"]]
        for link in sorted({found["link"] for found in singles}, key=_order):
            rows.append(_of_body(skin, link, [found for found in singles if found["link"] == link], rate))
    return rows


def _order(link: str) -> tuple[bool, str]:
    return link == "hand", link


def _of_body(skin: str, link: str, found: list[Row], rate: float) -> Row:
    row: Row = {"skin": skin, "link": link, "contacts": len(found)}
    for when in ("", "_end"):
        detected = [one for one in found if one[f"detected{when}"]]
        row |= {
            f"detected{when}": len(detected),
            f"right_link{when}": rounded(sum(one[f"right{when}"] for one in found) / len(found), 4),
            f"median_error{when}_m": _at([one[f"error{when}_m"] for one in detected], 50),
            f"p90_error{when}_m": _at([one[f"error{when}_m"] for one in detected], 90),
            f"median_sigma{when}_m": _at([one[f"sigma{when}_m"] for one in detected], 50),
        }
    taken = [one["taken_for"] for one in found if one["detected"] and not one["right"]]
    row["taken_for"] = {name: taken.count(name) for name in sorted(set(taken), key=_order)}
    return row | {"median_limit_m": _at([one["limit_m"] for one in found], 50), "rate_hz": rate}


def _at(values: list[float], percent: float) -> float | None:
    return rounded(float(np.percentile(values, percent)), 4) if values else None


_COLUMNS = (
    Column("skin", "skin"),
    Column("body", "link"),
    Column("contacts", "contacts"),
    Column("detected", "detected"),
    Column("right\nbody [%]", "right_link", 0, 100.0),
    Column("taken for", "others"),
    Column("median\n[cm]", "median_error_m", 1, 100.0),
    Column("90 %\n[cm]", "p90_error_m", 1, 100.0),
    Column("limit\n[cm]", "median_limit_m", 1, 100.0),
    Column("right\nat end [%]", "right_link_end", 0, 100.0),
    Column("median\nat end [cm]", "median_error_end_m", 1, 100.0),
)


def tables(rows: list[Row]) -> list[TextTable]:
    """Return the table of `results`."""
    judged = scenario("localization")["judged"]
    rates = ", ".join(f"{skin} {rate:.0f} Hz" for skin, rate in {r["skin"]: r["rate_hz"] for r in rows}.items())
    named = [row | {"others": ", ".join(f"{k} {n}" for k, n in row["taken_for"].items()) or "-"} for row in rows]
    note = (
        f"Judged {1000 * judged['after_s']:.0f} ms after the force began to rise, or at its end if that is earlier, and"
        " once more at its end. Error: from the true place, both on the body in that posture, of what was detected,"
        " whichever body it was taken for; what was not detected is not right. hand: link 7, flange and hand, which the"
        " same joints move. Limit: what the torques alone could tell at best, the bound of Cramer and Rao, median. An"
        f" inference takes so long that 99 of 100 would keep up with: {rates}."
    )
    return [table("Where a contact is said to be", _COLUMNS, named, note, 2)]
