"""Paper IV-B: a person holds a hand beside the circle or in it, on one side and then on the other."""

from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from pretouch.perception.closest import closest_points
from pretouch.robot.model import RobotModel
from pretouch.sim.hand import FREE_N, HOME, LEAD_S, HandGoal, point_on_arm, robot_hand
from pretouch.sim.paper_scenes import Placement
from pretouch.sim.plant import Plant
from pretouch.sim.scene import HandSpec, SceneSpec
from pretouch.text_table import TextTable
from pretouch.types import FloatArray
from pretouch_lab.experiment import Context, Drawing, Experiment, controllers, first_sensing, main
from pretouch_lab.options import TrialOptions
from pretouch_lab.run import Row
from pretouch_lab.table import Column, medians, rounded
from pretouch_lab.trial import Record, play

_DURATION_S = 40.0
_VISITS_S = ((4.0, 14.0), (20.0, 30.0))
PLACES = ("beside", "inside")
"""Places of the person's hand: 3 cm clear of the robot's hand on the free circle, or half in its path."""
_SPREAD_M = 0.03
_UNMOVED = Placement()
_CLEAR_M = 0.4
"""Least distance of the robot's hand at which the person enters [m]."""


@dataclass(frozen=True)
class Visit:
    """A hand held at a place for a while."""

    arrive: float
    """[s]"""
    leave: float
    """[s]"""
    place: FloatArray
    """(3,) [m]"""


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
            if visit.arrive - LEAD_S <= time < visit.leave + 1.0:
                outside = visit.place + np.array([0.0, np.sign(visit.place[1]) * 0.4, 0.0])
                palm = point_on_arm(plant, self._robot.link, self._robot.palm)
                clear = np.linalg.norm(palm - visit.place) > _CLEAR_M
                due = visit.arrive <= time < visit.leave
                self._inside = due and (self._inside or bool(clear))
                return HandGoal(visit.place if self._inside else outside, FREE_N, way_round=not self._inside)
        return HandGoal(HOME, FREE_N, way_round=True)


def cells(options: TrialOptions) -> list[Row]:
    """Return a cell for each place of the hand and each controller."""
    return [{"place": place, **controller} for place, controller in product(PLACES, controllers(options, "slack"))]


def visits(place: str, seed: int, placement: Placement = _UNMOVED) -> tuple[Visit, ...]:
    """Return a visit on each side of the circle, at a place that the seed varies by a few centimetres."""
    rng = np.random.default_rng([seed, 12])
    return tuple(
        Visit(arrive, leave, np.array(placement.visited(place, side)) + _SPREAD_M * rng.uniform(-1, 1, 3))
        for (arrive, leave), side in zip(_VISITS_S, (-1.0, 1.0), strict=True)
    )


def trial(cell: Row, seed: int, context: Context) -> tuple[Row, Record]:
    """Run one trial; return its row and its record."""
    where, sensors = context.placement, replace(context.ranging, realistic=True)
    person, path = Visitor(context.model, visits(cell["place"], seed, where)), where.path("circle", -1.0)
    setup = context.setup(cell, seed, SceneSpec(hand=HandSpec()), path, hand=person, ranging=sensors)
    record = play(setup, lambda step, _: step.stamp >= _DURATION_S)
    steps = record.steps
    off = [float(np.linalg.norm(s.ee_position - s.path_position)) for s in steps]
    row = {
        "contact": record.first_contact() is not None,
        "true_peak_n": rounded(float(np.linalg.norm(record.true_force, axis=1).max())),
        "least_gap_m": rounded(float(gaps(record, context.model, HandSpec.radius).min()), 4),
        "deviation_m": rounded(max(off), 4),
        "least_speed_scale": rounded(min(s.speed_scale for s in steps)),
        "largest_slack_m_s": rounded(max(float(s.qp.slack.max(initial=0.0)) for s in steps), 4),
        "travelled_m": rounded(steps[-1].path_phase),
        "false_detections": sum(
            (record.first_contact(after=s.stamp - 0.5) or np.inf) > s.stamp for s in record.reactions()
        ),
        "held": record.held(),
    }
    return row, record


def gaps(record: Record, model: RobotModel, radius: float) -> FloatArray:
    """Return the distance (S,) [m] of the person's hand, a ball of a radius [m], from the arm at each control step."""
    unit, aside = np.zeros(1, np.int64), np.array([[0.0, 0.0, 1.0]])
    distances = [
        closest_points(model.kinematics(step.q), model.body, step.ee_position, unit, hand[None], aside).body_distance[0]
        for step, hand in zip(record.steps, record.hand_position, strict=True)
    ]
    return np.array(distances) - radius


_COLUMNS = (
    Column("hand", "place"),
    Column("profile\nmode", "profile", second="restrictions"),
    Column("contact", "contact", of="trials"),
    Column("true\n[N]", "true_peak_n", 1),
    Column("least\ngap [m]", "least_gap_m", 3),
    Column("off path\n[m]", "deviation_m", 3),
    Column("least\nspeed", "least_speed_scale", 2),
    Column("way\n[m]", "travelled_m", 2),
    Column("false", "false_detections"),
)


def tables(rows: list[Row]) -> list[TextTable]:
    """Return a table of the effects of a hand beside the path or in it."""
    note = (
        "Beside: the person's hand is 3 cm clear of the robot's hand on its path. Inside: half of it is in the path."
        " Contact: trials with contact. True: peak of the true force. Gap: between the person's hand and the arm,"
        " negative in contact. Least speed: factor of eqs. 3 and 4. Way: distance along the path in 40 s."
    )
    title = "A person holds a hand beside the path or in it: medians"
    return [medians(title, _COLUMNS, rows, ("place", "profile", "restrictions"), note, names=2)]


def shown_cells(rows: list[Row]) -> list[Row]:
    """Return the trial of the figure: one with the hand beside the path."""
    return first_sensing([row for row in rows if row["place"] == "beside"])


_FIGURE = Drawing("circle", "End-effector path with a hand beside it", shown_cells)
EXPERIMENT = Experiment("avoidance", cells, trial, tables, _FIGURE, any_arm=True)
if __name__ == "__main__":
    main(EXPERIMENT.name)
