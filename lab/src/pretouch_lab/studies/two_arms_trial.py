"""Two arms over one table with a person between them, in one world, each under a controller of its own."""

from collections.abc import Callable
from dataclasses import dataclass, field

import mujoco
import numpy as np

from pretouch.arms.other_arm import OtherArm
from pretouch.control.path import WayPoints
from pretouch.controller import Controller
from pretouch.loop import Options, turn
from pretouch.profiles import Profile
from pretouch.robot.postures import brought_to
from pretouch.sim.hand import Hand, HandGoal, PersonArm
from pretouch.sim.plant import ArmInWorld, Plant, PlantClock
from pretouch.sim.range_finder import RangeFinders
from pretouch.sim.scene import BasePose, HandSpec, SceneSpec, fixtures
from pretouch.types import ControlStep, FloatArray, MovingFixtures, RobotState
from pretouch_lab.cell import Context
from pretouch_lab.studies.second_arm import SecondArm
from pretouch_lab.trial import SETTLE_S

APART = BasePose((1.1, 0.0, 0.0), np.pi)
"""Where the second arm stands: across the table, face to face with the first."""
BACK: FloatArray = np.asarray(np.linalg.inv(APART.T))
"""Where the first stands in the base frame of the second (4, 4)."""
_HOME_M, _REACH_M = np.array([0.35, 0.35, 0.35]), np.array([0.58, 0.0, 0.25])
"""Where each arm comes from and what it reaches for, in its own base frame but for the sign of home's y: in the world
both come from +y, and reach over the middle by 3 cm."""
_RESTS_M = np.array([0.55, -0.8, 0.45])
"""Where the person's hand waits."""
_AIM_M = np.array([0.55, 0.0, 0.3])
"""What it reaches for, within `_SPREAD_M`."""
_SPREAD_M = 0.08
_EVERY_S, _STAYS_S, _REACHING_S = 7.0, 1.5, 1.6
"""Time between two visits, how long the hand stays, and how long it is on its way."""
_FREE_N = 60.0
"""Force a person moves the free hand with [N], as in the other experiments."""
_SPEED_M_S = 0.5


@dataclass
class Visits:
    """A person who reaches between the arms again and again, whatever they do."""

    begin: float
    """When the first visit begins [s]."""
    aims: FloatArray
    """(V, 3) what each visit reaches for [m]."""

    def goal(self, time: float, hand: FloatArray, plant: Plant) -> HandGoal:
        """Reach, stay and withdraw, each visit with its own aim."""
        visit, since = divmod(time - self.begin, _EVERY_S)
        inside = time >= self.begin and visit < len(self.aims) and since < _REACHING_S + _STAYS_S
        return HandGoal(self.aims[int(visit)] if inside else _RESTS_M, _FREE_N)


def visits(rng: np.random.Generator, duration: float) -> Visits:
    """Draw the visits of a trial."""
    count = int(duration / _EVERY_S) + 1
    return Visits(5.0 + 3.0 * rng.uniform(), _AIM_M + _SPREAD_M * rng.uniform(-1, 1, (count, 3)))


def way(side: float, share: float) -> WayPoints:
    """Return the way from home to what is reached for and back, begun at a share of the way there."""
    home, reach = _HOME_M * [1.0, side, 1.0], _REACH_M
    points = [home, reach] if share == 0.0 else [home + share * (reach - home), reach, home]
    return WayPoints(np.array(points), closed=True)


@dataclass
class Felt:
    """What touched what, before each physics step."""

    time: list[float] = field(default_factory=list)
    arms_n: list[float] = field(default_factory=list)
    """Force between the arms [N]."""
    person_n: list[float] = field(default_factory=list)
    """The larger of both arms' forces on the person [N]."""

    def attach(self, first: Plant, second: SecondArm) -> None:
        """Measure before each physics step."""
        mj, data, wrench = first.mj_model, first.mj_data, np.zeros(6)
        hand, bodies = int(mj.body("hand").id), np.arange(mj.nbody)
        # 1 and 2 for the bodies of the arms, 0 for everything else
        owner = np.where((bodies > 0) & (bodies < len(first.model.links)), 1, 0)
        owner[second.first_body + 1 : second.first_body + len(second.model.links)] = 2

        def measure(time: float) -> None:
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
            self.time.append(time)
            self.arms_n.append(float(np.linalg.norm(between)))
            self.person_n.append(float(np.linalg.norm(on_person[1:], axis=1).max()))

        first.before_each_step(measure)


@dataclass
class Side:
    """One of the two arms with its controller, and what it did."""

    arm: ArmInWorld
    units: RangeFinders
    controller: Controller
    other: OtherArm
    """The arm across, seen from this one's base."""
    reported: Callable[[], RobotState]
    """Gives the newest state of that arm."""
    told: bool
    """Whether the controller is told."""
    steps: list[ControlStep] = field(default_factory=list)
    across: list[MovingFixtures] = field(default_factory=list)
    """Where the other arm was at each step."""

    def __post_init__(self) -> None:
        self.robot = self.arm.read()
        self._state = self.controller.init(self.robot)

    def turn(self, tick: float) -> None:
        """Let one control cycle pass at a tick [s], in which the other is known by its newest state."""
        there = self.other.at(self.reported())
        told = there if self.told else None
        cycle = turn(self.controller, self._state, self.arm, self.units, tick, Options(moving=lambda: told))
        self._state, self.robot = cycle.after, cycle.inputs.robot
        self.steps.append(cycle.step)
        self.across.append(there)


@dataclass(frozen=True)
class Played:
    """What a trial left behind."""

    sides: tuple[Side, Side]
    felt: Felt
    hand: FloatArray
    """(S, 3) centre of the person's hand at each control step [m], base frame of the first arm."""


def play(context: Context, profile: Profile, knows: str, seed: int, duration: float) -> Played:
    """Run a trial; `knows` is what each arm has of the other: `blind`, `seen` or `told`."""
    model, rng = context.model, np.random.default_rng([seed, 61])
    ways = way(1.0, 0.0), way(-1.0, float(rng.uniform()))
    person = visits(rng, duration)
    x, y, z = _RESTS_M.tolist()
    second = SecondArm(model, APART, context.arm, seed + 1_000_000)
    scene = SceneSpec(hand=HandSpec(start=(x, y, z)), second=second.spec)
    first = Plant(model, scene, context.arm, brought_to(model, ways[0].point(0.0)), seed)
    second.join(first, brought_to(model, ways[1].point(0.0)))
    hand = Hand(first, person, PersonArm(speed_max=_SPEED_M_S))
    felt = Felt()
    felt.attach(first, second)
    arms: tuple[ArmInWorld, ArmInWorld] = (first, second)
    units = [_mounted(arm, across, context, seed + 1_000_000 * i, knows == "blind")
             for i, (arm, across) in enumerate(zip(arms, arms[::-1], strict=True))]  # fmt: skip
    first.advance(SETTLE_S)
    known, poses = fixtures(scene), (APART.T, BACK)
    sides: list[Side] = []
    for i, arm in enumerate(arms):
        reported = _reported(sides, 1 - i)
        other = OtherArm(model, poses[i], reported, known.capsules)
        controller = Controller(model, context.skin, known, ways[i], profile)
        sides.append(Side(arm, units[i], controller, other, reported, knows == "told"))
    clock, hands = PlantClock(first, profile.task.control_period_s), []
    while first.time < duration:
        tick = clock.tick()
        for side in sides:
            side.turn(tick)
        hands.append(hand.position.copy())
    return Played((sides[0], sides[1]), felt, np.array(hands))


def _reported(sides: list[Side], which: int) -> Callable[[], RobotState]:
    return lambda: sides[which].robot


def _mounted(arm: ArmInWorld, across: ArmInWorld, context: Context, seed: int, blind: bool) -> RangeFinders:
    """Mount the units on an arm; blind ones see through the arm across, as through all that is transparent."""
    mj = arm.mj_model
    links = np.arange(across.first_body + 1, across.first_body + len(across.model.links))
    of_it = np.isin(mj.geom_bodyid, links)
    before = mj.geom_rgba[of_it, 3].copy()
    if blind:
        mj.geom_rgba[of_it, 3] = 0.0
    units = RangeFinders(arm, context.skin, context.ranging, seed)
    mj.geom_rgba[of_it, 3] = before
    return units
