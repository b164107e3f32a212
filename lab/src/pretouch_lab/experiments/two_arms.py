"""Two arms that reach over one table with a person between: blind to each other, in view of the skin, or informed."""

from dataclasses import dataclass, field
from functools import partial
from itertools import product

import mujoco
import numpy as np

from pretouch.arms.other_arm import OtherArm
from pretouch.control.path import WayPoints
from pretouch.controller import Controller
from pretouch.loop import Options, turn
from pretouch.profiles import Profile, profile
from pretouch.robot.postures import brought_to
from pretouch.sim.hand import FREE_N, Hand, PersonArm
from pretouch.sim.plant import TOUCH_N, ArmInWorld, Plant, PlantClock
from pretouch.sim.range_finder import RangeFinders
from pretouch.sim.scene import BasePose, HandSpec, SceneSpec, fixtures
from pretouch.text_table import TextTable
from pretouch.types import ControlStep, FloatArray, RobotState
from pretouch_lab.experiment import Context, Experiment, controllers
from pretouch_lab.experiments.avoidance import Walk
from pretouch_lab.options import TrialOptions
from pretouch_lab.run import Row
from pretouch_lab.second_arm import SecondArm
from pretouch_lab.table import Column, medians, rounded
from pretouch_lab.trial import SETTLE_S, Record

KNOWS = ("blind", "seen", "told")
"""Knowledge of each arm about the other: none, as its units see through it; readings of its units; or its reported
state, which makes it a moving fixture."""
_DURATION_S = 40.0
APART = BasePose((1.1, 0.0, 0.0), np.pi)
"""Base of the second arm: across the table, face to face with the first."""
BACK: FloatArray = np.asarray(np.linalg.inv(APART.T))
"""Base of the first arm in the base frame of the second (4, 4)."""
_HOME_M, _REACH_M = np.array([0.35, 0.35, 0.35]), np.array([0.58, 0.0, 0.25])
"""Start and goal of each arm in its own base frame, but for the sign of the start's y: in the world both arms start at
+y, and reach over the middle by 3 cm."""
_RESTS_M = np.array([0.55, -0.8, 0.45])
"""Waiting place of the person's hand."""
_AIM_M = np.array([0.55, 0.0, 0.3])
"""Goal of the person's hand, varied by up to `_SPREAD_M`."""
_SPREAD_M = 0.08
_EVERY_S, _STAYS_S, _REACHING_S = 7.0, 1.5, 1.6
"""Time from one visit to the next, duration of a stay, and duration of reaching."""
_SPEED_M_S = 0.5


def reaches(rng: np.random.Generator, duration: float) -> Walk:
    """Draw the visits of a person who reaches between the arms again and again, without regard to them."""
    begin, count = 5.0 + 3.0 * rng.uniform(), int(duration / _EVERY_S) + 1
    aims, rests = _AIM_M + _SPREAD_M * rng.uniform(-1, 1, (count, 3)), np.tile(_RESTS_M, (count, 1))
    # the goal jumps, and the person follows at `_SPEED_M_S`
    jumps = np.repeat([0.0, _REACHING_S + _STAYS_S], 2) - [1e-6, 0.0, 1e-6, 0.0]
    times = begin + np.add.outer(_EVERY_S * np.arange(count), jumps)
    return Walk(times.ravel(), np.stack([rests, aims, aims, rests], axis=1).reshape(-1, 3), FREE_N)


def way(side: float, share: float) -> WayPoints:
    """Return the path from home to the goal and back, starting at a fraction of the way to the goal."""
    home, reach = _HOME_M * [1.0, side, 1.0], _REACH_M
    points = [home, reach] if share == 0.0 else [home + share * (reach - home), reach, home]
    return WayPoints(np.array(points), closed=True)


@dataclass
class Peaks:
    """Largest forces between two arms, and of either on the person."""

    arms_n: float = 0.0
    person_n: float = 0.0

    def attach(self, first: Plant, second: SecondArm) -> None:
        """Measure before each physics step."""
        mj, data, wrench = first.mj_model, first.mj_data, np.zeros(6)
        hand, bodies = int(mj.body("hand").id), np.arange(mj.nbody)
        # 1 and 2 for the bodies of the arms, 0 for everything else
        owner = np.where((bodies > 0) & (bodies < len(first.model.links)), 1, 0)
        owner[second.first_body + 1 : second.first_body + len(second.model.links)] = 2

        def measure(_: float) -> None:
            between, on_person = np.zeros(3), np.zeros((3, 3))
            for i in range(data.ncon):
                contact = data.contact[i]
                one, other = (int(mj.geom_bodyid[geom]) for geom in (contact.geom1, contact.geom2))
                mujoco.mj_contactForce(mj, data, i, wrench)
                force = contact.frame.reshape(3, 3).T @ wrench[:3]
                if owner[one] and owner[other]:
                    between += force if owner[one] < owner[other] else -force
                elif hand in (one, other):
                    on_person[owner[one] or owner[other]] += force if other == hand else -force
            self.arms_n = max(self.arms_n, float(np.linalg.norm(between)))
            self.person_n = max(self.person_n, float(np.linalg.norm(on_person[1:], axis=1).max()))

        first.before_each_step(measure)


@dataclass
class Side:
    """One of the two arms with its controller and its steps."""

    arm: ArmInWorld
    units: RangeFinders
    controller: Controller
    options: Options
    """Options of the loop, with the other arm as a moving fixture if it is known."""
    steps: list[ControlStep] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.robot = self.arm.read()
        self._state = self.controller.init(self.robot)

    def turn(self, tick: float) -> None:
        """Run one control cycle at a tick [s]."""
        cycle = turn(self.controller, self._state, self.arm, self.units, tick, self.options)
        self._state, self.robot = cycle.after, cycle.inputs.robot
        self.steps.append(cycle.step)


def play(context: Context, profile: Profile, knows: str, seed: int, duration: float) -> tuple[list[Side], Peaks]:
    """Run a trial; `knows` is one of `KNOWS`."""
    model, rng = context.model, np.random.default_rng([seed, 61])
    ways = way(1.0, 0.0), way(-1.0, float(rng.uniform()))
    person = reaches(rng, duration)
    x, y, z = _RESTS_M.tolist()
    second = SecondArm(model, APART, context.arm, seed + 1_000_000)
    scene = SceneSpec(hand=HandSpec(start=(x, y, z)), second=second.spec)
    first = Plant(model, scene, context.arm, brought_to(model, ways[0].point(0.0)), seed)
    second.join(first, brought_to(model, ways[1].point(0.0)))
    Hand(first, person, PersonArm(speed_max=_SPEED_M_S))
    peaks = Peaks()
    peaks.attach(first, second)
    arms: tuple[ArmInWorld, ArmInWorld] = (first, second)
    units = [_mounted(arms[i], arms[1 - i], context, seed + 1_000_000 * i, knows == "blind") for i in (0, 1)]
    first.advance(SETTLE_S)
    sides: list[Side] = []
    for i, T in enumerate((APART.T, BACK)):
        across = OtherArm(model, T, partial(_reported, sides, 1 - i), fixtures(scene).capsules)
        controller = Controller(model, context.skin, fixtures(scene), ways[i], profile)
        options = Options(moving=across) if knows == "told" else Options()
        sides.append(Side(arms[i], units[i], controller, options))
    clock = PlantClock(first, profile.task.control_period_s)
    while first.time < duration:
        tick = clock.tick()
        for side in sides:
            side.turn(tick)
    return sides, peaks


def _reported(sides: list[Side], number: int) -> RobotState:
    return sides[number].robot


def _mounted(arm: ArmInWorld, across: ArmInWorld, context: Context, seed: int, blind: bool) -> RangeFinders:
    """Mount the units on an arm; if blind, they see through the other arm, which is transparent to them."""
    mj = arm.mj_model
    links = np.arange(across.first_body + 1, across.first_body + len(across.model.links))
    of_it = np.isin(mj.geom_bodyid, links)
    before = mj.geom_rgba[of_it, 3].copy()
    if blind:
        mj.geom_rgba[of_it, 3] = 0.0
    units = RangeFinders(arm, context.skin, context.ranging, seed)
    mj.geom_rgba[of_it, 3] = before
    return units


def cells(options: TrialOptions) -> list[Row]:
    """Return cells of each profile with proximity and each value of `KNOWS`."""
    return [
        {"knows": knows, **controller}
        for controller, knows in product(controllers(options, "slack"), KNOWS)
        if profile(controller["profile"]).perception
    ]


def trial(cell: Row, seed: int, context: Context) -> tuple[Row, Record | None]:
    """Run one trial; return its row."""
    own = context.profile(cell)
    sides, peaks = play(context, own, cell["knows"], seed, _DURATION_S)
    return results(sides, peaks, own.task.speed_m_s * (_DURATION_S - sides[0].steps[0].stamp)), None


def results(sides: list[Side], peaks: Peaks, asked_m: float) -> Row:
    """Return the measures of a trial; `asked_m` is the demanded path length of each arm [m]."""
    return {
        "arms_touched": peaks.arms_n > TOUCH_N,
        "arms_peak_n": rounded(peaks.arms_n, 1),
        "person_touched": peaks.person_n > TOUCH_N,
        "person_peak_n": rounded(peaks.person_n, 1),
        "done": rounded(float(np.mean([side.steps[-1].path_phase for side in sides])) / asked_m, 4),
    }


_COLUMNS = (
    Column("profile", "profile"),
    Column("other arm", "knows"),
    Column("arms\ntouch", "arms_touched", of="trials"),
    Column("peak\n[N]", "arms_peak_n", 0),
    Column("person\ntouched", "person_touched", of="trials"),
    Column("peak\n[N]", "person_peak_n", 0),
    Column("way\n[%]", "done", 0, 100.0),
)


def tables(rows: list[Row]) -> list[TextTable]:
    """Return a table of contacts, and of progress along the paths."""
    note = (
        "Blind: the units see through the other arm. Seen: it is an obstacle like any other. Told: its reported joint"
        " positions make it a moving fixture. Arms touch, person touched: trials with such a contact. Peak: largest"
        f" force of a trial. Way: distance over the demanded distance in {_DURATION_S:g} s, the mean of both arms."
    )
    title = "Two arms over one table, a person between: medians over the seeds"
    return [medians(title, _COLUMNS, rows, ("profile", "restrictions", "knows"), note, 2)]


EXPERIMENT = Experiment("two-arms", cells, trial, tables)
