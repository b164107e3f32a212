"""A limb that lies in the crook of the arm as the arm folds: caught between two of its own links."""

from dataclasses import dataclass, field, replace
from itertools import product

import mujoco
import numpy as np

from pretouch.control.path import WayPoints
from pretouch.experiments.cell import Cell, Context, Grid
from pretouch.experiments.experiment import Experiment, Row
from pretouch.experiments.groups import cells_of
from pretouch.experiments.metrics import mean_over, peak, rounded
from pretouch.experiments.tables import TextTable, number
from pretouch.experiments.trial import TOUCH_N, Record, Setup, play
from pretouch.params import RestrictionMode
from pretouch.robot.model import RobotModel
from pretouch.robot.self_distance import nearest_points
from pretouch.sim.hand import HandGoal
from pretouch.sim.plant import Plant
from pretouch.sim.posture import brought_to
from pretouch.sim.scene import HandSpec, SceneSpec
from pretouch.types import FloatArray, Mode

NAME = "pinch"
DEFAULT_RESTRICTIONS: RestrictionMode = "off"
"""Restricted, an arm whose units see the limb would keep it from being caught."""
SPEEDS_M_S = (0.1, 0.2)
"""Speeds along the path [m/s]."""

_FROM_TO_M = np.array([[0.45, 0.0, 0.5], [0.3, 0.0, 0.22]])
"""The path to and fro [m]: at its end forearm and upper arm are 0.08 m apart."""
_RADIUS_M = (0.045, 0.055)
"""Of the limb: 9 to 11 cm thick, as a forearm."""
_ASIDE_M = 0.02
"""How far it lies from the middle of the gap, along the axis about which the arm folds [m]."""
_RESTS_N = 15.0
"""Largest force with which the person keeps it there [N]."""
_END_S = 9.0


def cells(grid: Grid) -> list[Cell]:
    """A cell for each speed, of each controller."""
    return [
        Cell(NAME, name, {"speed_m_s": speed, "restrictions": mode})
        for speed, (name, mode) in product(SPEEDS_M_S, grid.controllers(DEFAULT_RESTRICTIONS))
    ]


@dataclass
class _Limb:
    """Stays between upper arm and forearm, and measures what they press it with."""

    model: RobotModel
    aside: float
    """Where it lies along the axis of the fold [m]."""
    force: list[float] = field(default_factory=list)
    """The smaller of the forces of both links at each physics step [N]."""

    def links(self) -> tuple[int, int]:
        """Return the links that catch it."""
        name = self.model.description.name
        return self.model.link_index(f"{name}_link2"), self.model.link_index(f"{name}_link5")

    def middle(self, position: FloatArray, rotation: FloatArray) -> FloatArray:
        """Where it lies (3,) [m], given all links' origins and orientations."""
        one, other = (self.model.capsules.of_links(np.array([link])) for link in self.links())
        ends = [
            position[c.link] + np.einsum("cij,cj->ci", rotation[c.link], end)
            for c in (one, other)
            for end in (c.a, c.b)
        ]
        first, second = nearest_points(ends[0][:, None], ends[1][:, None], ends[2][None], ends[3][None])
        gap = np.linalg.norm(first - second, axis=2) - one.radius[:, None] - other.radius[None]
        i, j = np.unravel_index(gap.argmin(), gap.shape)
        way = (second[i, j] - first[i, j]) / np.linalg.norm(second[i, j] - first[i, j])
        between = 0.5 * (first[i, j] + one.radius[i] * way + second[i, j] - other.radius[j] * way)
        return np.asarray(between + self.aside * np.array([0.0, 1.0, 0.0]))

    def goal(self, time: float, hand: FloatArray, plant: Plant) -> HandGoal:
        """Return where the person means to keep it."""
        return HandGoal(self.middle(plant.link_position, plant.link_rotation), _RESTS_N)

    def attach(self, plant: Plant, _: object) -> None:
        """Measure before each physics step."""
        limb, wrench, links = plant.mj_model.geom("hand").id, np.zeros(6), self.links()

        def measure(_: float) -> None:
            pressed = dict.fromkeys(links, 0.0)
            for i in range(plant.mj_data.ncon):
                contact = plant.mj_data.contact[i]
                if limb in (contact.geom1, contact.geom2):
                    other = contact.geom1 if contact.geom2 == limb else contact.geom2
                    link = int(plant.mj_model.geom_bodyid[other])
                    mujoco.mj_contactForce(plant.mj_model, plant.mj_data, i, wrench)
                    pressed[link] = pressed.get(link, 0.0) + float(wrench[0])
            self.force.append(min(pressed[link] for link in links))

        plant.before_each_step(measure)


def trial(cell: Cell, seed: int, context: Context) -> tuple[Row, Record]:
    """Run one trial; return its row of results and what it left behind."""
    rng, model = np.random.default_rng([seed, 43]), context.model
    limb = _Limb(model, _ASIDE_M * rng.uniform(-1, 1))
    kin = model.kinematics(brought_to(model, _FROM_TO_M[0]))
    x, y, z = limb.middle(kin.position, kin.rotation).tolist()
    found = context.profile(cell)
    setup = Setup(
        model=model,
        skin=context.skin,
        profile=replace(found, task=replace(found.task, speed_m_s=float(cell.where["speed_m_s"]))),
        scene=SceneSpec(hand=HandSpec(radius=rng.uniform(*_RADIUS_M), stiffness=40_000.0, mass=2.0, start=(x, y, z))),
        path=WayPoints(_FROM_TO_M, closed=True),
        seed=seed,
        recording=context.recording,
        hand=limb,
        prepare=limb.attach,
    )
    record = play(setup, lambda step, _: step.stamp >= _END_S)
    row = {"experiment": NAME, **cell.where, "profile": cell.profile, "seed": seed}
    return row | results(np.array(limb.force), record), record


def results(force: FloatArray, record: Record) -> Row:
    """Numbers of one trial, given the force (T,) [N] with which the limb was squeezed at each millisecond."""
    squeezed, last = force > TOUCH_N, record.steps[-1]
    said = [s.reason for s in record.steps if "aught between two things" in s.reason]
    return {
        "caught": bool(squeezed.any()),
        "peak_20ms_n": rounded(peak(mean_over(force, 20))),
        "squeezed_s": rounded(float(squeezed.sum()) / 1000.0),
        "contacts": len(record.reactions()),
        "recognised": bool(said),
        "links": bool(said) and all(f"link{n}" in said[0] for n in (2, 5)),
        "latched": last.mode is Mode.HOLD and "resume" in last.reason,
    }


_MEASURES = ("peak_20ms_n", "squeezed_s", "contacts")


def summarise(rows: list[Row]) -> Row:
    """Medians over the seeds of each cell."""
    by = ("speed_m_s", "restrictions", "profile")
    return {"cells": cells_of(rows, by, _MEASURES, totals=("caught", "recognised", "links", "latched"))}


def tables(part: Row) -> list[TextTable]:
    """What was between the links."""
    rows = tuple(
        (
            f"{cell['speed_m_s']:g}",
            cell["profile"],
            f"{cell['caught']}/{cell['trials']}",
            str(cell["recognised"]),
            str(cell["links"]),
            number(cell["peak_20ms_n"], 0),
            number(cell["squeezed_s"], 2),
            number(cell["contacts"], 0),
            str(cell["latched"]),
        )
        for cell in part["cells"]
    )
    table = TextTable(
        "A limb in the crook of the arm: medians",
        ("speed\n[m/s]", "profile", "caught", "recognised", "links", "peak\n[N]", "for\n[s]", "contacts", "latched"),
        rows,
        f"A limb 9 to 11 cm thick between upper arm and forearm, for {_END_S:g} s of folding and unfolding. Peak: of"
        " the force that squeezes it, mean of 20 ms. For: while squeezed. Recognised: trials in which the arm said that"
        " something was caught between two of its links. Links: those in which it named the right ones. Latched:"
        " trials that end in a HOLD until a person resumes.",
    )
    return [table]


EXPERIMENT = Experiment(NAME, cells, trial, lambda cell: _END_S, summarise, tables)
