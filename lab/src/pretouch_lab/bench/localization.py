"""Errors of contact localization on a wandering arm, with skins and without."""

import time
from collections import Counter
from functools import cache

import numpy as np

from pretouch.params import LocalisationParams, SequentialParams
from pretouch.profiles import profile
from pretouch.robot.body import from_axes
from pretouch.robot.kinematics import Kinematics
from pretouch.text_table import TextTable
from pretouch.types import FloatArray, Touched
from pretouch_lab.bench.contacts import Toucher, Touching, touching
from pretouch_lab.bench.motions import Wandering, wandering
from pretouch_lab.bench.scenes import SeedRange, model, numbered, path_of, plant_of, scenario, sensing_of
from pretouch_lab.bench.streams import NOTHING, PROFILE, Alone, Stream, record_moved
from pretouch_lab.replay import DetectorAlone
from pretouch_lab.run import Cell, Play, Row
from pretouch_lab.table import Column, rounded, summary, table

_TAIL_S = 0.6
"""Time after the last contact [s]."""
SKINS = {"nominal": "32 units", "seven": "seven", "misplaced": "32 units, misplaced"}
"""Names of the kinds of sensing in tables."""
WITHOUT = ("none", "none, nothing learnt")
"""Skins without a stream of their own: the stream of 32 units is replayed without its readings. The detector learns
free motion in the warm-up, in which nobody is near, or never."""
LINK_M = 0.1
"""Standard deviation of a contact's place on a link if only the link is certain [m]."""
SAMPLES = 6
"""Samples in the window at the time of judgement: 100 ms less the observer's delay."""
_STEP_M = 1e-4


def plays(seeds: SeedRange, quick: bool) -> list[Play]:
    """Return the arms to play, each with a skin; an arm has the same seed and contacts with each skin."""
    family = scenario("localization")
    return [
        ({"sensing": sensing}, seed)
        for cell, seed in numbered(family, family["cell"], seeds, quick)
        for sensing in cell["sensing"]
    ]


def planned(seed: int) -> tuple[Wandering, list[Touching]]:
    """Draw an arm's motion and contacts from a seed, the same for each skin."""
    family, rng = scenario("localization"), np.random.default_rng([seed, 42])
    course = wandering(seed, 2.0 * (family["duration"]["warm_up_s"] + 3.6 * family["contact"]["number"]))
    radius, touches = sensing_of("nominal", 0).hand_radius, list[Touching]()
    at, links = float(family["duration"]["warm_up_s"]), family["contact"]["links"]
    for number in range(family["contact"]["number"]):  # in turn, so that all links have as many contacts
        name = links[number % len(links)]
        touches.append(touching(family["contact"], course.at(at)[0], at, radius, rng, name))
        at = touches[-1].end + rng.uniform(*family["duration"]["gap_s"])
    return course, touches


def streamed(skin: str, seed: int) -> tuple[Stream, list[Touching]]:
    """Return the stream of an arm with a skin, and its contacts."""
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
    )
    return record_moved(what, lambda plant: Toucher(plant, touches).hand, course.command), touches


def trial(cell: Cell, seed: int) -> Row:
    """Simulate an arm, and measure the errors of localized contacts, with its skin and without any."""
    stream, touches = streamed(cell["sensing"], seed)
    skins = SKINS[cell["sensing"]], *(WITHOUT if cell["sensing"] == "nominal" else ())
    return {"skins": [{"skin": skin, **replayed(stream, touches, skin)} for skin in skins]}


def rows_of(played: list[Row]) -> list[Row]:
    """Return a row for each arm and skin."""
    return [{"sensing": row["sensing"], "seed": row["seed"], **one} for row in played for one in row["skins"]]


def replayed(stream: Stream, touches: list[Touching], skin: str) -> Row:
    """Replay a stream with the named skin, and measure the errors of localized contacts.

    Each contact is judged twice, some time after its start and at its end, by the last step before.
    """
    params, arm, blind = profile("pretouch"), model(), skin in WITHOUT
    detector = DetectorAlone(params, arm)
    learning_s = scenario("localization")["duration"]["warm_up_s"] - 1.0
    rows: list[Row] = [{"link": name_of(t.link), "force_n": t.force_n, "duration_s": t.duration_s} for t in touches]
    soon_s = scenario("localization")["judged"]["after_s"]
    ends = [(("", min(soon_s, t.duration_s)), ("_end", t.duration_s)) for t in touches]
    due = sorted((t.start + s, k, at) for k, t in enumerate(touches) for at, s in ends[k])
    took_s, before = [], None
    for robot, obstacles, _, watched in stream.steps():
        while due and before is not None and robot.stamp > due[0][0] + 1e-9:
            _, k, at = due.pop(0)
            rows[k] |= judged(touches[k], *before, at)
        sees = watched and skin != WITHOUT[1] and (not blind or robot.stamp < learning_s)
        kin, begin = arm.kinematics(robot.q), time.thread_time()
        detection = detector.step(kin, robot, NOTHING if blind else obstacles, False, sees)
        if len(detection.touched.link):
            took_s.append(time.thread_time() - begin)
        before = detection.touched, robot.q, detector.state.test.model.spread
    median, p99 = (rounded(float(np.percentile(took_s or [np.nan], percent)), 7) for percent in (50, 99))
    return {"contacts": rows, "median_s": median, "p99_s": p99}


@cache
def bodies() -> dict[int, str]:
    """Return the name of each rigid body, its last link: `hand` for link 7, flange and hand."""
    arm = model()
    links = scenario("localization")["contact"]["links"]
    return {int(arm.rigid[arm.link_index(f"{arm.description.name}_{name}")]): name for name in links}


def name_of(link: int) -> str:
    """Return the name of the rigid body of a link."""
    return bodies()[int(model().rigid[link])]


def judged(touch: Touching, touched: Touched, q: FloatArray, spread: FloatArray, when: str = "") -> Row:
    """Compare the reported place in a posture (n,) [rad] with that of the contact.

    `spread` is for `position_limit`; `when` is a suffix of the measures' names.
    """
    rigid, kin, detected = model().rigid, model().kinematics(q), len(touched.link) > 0
    place = kin.position[touch.link] + kin.rotation[touch.link] @ touch.point
    row: Row = {
        "detected": detected,
        "right": detected and bool(rigid[touched.link[0]] == rigid[touch.link]),
        "error_m": rounded(float(np.linalg.norm(touched.point[0] - place)), 5) if detected else None,
        "taken_for": name_of(int(touched.link[0])) if detected else None,
        "sigma_m": rounded(float(touched.sigma[0]), 5) if detected else None,
        "limit_m": rounded(position_limit(touch, kin, q, spread), 5),
    }
    return {f"{name}{when}": value for name, value in row.items()}


def position_limit(touch: Touching, kin: Kinematics, q: FloatArray, spread: FloatArray) -> float:
    """Return the least standard deviation of a contact's place without a prior, both directions together [m].

    It is the bound of Cramer and Rao. The unknowns are two coordinates on the surface and three components of the
    force. The noise is that of learnt free motion, for the mean of `SAMPLES` independent samples. Across the surface
    the force has the spread of `LocalisationParams`. A direction without influence on the torques is
    bounded by the size of a link.

    Args:
        touch: the contact.
        kin: the arm's posture.
        q: (n,) the same [rad].
        spread: (2, 2, n) spread of learnt free motion, see `ResidualModel`.
    """
    p, d, arm = LocalisationParams(), SequentialParams(), model()
    M, moving = arm.mass_matrix(q), spread[1]
    S = (M * moving[0]) @ M.T + np.diag(moving[1] + d.noise_floor_nm**2)
    S = S / SAMPLES + np.diag(np.full(arm.n, d.bias_floor_nm**2))
    R = kin.rotation[touch.link]
    normal, force = R @ touch.normal, touch.force_n * (R @ touch.inwards)
    point = kin.position[touch.link] + R @ touch.point
    own = arm.capsules.of_links(np.array([touch.link]))
    # along the axis of the point's capsule, and round it, where the force turns with the surface
    off = np.abs(np.linalg.norm(from_axes(touch.point[None], own.a, own.b)[1][0], axis=1) - own.radius)
    axis = (own.b - own.a)[int(np.argmin(off))]
    along = R @ axis / np.linalg.norm(axis)
    around = np.cross(normal, along)
    turn = np.cross(np.cross(normal, around), force) / own.radius.mean()
    J, columns = arm.jacobian(kin, touch.link, point)[:3], []
    for tangent, change in ((along, np.zeros(3)), (around, turn)):
        ahead = arm.jacobian(kin, touch.link, point + _STEP_M * tangent)[:3].T @ (force + _STEP_M * change)
        columns.append((ahead - J.T @ force) / _STEP_M)
    columns += [J.T @ direction for direction in (normal, along, around)]
    D = np.column_stack(columns)
    across = 1.0 / (p.friction * touch.force_n) ** 2
    prior = np.diag([1 / LINK_M**2, 1 / LINK_M**2, 1 / p.force_n**2, across, across])
    bound = np.linalg.inv(D.T @ np.linalg.solve(S, D) + prior)
    return float(np.sqrt(bound[0, 0] + bound[1, 1]))


def results(replays: list[Row]) -> list[Row]:
    """Return a row for each skin and rigid body."""
    contacts = [{"skin": replay["skin"]} | contact for replay in replays for contact in replay["contacts"]]
    measures, counts = ("error_m", "error_m_end", "sigma_m", "limit_m"), ("detected", "right", "right_end")
    rows = summary(contacts, ("skin", "link"), measures, counts)
    skins, names = list(dict.fromkeys(replay["skin"] for replay in replays)), list(bodies().values())
    for row in rows:
        own = [contact for contact in contacts if (contact["skin"], contact["link"]) == (row["skin"], row["link"])]
        others = Counter(contact["taken_for"] for contact in own if contact["detected"] and not contact["right"])
        row["taken_for"] = {name: others[name] for name in names if others[name]}
        row["error_p90_m"] = row["error_m"] and row["error_m"]["p90"]
        row |= {f"right_share{when}": row[f"right{when}"] / row["trials"] for when in ("", "_end")}
        row["rate_hz"] = rounded(1.0 / max(r["p99_s"] for r in replays if r["skin"] == row["skin"]), 1)
    return sorted(rows, key=lambda row: (skins.index(row["skin"]), names.index(row["link"])))


_COLUMNS = (
    Column("skin", "skin"),
    Column("body", "link"),
    Column("contacts", "trials"),
    Column("detected", "detected"),
    Column("right\nbody [%]", "right_share", 0, 100.0),
    Column("taken for", "others"),
    Column("median\n[cm]", "error_m", 1, 100.0),
    Column("90 %\n[cm]", "error_p90_m", 1, 100.0),
    Column("limit\n[cm]", "limit_m", 1, 100.0),
    Column("right\nat end [%]", "right_share_end", 0, 100.0),
    Column("median\nat end [cm]", "error_m_end", 1, 100.0),
)


def tables(rows: list[Row]) -> list[TextTable]:
    """Return the table of `results`."""
    rules = scenario("localization")["judged"]
    rates = ", ".join(f"{skin} {rate:.0f} Hz" for skin, rate in {r["skin"]: r["rate_hz"] for r in rows}.items())
    named = [row | {"others": ", ".join(f"{k} {n}" for k, n in row["taken_for"].items()) or "-"} for row in rows]
    note = (
        f"Judged {1000 * rules['after_s']:.0f} ms after the start of the contact, or at its end if that is earlier, and"
        " again at its end. Error: distance of the reported from the true place, of all detected contacts, right body"
        " or not. A missed contact is not right. hand: link 7, flange and hand, which the same joints move. Limit:"
        " least error from the torques alone (bound of Cramer and Rao), median. Rate at which 99 of 100 inferences end"
        f" in time: {rates}."
    )
    return [table("Errors of localized contacts", _COLUMNS, named, note, 2)]
