"""Paper IV-B: a person holds a hand beside the path or in it, on one side and then on the other, or walks about."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from pretouch.control.path import Path, WayPoints
from pretouch.errors import ExperimentError
from pretouch.robot.model import RobotModel
from pretouch.sim.hand import FREE_N, HOME, LEAD_S, HandGoal, PersonArm, point_on_arm, robot_hand
from pretouch.sim.plant import Plant
from pretouch.sim.scene import HandSpec, SceneSpec
from pretouch.text_table import TextTable
from pretouch.types import FloatArray
from pretouch_lab.bench.obstacle import Ball, least_distance
from pretouch_lab.bench.scenes import scenario
from pretouch_lab.encounters import GHOST_M, LEAVING_S, SOFT_M_S, SOFT_N, encounters, ghosts, met
from pretouch_lab.experiment import Context, Drawing, Experiment, controllers, first_sensing
from pretouch_lab.options import TrialOptions
from pretouch_lab.placement import UNMOVED, PeoplePlacement
from pretouch_lab.run import Row
from pretouch_lab.table import Column, medians, ratios, rounded, share_above, summary, table
from pretouch_lab.trial import Record, play

_DURATION_S = 40.0
_VISITS_S = ((4.0, 14.0), (20.0, 30.0))
PLACES = ("beside", "inside", "beside line", "inside line", "walking", "nobody", "nobody line")
"""Places of the person's hand: 3 cm clear of the robot's hand on the free circle or line, half in its way on the circle
or wholly on the line; that of a person who walks about beside the circle; or nobody."""
_SPREAD_M = 0.03
_CLEAR_M = 0.4
"""Least distance of the robot's hand at which the person enters [m]."""
_ALONG = 0.5
"""Place of a person's hand at the line, from its middle, as a share of the way to its end."""
_BESIDE_LINE_M = 0.105
"""Distance of a person's hand before the line [m], which the Panda's hand passes by 3 cm."""


class Visit(NamedTuple):
    """A hand held at a place for a while."""

    arrive: float
    """[s]"""
    leave: float
    """[s]"""
    place: FloatArray
    """(3,) [m]"""
    ahead: bool = False
    """True if it comes from the front, along x; otherwise from its own side, along y."""


@dataclass
class Visitor:
    """A person who holds a hand beside the path and withdraws it, and enters only while the robot's hand is away."""

    model: RobotModel
    visits: tuple[Visit, ...]

    def __post_init__(self) -> None:
        self._robot = robot_hand(self.model)
        self._inside = False

    def goal(self, time: float, hand: FloatArray, plant: Plant) -> HandGoal:
        """Return the place of the present visit, or home; the hand enters and leaves from the far side."""
        for visit in self.visits:
            if visit.arrive - LEAD_S <= time < visit.leave + LEAVING_S:
                away = [0.4, 0.0, 0.0] if visit.ahead else [0.0, np.sign(visit.place[1]) * 0.4, 0.0]
                outside = visit.place + np.array(away)
                palm = point_on_arm(plant, self._robot.link, self._robot.palm)
                clear = np.linalg.norm(palm - visit.place) > _CLEAR_M
                due = visit.arrive <= time < visit.leave
                self._inside = due and (self._inside or bool(clear))
                return HandGoal(visit.place if self._inside else outside, FREE_N, way_round=not self._inside)
        return HandGoal(HOME, FREE_N, way_round=True)


class Walk(NamedTuple):
    """A person, or a hand, that goes straight from place to place: a script of `pretouch.sim.hand`."""

    times: FloatArray
    """(P,) [s]"""
    places: FloatArray
    """(P, 3) [m]"""
    force_max: float
    """Largest force of the person [N]."""

    def goal(self, time: float, hand: FloatArray, plant: Plant) -> HandGoal:
        """Return the place at a time [s]."""
        return HandGoal(np.array([np.interp(time, self.times, along) for along in self.places.T]), self.force_max)


def cells(options: TrialOptions) -> list[Row]:
    """Return a cell for each place of the person and each controller."""
    choices = [place for place in PLACES if place != "beside line" or not options.arm]
    if other := [place for place in options.places if place not in choices]:
        raise ExperimentError(f"There is no place {other[0]!r} for this arm: choose from {', '.join(choices)}.")
    return [{"place": place, **each} for place, each in product(options.places, controllers(options, "slack"))]


def path_of(place: str, where: PeoplePlacement) -> Path:
    """Return the circle, or the line to and fro."""
    line = where.path("line", -1.0)
    ends = np.array([line.point(0.0), line.point(line.length)])
    return WayPoints(ends, closed=True) if place.endswith("line") else where.path("circle", -1.0)


def visits(place: str, seed: int, placement: PeoplePlacement = UNMOVED) -> tuple[Visit, ...]:
    """Return a visit on each side of the path, at a place that the seed varies by a few centimetres."""
    rng, every = np.random.default_rng([seed, 12]), []
    for (arrive, leave), side in zip(_VISITS_S, (-1.0, 1.0), strict=True):
        at = np.array(placement.visited(place.removesuffix(" line"), side))
        if line := place.endswith("line"):
            above = at[2] - placement.path("circle", side).point(0.0)[2]
            at = placement.path("line", side).point(0.0) * [1.0, -_ALONG, 1.0] + [0.0, 0.0, above]
            at[0] += _BESIDE_LINE_M if place == "beside line" else 0.0
        every.append(Visit(arrive, leave, at + _SPREAD_M * rng.uniform(-1, 1, 3), line))
    return tuple(every)


def walk(seed: int, placement: PeoplePlacement) -> Walk:
    """Return the walk of a person who passes, comes to the path and moves about, leaves, comes back, and leaves."""
    rng = np.random.default_rng([seed, 13])
    side, start, far = rng.choice([-1.0, 1.0]), rng.uniform(2.0, 4.0), (0.5, 1.8)
    near = np.column_stack([rng.uniform(0.3, 0.7, 6), rng.uniform(0.55, 0.7, 6)])
    beside = [*zip((6.0, 7.5, 9.0, 10.5, 17.5, 20.0), near, strict=True)]
    past = [(0.0, (1.7, 0.55)), (2.0, (-0.6, 0.55)), (3.5, (-0.6, 1.8)), (4.5, far)]
    steps = [*past, *beside[:4], (12.0, far), (16.0, far), *beside[4:], (21.5, far)]
    places = [placement.moved(x, side * y, 0.3) for _, (x, y) in steps]
    return Walk(start + np.array([time for time, _ in steps]), np.array(places), 400.0)


def _person(place: str, seed: int, context: Context) -> dict[str, Any]:
    """Return the fields of a `Setup` that place a person."""
    model, where = context.model, context.placement
    if place.startswith("nobody"):
        return {"scene": SceneSpec()}
    if place == "walking":
        body, way = scenario("avoidance-walking")["obstacle"], walk(seed, where)
        x, y, z = way.places[0].tolist()
        hand = HandSpec(body["radius_m"], body["mass_kg"], body["contact_stiffness_n_m"], (x, y, z))
        return {"scene": SceneSpec(hand=hand), "hand": way, "person": PersonArm(2.4, 20_000.0, 1800.0)}
    return {"scene": SceneSpec(hand=HandSpec()), "hand": Visitor(model, visits(place, seed, where))}


def trial(cell: Row, seed: int, context: Context) -> tuple[Row, Record]:
    """Run one trial; return its row and its record."""
    place, model, units = cell["place"], context.model, context.skin.mounted
    person = {"ranging": replace(context.ranging, realistic=True), **_person(place, seed, context)}
    setup = context.setup(cell, seed, person.pop("scene"), path_of(place, context.placement), **person)
    record = play(setup, lambda step, _: step.stamp >= _DURATION_S)
    steps, radius = record.steps, (setup.scene.hand or HandSpec()).radius
    off = [float(np.linalg.norm(s.ee_position - s.path_position)) for s in steps]
    shape = partial(Ball, radius=radius)
    postures = np.array([s.q for s in steps])
    least = least_distance(model, postures, shape, record.hand_position) if setup.hand else None
    leaves = [visit.leave for visit in setup.hand.visits] if isinstance(setup.hand, Visitor) else []
    every = encounters(record, model, shape, leaves)
    row = {
        "arm": model.description.name,
        "skin": f"{len(units)} {units[0].sensor.label}" if setup.profile.perception else "none",
        "contact": record.first_contact() is not None,
        "true_peak_n": rounded(float(np.linalg.norm(record.true_force, axis=1).max())),
        "least_gap_m": None if least is None else rounded(least, 4),
        **met(every),
        "touches": [each._asdict() for each in every],
        "deviation_m": rounded(max(off), 4),
        "least_speed_scale": rounded(min(s.speed_scale for s in steps)),
        "travelled_m": rounded(steps[-1].path_phase),
        **ghosts(record, model, setup.skin, radius, setup.profile.task.speed_m_s),
        "false_detections": sum(
            (record.first_contact(after=s.stamp - 0.5) or np.inf) > s.stamp for s in record.reactions()
        ),
    }
    return row, record


_WHO = (
    Column("hand", "place"),
    Column("profile\nmode", "profile", second="restrictions"),
    Column("arm\nskin", "arm", second="skin"),
)
_COLUMNS = (
    *_WHO,
    Column("contact", "contact", of="trials"),
    Column("true\n[N]", "true_peak_n", 1),
    Column("least\ngap [m]", "least_gap_m", 3),
    Column("off path\n[m]", "deviation_m", 3),
    Column("least\nspeed", "least_speed_scale", 2),
    Column("way\n[m]", "travelled_m", 2),
    Column("of blind\n[%]", "travelled_m_ratio", 1, 100.0),
    Column("false", "false_detections"),
)
_MET = (
    *_WHO,
    Column("untouched", "untouched", of="trials"),
    Column("or softly", "soft", of="trials"),
    Column("at least\n[%]", "soft_least", 0, 100.0),
    Column("speed\n[m/s]", "fastest_m_s", 3, band=True),
    Column("force\n[N]", "hardest_n", 1, band=True),
    Column("by the\nhand", "by_hand"),
)
_GHOSTS = (
    *_WHO,
    Column("slowed\n[0.1 %]", "ghost_share", 2, 1000.0, band=True),
    Column("longest\nhold [s]", "ghost_s", 2, band=True),
    Column("seen\nempty", "empty_s", 2, band=True),
    Column("longer\nthan 1 s", "haunted", of="trials"),
)
_BY = ("place", "profile", "restrictions", "arm", "skin")
_NOTE = (
    "Beside: the person's hand is 3 cm clear of the robot's hand on its path. Inside: half of it is in the path, at the"
    " line all of it. Contact: trials with contact. True: peak of the true force. Gap: between the person's hand and"
    " the arm, negative in contact. Least speed: factor of eqs. 3 and 4. Way: distance along the path in 40 s. Of"
    " blind: over that of blind in the same trial."
)
_MET_NOTE = (
    f"Or softly: untouched, or each touch with at most {SOFT_M_S:g} m/s of the arm and {SOFT_N:g} N. At least: 95 %"
    " lower bound on that share (Clopper and Pearson, one-sided). Speed, force: largest of the trials with a touch. By"
    f" the hand: touches of an arm of at most {SOFT_M_S:g} m/s by a faster hand, and pushes by one that withdraws; they"
    " count nowhere else."
)
_GHOSTS_NOTE = (
    f"A ghost is an obstacle with nothing within {100 * GHOST_M:.0f} cm. Slowed: steps that ghosts alone slow. Hold:"
    " time in which they keep the arm below half of its speed. Seen empty, longer than 1 s: of those whose place a unit"
    " saw empty before. 10-90 % below the medians."
)


def tables(rows: list[Row]) -> list[TextTable]:
    """Return tables of the effects of a person, of the touches of a hand in the way, and of ghosts."""
    compared = ratios(rows, {"profile": "blind"}, ("place", "arm", "seed"), ("travelled_m",))
    inside = [row for row in rows if row["place"].startswith("inside")]
    groups = [*_met(inside, _BY), *_met(inside, ("profile", "restrictions", "skin"))]
    haunted = [row | {"haunted": row["empty_s"] > 1.0} for row in rows]
    every = (
        medians("A person holds a hand beside the path or in it: medians", _COLUMNS, compared, _BY, _NOTE, 3),
        table("A hand in the way", _MET, groups, _MET_NOTE, 3),
        medians("Ghosts", _GHOSTS, haunted, _BY, _GHOSTS_NOTE, 3),
    )
    return [each for each in every if each.rows]


def _met(rows: list[Row], by: Sequence[str]) -> list[Row]:
    """Return a row for each group of trials with a hand in the way; `all` in place of what it is not grouped by."""
    groups = summary(rows, by, ("fastest_m_s", "hardest_n"), ("untouched", "soft", "by_hand"))
    return [
        {"place": "all", "arm": "all"} | group | {"soft_least": share_above(group["soft"], group["trials"])}
        for group in groups
    ]


def _beside(rows: list[Row]) -> list[Row]:
    return first_sensing([row for row in rows if row["place"] == "beside"])


_FIGURE = Drawing("circle", "End-effector path with a hand beside it", _beside)
EXPERIMENT = Experiment("avoidance", cells, trial, tables, _FIGURE, any_arm=True)
