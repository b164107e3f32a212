"""A limb in the crook of an arm that folds, or on a floor on which the hand comes down: clamped between two objects."""

from dataclasses import dataclass, field, replace
from itertools import product

import mujoco
import numpy as np

from pretouch.control.path import WayPoints
from pretouch.control.posture import brought_to
from pretouch.explanation import resumable
from pretouch.modes import Event
from pretouch.robot.model import RobotModel
from pretouch.robot.self_distance import nearest_points
from pretouch.sim.hand import HandGoal
from pretouch.sim.plant import TOUCH_N, Plant
from pretouch.sim.scene import HandSpec, SceneSpec
from pretouch.text_table import TextTable, tabulated
from pretouch.traces import mean_over
from pretouch.types import FloatArray
from pretouch_lab.cell import Cell, Context, Grid
from pretouch_lab.experiment import Experiment
from pretouch_lab.rows import Row, cells_of, peak, rounded
from pretouch_lab.tables import median, plain, share
from pretouch_lab.trial import Record, play

NAME = "pinch"
DEFAULT_RESTRICTIONS = "off"
"""Restricted, an arm whose units see the limb would keep it from being caught."""
SPEEDS_M_S = (0.1, 0.2)
"""Speeds along the path [m/s]."""

PLACES = {
    "crook": np.array([[0.45, 0.0, 0.5], [0.3, 0.0, 0.22]]),
    "floor": np.array([[0.5, 0.0, 0.15], [0.5, 0.0, -0.15]]),
}
"""The path to and fro at each place [m]: at its end forearm and upper arm are 0.08 m apart, fingers are 0.05 m above
the floor."""
_RADIUS_M = (0.045, 0.055)
"""Of the limb: 9 to 11 cm thick, as a forearm."""
_ASIDE_M = 0.02
"""How far it lies from the middle of the gap, along the axis about which the arm folds, or of the fingers [m]."""
_RESTS_N = 15.0
"""Largest force with which the person keeps it there [N]."""
_END_S = 9.0


def cells(grid: Grid) -> list[Cell]:
    """A cell for each place and speed, of each controller."""
    return [
        Cell(NAME, name, {"place": place, "speed_m_s": speed, "restrictions": mode})
        for place, speed, (name, mode) in product(PLACES, SPEEDS_M_S, grid.controllers(DEFAULT_RESTRICTIONS))
    ]


@dataclass
class _Limb:
    """Lies where the person means to keep it, and measures what it is squeezed with."""

    place: str
    model: RobotModel
    aside: float
    """Where it lies along the y axis [m]."""
    radius: float
    """[m]"""
    force: list[float] = field(default_factory=list)
    """The smaller of the forces from both sides at each physics step [N]."""

    def middle(self, position: FloatArray, rotation: FloatArray) -> FloatArray:
        """Where it lies (3,) [m], given all links' origins and orientations."""
        aside = np.array([0.0, self.aside, 0.0])
        if self.place == "floor":
            return aside + np.array([*PLACES["floor"][0, :2], SceneSpec().floor_height + self.radius])
        name, body = self.model.description.name, self.model.capsules
        first, second = (np.flatnonzero(body.link == self.model.link_index(f"{name}_{link}")) for link in _CROOK)
        a, b = (
            position[body.link] + np.einsum("cij,cj->ci", rotation[body.link], end) for end in (body.a, body.b)
        )  # fmt: skip
        p, q = nearest_points(a[first, None], b[first, None], a[None, second], b[None, second])
        gap = np.linalg.norm(q - p, axis=2) - body.radius[first, None] - body.radius[None, second]
        i, j = np.unravel_index(gap.argmin(), gap.shape)
        way = (q[i, j] - p[i, j]) / np.linalg.norm(q[i, j] - p[i, j])
        return np.asarray(p[i, j] + (body.radius[first[i]] + 0.5 * gap[i, j]) * way + aside)

    def goal(self, time: float, hand: FloatArray, plant: Plant) -> HandGoal:
        """Return where the person means to keep it."""
        return HandGoal(self.middle(plant.link_position, plant.link_rotation), _RESTS_N)

    def attach(self, plant: Plant, _: object) -> None:
        """Measure before each physics step."""
        mj, data, wrench = plant.mj_model, plant.mj_data, np.zeros(6)
        limb, other_side = mj.geom("hand").id, self.model.link_index(f"{self.model.description.name}_{_CROOK[0]}")
        if self.place == "floor":
            other_side = int(mj.geom_bodyid[mj.geom("floor").id])

        def measure(_: float) -> None:
            sides = [0.0, 0.0]
            for i in range(data.ncon):
                contact = data.contact[i]
                if limb in (contact.geom1, contact.geom2):
                    other = contact.geom1 if contact.geom2 == limb else contact.geom2
                    mujoco.mj_contactForce(mj, data, i, wrench)
                    sides[int(mj.geom_bodyid[other]) == other_side] += float(wrench[0])
            self.force.append(min(sides))

        plant.before_each_step(measure)


_CROOK = ("link2", "link5")
"""Upper arm and forearm."""


def trial(cell: Cell, seed: int, context: Context) -> tuple[Row, Record]:
    """Run one trial; return its row of results and what it left behind."""
    rng, model, place = np.random.default_rng([seed, 43]), context.model, str(cell.where["place"])
    limb = _Limb(place, model, _ASIDE_M * rng.uniform(-1, 1), rng.uniform(*_RADIUS_M))
    kin = model.kinematics(brought_to(model, PLACES[place][0]))
    x, y, z = limb.middle(kin.position, kin.rotation).tolist()
    found = context.profile(cell)
    setup = context.setup(
        cell,
        seed,
        SceneSpec(hand=HandSpec(radius=limb.radius, stiffness=40_000.0, mass=2.0, start=(x, y, z))),
        WayPoints(PLACES[place], closed=True),
        profile=replace(found, task=replace(found.task, speed_m_s=float(cell.where["speed_m_s"]))),
        hand=limb,
        prepare=limb.attach,
    )
    record = play(setup, lambda step, _: step.stamp >= _END_S)
    row = cell.row(seed)
    return row | results(np.array(limb.force), record, _NAMED[place]), record


_NAMED = {"crook": _CROOK, "floor": ("hand", "fixture")}
"""What the arm has to name, at each place."""


def results(force: FloatArray, record: Record, named: tuple[str, str]) -> Row:
    """Numbers of one trial, given the force (T,) [N] with which the limb was squeezed at each millisecond."""
    squeezed, last = force > TOUCH_N, record.steps[-1]
    said = [s.reason for s in record.steps if s.event in (Event.OPENING, Event.CLAMPED)]
    return {
        "caught": bool(squeezed.any()),
        "peak_20ms_n": rounded(peak(mean_over(force, 20))),
        "squeezed_s": rounded(float(squeezed.sum()) / 1000.0),
        "contacts": len(record.reactions()),
        "recognised": bool(said),
        "links": bool(said) and all(name in said[0] for name in named),
        "latched": resumable(last),
    }


_MEASURES = ("peak_20ms_n", "squeezed_s", "contacts")


def summarise(rows: list[Row]) -> Row:
    """Medians over the seeds of each cell."""
    by = ("place", "speed_m_s", "restrictions", "profile")
    return {"cells": cells_of(rows, by, _MEASURES, totals=("caught", "recognised", "links", "latched"))}


def tables(part: Row) -> list[TextTable]:
    """What was between the links."""
    columns = (
        ("place", plain("place")),
        ("speed\n[m/s]", plain("speed_m_s", "g")),
        ("profile", plain("profile")),
        ("caught", share("caught")),
        ("recognised", plain("recognised")),
        ("links", plain("links")),
        ("peak\n[N]", median("peak_20ms_n", 0)),
        ("for\n[s]", median("squeezed_s", 2)),
        ("contacts", median("contacts", 0)),
        ("latched", plain("latched")),
    )
    table = tabulated(
        "A limb between two objects: medians",
        columns,
        part["cells"],
        f"A limb 9 to 11 cm thick between upper arm and forearm, or on the floor under the hand, for {_END_S:g} s of"
        " going to and fro. Peak: of the force that squeezes it, mean of 20 ms. For: while squeezed. Recognised: trials"
        " in which the arm said that something was caught. Links: those in which it named the right ones. Latched:"
        " trials that end in a HOLD until a person resumes.",
    )
    return [table]


EXPERIMENT = Experiment(NAME, cells, trial, lambda cell: _END_S, summarise, tables)
