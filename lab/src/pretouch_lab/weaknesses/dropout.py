"""A few readings in a row are lost while the arm stands before a board: what of thresholds, rows and speed jumps."""

from dataclasses import dataclass, field
from itertools import pairwise, product

import mujoco
import numpy as np

from pretouch.control.approach import ApproachRestriction, approach_rows
from pretouch.control.path import line
from pretouch.control.qp import solve, task, task_cost
from pretouch.perception.closest import no_obstacles
from pretouch.perception.obstacles import sensor_poses
from pretouch.profiles import Profile, profile
from pretouch.robot.model import RobotModel
from pretouch.sensing.sensor import PAPER_SENSOR, cone_rays
from pretouch.sensing.skin import Skin
from pretouch.sim.paper_scenes import static_scene
from pretouch.sim.plant import Plant
from pretouch.sim.range_finder import RangeFinders
from pretouch.text_table import TextTable, tabulated
from pretouch.types import ControlStep, FloatArray, Mode, QpOutcome
from pretouch_lab.cell import Cell, Context, Grid
from pretouch_lab.experiment import Experiment
from pretouch_lab.paper import static
from pretouch_lab.rows import Row, cells_of, grouped, peak, rounded, spread
from pretouch_lab.tables import median, plain, share
from pretouch_lab.trial import Record, play

NAME = "dropout"
DEFAULT_RESTRICTIONS = "slack"

READINGS = (0, 1, 2, 3, 5, 10, 20)
"""How many readings in a row are lost."""
KEPT = ("", ":perception.persistence_s=0.04", ":perception.persistence_s=0.021")
"""Changes of a profile: as it is, a point kept until the next reading should have come in, 20 ms and its delay after
the last, and one kept until the next is measured."""

_STIFFNESS_N_M = 25_000.0
_GAP_M = (0.2, 0.4)
"""How far before the board the side of the robot's hand starts [m]."""
_HAND_HALF_WIDTH_M = 0.102
_BEGIN_S = 2.0
"""The loss begins within one period of the units after this: the window is full and the arm under way [s]."""
WATCHED_S = 0.5
"""For how long from the beginning of the loss the arm is watched [s]."""
_BEFORE_S = 0.05
"""Speeds are compared with the mean over this time before the loss [s]."""
_STEADY_S = 0.2
"""A unit whose row was there all this time before the loss sees the board, and not its edge now and then [s]."""
_Y = 1
"""The axis on which the board stands."""
_PERIOD_S = PAPER_SENSOR.ranging("short").period_s


def cells(grid: Grid) -> list[Cell]:
    """A cell for each number of readings and each persistence, of each profile that senses."""
    controllers = [
        (name, mode) for name, mode in grid.controllers(DEFAULT_RESTRICTIONS) if profile(name).perception is not None
    ]
    return [
        Cell(NAME, name + change, {"readings": float(count), "restrictions": mode})
        for (name, mode), change, count in product(controllers, KEPT, READINGS)
    ]


@dataclass
class Loss:
    """Silences the units that see the board for a while, and notes the stamps of the readings that come through."""

    skin: Skin
    begin: float
    """[s]"""
    end: float
    """[s]"""
    facing: list[int] = field(default_factory=list)
    """The units that saw the board when the loss began."""
    stamps: list[FloatArray] = field(default_factory=list)
    """(K,) stamps of the newest readings of all units, at each physics step of the loss and after [s]."""

    def attach(self, plant: Plant, units: RangeFinders) -> None:
        """Have it done before each physics step."""
        plant.before_each_step(lambda time: self._at(time, plant, units))

    def _at(self, time: float, plant: Plant, units: RangeFinders) -> None:
        if time < self.begin:
            return
        if not self.stamps:
            self.facing = facing(plant, self.skin, "object")
        units.silenced = set(self.facing) if time < self.end else set()
        self.stamps.append(units.read().stamp)

    def lost(self) -> list[int]:
        """How many readings of each of these units did not come through, by the gaps between those that did."""
        stamps = np.array(self.stamps)
        gaps = [np.diff(np.unique(stamps[:, unit])) for unit in self.facing]
        return [int(np.maximum(np.round(gap / _PERIOD_S) - 1, 0).sum()) for gap in gaps]


def facing(plant: Plant, skin: Skin, name: str) -> list[int]:
    """Units in whose cone a geom of the scene is the first that some ray meets."""
    wanted, rays = plant.mj_model.geom(name).id, cone_rays(2, PAPER_SENSOR.angle)
    position, rotation = sensor_poses(skin, plant.model.kinematics(plant.mj_data.qpos[: plant.model.n]))
    geom, distance = np.zeros(len(rays), np.int32), np.zeros(len(rays))
    found = []
    for unit, link in enumerate(skin.link):
        beams = (rays @ rotation[unit].T).reshape(-1)
        mujoco.mj_multiRay(
            plant.mj_model, plant.mj_data, position[unit], beams, None, True, int(link), geom, distance, None,
            len(rays), PAPER_SENSOR.ranging("short").distance_max_m,
        )  # fmt: skip
        if wanted in geom[distance >= 0]:
            found.append(unit)
    return found


def trial(cell: Cell, seed: int, context: Context) -> tuple[Row, Record]:
    """Run one trial; return its row of results and what it left behind."""
    rng = np.random.default_rng([seed, 32])
    side, gap = static.SIDES[rng.integers(2)], rng.uniform(*_GAP_M)
    begin = _BEGIN_S + rng.uniform(0, _PERIOD_S)
    loss = Loss(context.skin, begin, begin + float(cell.where["readings"]) * _PERIOD_S)
    scene, sign = static_scene("line", side, _STIFFNESS_N_M, seed), 1.0 if side == "+y" else -1.0
    board = scene.boxes[0]
    start = abs(board.center[1]) - board.half_size[1] - _HAND_HALF_WIDTH_M - gap
    setup = context.setup(
        cell,
        seed,
        scene,
        # the line of the static experiment, begun on the board's side of the plane y = 0
        line((0.4, start * sign, 0.5), (0.4, 0.5 * sign, 0.5)),
        prepare=loss.attach,
    )
    record = play(setup, lambda step, _: step.stamp >= begin + WATCHED_S)
    row = {
        **cell.row(seed),
        "gap_m": rounded(gap),
        "units": [context.skin.ids[unit] for unit in loss.facing],
        "lost": loss.lost(),
        **results(record, loss, sign, setup.profile, context.model),
    }
    return row, record


def results(record: Record, loss: Loss, sign: float, params: Profile, model: RobotModel) -> Row:
    """Largest changes between successive steps in the 0.5 s after the loss begins, and speeds towards the board.

    Thresholds are those along y. Rows are those of units that had one all the time before: one that sees the board's
    edge now and then flickers without a loss, too.
    """
    first = next(i for i, s in enumerate(record.steps) if s.stamp >= loss.begin)
    steps = record.steps[first - 1 :]  # changes count from the last step before
    before = record.steps[first - 1 - round(_BEFORE_S / params.task.control_period_s) : first]
    scale = np.array([s.speed_scale for s in steps])
    reach = model.description.qdd_max * params.task.control_period_s
    watched = steady(record.steps[:first], loss)
    known = [_limits(s, watched) for s in steps]
    shared = [abs(now[unit] - last[unit]) for last, now in pairwise(known) for unit in now.keys() & last.keys()]
    start = float(np.mean(_towards(before, sign)))
    return {
        "threshold_step_n": rounded(
            peak(np.abs(np.diff([[s.thresholds.upper[_Y], s.thresholds.lower[_Y]] for s in steps], axis=0)))
        ),
        "limit_step_m_s": rounded(max(shared), 4) if shared else None,
        "rows_vanished": sum(not last.keys() <= now.keys() for last, now in pairwise(known)) if watched else None,
        "command_step": rounded(peak(np.abs(np.diff([s.command for s in steps], axis=0)) / reach)),
        "free_step": _free_step(steps, record.steps[0].q, params, model, reach),
        "least_scale": rounded(float(scale.min())),
        "largest_scale": rounded(float(scale.max())),
        "scale_rise": rounded(peak(np.diff(scale)), 4),
        "towards_before_m_s": rounded(start, 4),
        "towards_most_m_s": rounded(float(_towards(steps, sign).max()), 4),
        "holds": sum(a.mode is not Mode.HOLD and b.mode is Mode.HOLD for a, b in pairwise(steps)),
        "reactions": sum(s.contact is not None for s in steps[1:]),
    }


def steady(before: list[ControlStep], loss: Loss) -> list[int]:
    """Units that saw the board when the loss began and had a row in all steps shortly before."""
    recent = [s for s in before if s.stamp > loss.begin - _STEADY_S]
    return [unit for unit in loss.facing if all(unit in s.obstacles.unit[s.restricted] for s in recent)]


def _limits(step: ControlStep, units: list[int]) -> dict[int, float]:
    """Approach limit [m/s] of the row of each of some units that has one."""
    rows = zip(step.obstacles.unit[step.restricted].tolist(), step.approach_limit.tolist(), strict=True)
    return {unit: limit for unit, limit in rows if unit in units}


def _towards(steps: list[ControlStep], sign: float) -> FloatArray:
    """Speed (S - 1,) [m/s] of the end-effector towards the board between S steps; from positions, without noise."""
    y = np.array([s.ee_position[1] for s in steps])
    return sign * np.diff(y) / np.diff([s.stamp for s in steps])


def _free_step(
    steps: list[ControlStep], q_start: FloatArray, params: Profile, model: RobotModel, reach: FloatArray
) -> float | None:
    """Largest change between successive steps of what the QP would answer were there no acceleration limits.

    In units of the change those limits allow in one step, `reach` (n,) [rad/s]. Steps without a QP are left out.
    """
    upright = model.kinematics(q_start).rotation[model.ee]
    free = [free_answer(s, upright, params, model) for s in steps]
    changes = [np.abs(now - last) / reach for last, now in pairwise(free) if now is not None and last is not None]
    return rounded(peak(np.array(changes))) if changes else None


def free_answer(step: ControlStep, upright: FloatArray, params: Profile, model: RobotModel) -> FloatArray | None:
    """Return the answer (n,) [rad/s] to a step's QP within the joints' speed limits alone, None where it posed none."""
    if step.qp.outcome is QpOutcome.SKIPPED:
        return None
    kin = model.kinematics(step.q)
    part = params.approach  # rows of another part would be other ones
    approach = part if isinstance(part, ApproachRestriction) else ApproachRestriction(rows="hard")
    rows, _ = approach_rows(kin, model.moved_by, no_obstacles() if part is None else step.obstacles, approach)
    goal = task(model.ee_jacobian(kin), step.desired_velocity, kin.rotation[model.ee], upright, params.task)
    cost, fastest = task_cost(*goal, step.q, model.q_mid, params.task), model.description.qd_max
    return solve(cost, -fastest, fastest, rows, approach.slack_weight, np.zeros(model.n)).qd


_MEASURES = (
    "threshold_step_n", "limit_step_m_s", "rows_vanished", "command_step", "free_step", "least_scale",
    "largest_scale", "scale_rise", "towards_before_m_s", "towards_most_m_s",
)  # fmt: skip
_KEYS = ("readings", "restrictions", "profile")


def summarise(rows: list[Row]) -> Row:
    """Medians over the seeds of each cell."""
    found = cells_of(rows, _KEYS, _MEASURES, totals=("holds", "reactions"))
    for cell, (_, group) in zip(found, grouped(rows, _KEYS), strict=True):
        cell["lost"] = spread([count for row in group for count in row["lost"]])
        steadily = [row["rows_vanished"] for row in group if row["rows_vanished"] is not None]
        cell["trials_with_rows"], cell["trials_without_rows"] = len(steadily), sum(count > 0 for count in steadily)
    return {"cells": found}


def _kept_s(name: str) -> float:
    """How long a profile keeps a point [s]."""
    return profile(name).sight.persistence_s


def _base(name: str) -> str:
    """Return the profile without the change of its persistence."""
    return name.split(":perception.persistence_s=")[0]


def _label(cell: Row, with_mode: bool) -> str:
    kept = f"{_base(cell['profile'])}\n{1000 * _kept_s(cell['profile']):.0f} ms"
    return f"{kept}\n{cell['restrictions']}" if with_mode else kept


def tables(part: Row) -> list[TextTable]:
    """What lost readings change from one step to the next."""
    several = len({cell["restrictions"] for cell in part["cells"]}) > 1
    rows = [
        cell | {"label": _label(cell, several) if cell is shown[0] else ""}
        for shown in _by_profile(part["cells"])
        for cell in shown
    ]
    columns = (
        ("profile\nkept", plain("label")),
        ("n", plain("readings", "g")),
        ("lost", median("lost", 0)),
        ("bound\n[N]", median("threshold_step_n", 2)),
        ("limit\n[m/s]", median("limit_step_m_s", 3)),
        ("rows\ngone", share("trials_without_rows", "trials_with_rows")),
        ("com-\nmand", median("command_step", 2)),
        ("free\nQP", median("free_step", 2)),
        ("fac-\ntor", median("least_scale", 2)),
        ("rise", median("scale_rise", 4)),
        ("before\n[m/s]", median("towards_before_m_s", 3)),
        ("most\n[m/s]", median("towards_most_m_s", 3)),
        ("hold", plain("holds")),
    )
    title = f"Readings of a board are lost: medians of the {WATCHED_S:g} s after"
    return [tabulated(title, columns, rows, _NOTE)]


_NOTE = (
    "Kept: how long a point outlives its measurement. n: readings silenced; lost: those really lost, by each unit that"
    " saw the board. Bound: largest change of a contact threshold along y from one step to the next; limit: of an"
    " approach limit that is there before and after. Rows gone: trials in which an approach limit vanished,"
    " of those in which a unit had one all of the 0.2 s before. Command:"
    " largest change of a joint's command in a step, free QP: of what the QP would answer without acceleration limits;"
    " both of what those limits allow."
    " Factor: least one on the speed, rise: its largest in a step. Before, most: speed towards the board before the"
    " loss, and the most after it. Hold: changes to HOLD."
)


def _by_profile(found: list[Row]) -> list[list[Row]]:
    """The cells of each profile and restriction mode together, fewest readings first."""
    return [
        sorted(group, key=lambda cell: float(cell["readings"]))
        for _, group in grouped(found, ("profile", "restrictions"))
    ]


EXPERIMENT = Experiment(NAME, cells, trial, lambda _: _BEGIN_S + WATCHED_S, summarise, tables)
