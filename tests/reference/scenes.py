"""What happens to an arm, cycle by cycle: obstacles, pushes, and everything that goes wrong. Seeded."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from pretouch.control.path import Circle, Path, segment
from pretouch.params import WindowParams
from pretouch.perception.scene_filter import Fixtures, no_fixtures
from pretouch.profiles import PROFILES, Profile
from pretouch.robot.body import Capsules
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.sensing.unit import SensorUnit
from pretouch.types import Inputs, RangeReadings, RangeStatus, RobotState

READY = (0.0, -np.pi / 4, 0.0, -3 * np.pi / 4, 0.0, np.pi / 2, np.pi / 4)
QUICK = replace(PROFILES["paper"], window=WindowParams(samples=20))
"""The paper's profile with a window that is full sooner."""

ODD = [s.value for s in RangeStatus if s is not RangeStatus.STUCK]
"""Statuses of the sensor itself; what a receiver makes of its readings is in the scene of all statuses."""

Span = tuple[int, int]
"""From a cycle on up to another."""


def changed(profile: Profile = QUICK, **groups: dict[str, object]) -> Profile:
    """A profile with some parameters changed, group by group."""
    return replace(profile, **{g: replace(getattr(profile, g), **values) for g, values in groups.items()})


def table() -> Fixtures:
    """A floor below the arm and a post beside it."""
    post = Capsules(np.zeros(1, np.int64), np.array([[0.4, 0.6, -0.2]]), np.array([[0.4, 0.6, 0.8]]), np.array([0.05]))
    return Fixtures(np.array([[0.0, 0.0, 1.0, -0.2]]), post)


@dataclass(frozen=True)
class Scene:
    """One course of events."""

    name: str
    profile: Profile = QUICK
    units: int = 7
    """7 is the skin of the paper, any other number is spread over the arm."""
    posture: tuple[float, ...] = READY
    circle: bool = False
    """Whether the path is a closed circle through the hand's place, else a line."""
    fixtures: Callable[[], Fixtures] = no_fixtures
    cycles: int = 120
    near: tuple[float, float] = (0.3, 1.5)
    """Between which distances what the units see comes and goes [m]."""
    swing: float = 6.0
    """How fast it does [rad/s]."""
    odd: float = 0.1
    """Share of readings with any other status than a target."""
    statuses: tuple[int, ...] = ()
    """What the units report, in turns of this, in place of targets."""
    noise: float = 0.5
    """Standard deviation of the force [N]."""
    error: float = 1.0
    """How much what the arm measures is off what it does: 1 is 0.1 mrad and 1 mrad/s."""
    speed: float = 0.0
    """Joint speeds the arm begins with, as a share of the limits."""
    pushes: dict[Span, tuple[float, float, float]] = field(default_factory=dict)
    silent: dict[Span, tuple[int, ...]] = field(default_factory=dict)
    """Units that send nothing."""
    no_wrench: tuple[Span, ...] = ()
    change: dict[int, Callable[[Inputs], Inputs]] = field(default_factory=dict)
    """What becomes of the inputs in some cycles."""
    resume: tuple[int, ...] = ()
    late: dict[int, float] = field(default_factory=dict)
    """Time that passes before a cycle beside the period [s]."""
    seed: int = 0
    meets: tuple[str, ...] = ("track", "solved")
    """What must come up in it, so that it tests what it is for: parts of what `traits` of its steps says."""


def within(cycle: int, span: Span) -> bool:
    """Whether a cycle is one of a span."""
    return span[0] <= cycle < span[1]


def path_of(scene: Scene, x: np.ndarray) -> Path:
    """The scene's path, from the hand's place x (3,) [m]."""
    if scene.circle:
        return Circle((x[0], x[1] - 0.05, x[2]), 0.05)
    return segment(tuple(x), (x[0], x[1] + 0.25, x[2] - 0.1))


class World:
    """An arm that does what it is told, but for small errors, and what its units see."""

    def __init__(self, scene: Scene, model: RobotModel) -> None:
        self.scene, self.dt = scene, scene.profile.task.control_period_s
        self.rng = np.random.default_rng(scene.seed)
        self.q, self.time, self.cycle = np.array(scene.posture), 0.0, 0
        self.qd = scene.speed * model.description.qd_max * self.rng.uniform(-1, 1, model.n)
        count = scene.units
        self.phase, self.rate = self.rng.uniform(0, 2 * np.pi, count), self.rng.uniform(0.5, 1, count) * scene.swing
        self.readings = RangeReadings(np.full(count, -np.inf), np.zeros(count), np.full(count, int(RangeStatus.NONE)))

    def robot(self) -> RobotState:
        """What the arm reports now."""
        scene, rng = self.scene, self.rng
        force = rng.normal(0, scene.noise, 6)
        for span, push in scene.pushes.items():
            force[:3] += np.array(push) * within(self.cycle, span)
        wrench = None if any(within(self.cycle, span) for span in scene.no_wrench) else force
        q = self.q + scene.error * rng.normal(0, 1e-4, 7)
        qd = self.qd + scene.error * rng.normal(0, 1e-3, 7)
        return RobotState(self.time - 0.1 * self.dt, q, qd, self.q, self.qd, np.zeros(7), wrench)

    def inputs(self) -> Inputs:
        """Inputs of this cycle."""
        self.time += self.scene.late.get(self.cycle, 0.0)
        self._measure()
        inputs = Inputs(self.time, self.robot(), self.readings, self.cycle in self.scene.resume)
        return self.scene.change.get(self.cycle, lambda same: same)(inputs)

    def _measure(self) -> None:
        """Some of the units have a new reading, a little old."""
        scene, rng, old = self.scene, self.rng, self.readings
        count = len(old.stamp)
        mute = {unit for span, units in scene.silent.items() if within(self.cycle, span) for unit in units}
        new = (rng.random(count) < 0.6) & ~np.isin(np.arange(count), list(mute))
        low, high = scene.near
        distance = low + (high - low) * (0.5 + 0.5 * np.sin(self.phase + self.rate * self.time))
        status = np.where(rng.random(count) < scene.odd, rng.choice(ODD, count), 0)
        if scene.statuses:
            status = np.resize(scene.statuses, count)
        stamp = self.time - rng.uniform(0, 0.015, count)
        self.readings = RangeReadings(
            np.where(new, stamp, old.stamp), np.where(new, distance, old.distance), np.where(new, status, old.status)
        )

    def obey(self, command: np.ndarray) -> None:
        """Move on by one period."""
        self.qd, self.q = command, self.q + command * self.dt
        self.time, self.cycle = self.time + self.dt, self.cycle + 1


def spoilt(name: str, joint: int, value: float) -> Callable[[Inputs], Inputs]:
    """Put a number into one of the robot's arrays."""

    def change(inputs: Inputs) -> Inputs:
        array = getattr(inputs.robot, name).copy()
        array[joint] = value
        return replace(inputs, robot=replace(inputs.robot, **{name: array}))

    return change


def aged(by: float) -> Callable[[Inputs], Inputs]:
    """Let the robot's state be older than it is."""
    return lambda inputs: replace(inputs, robot=replace(inputs.robot, stamp=inputs.robot.stamp - by))


def broken_units(inputs: Inputs) -> Inputs:
    """Readings of all kinds that cannot be: no numbers, negative, infinite, from the future."""
    r = inputs.readings
    stamp, distance, status = r.stamp.copy(), r.distance.copy(), np.zeros_like(r.status)
    stamp[:5] = inputs.stamp
    distance[:5] = np.nan, np.inf, -1.0, 5.0, 0.01
    stamp[5:] = np.array([np.nan, inputs.stamp + 1.0])
    return replace(inputs, readings=RangeReadings(stamp, distance, status))


NEAR_LIMITS = (2.88, -1.75, -2.91, -0.09, 2.88, 3.73, -2.895)
"""Joints 3 and 7 are beyond the limits or their margin."""
SINGULAR = (0.4, 0.0, np.pi / 2, -1.53, 0.0, 1.47, 0.5)
"""The hand can neither move nor turn about one screw axis."""
SINGULAR_PLACE = (
    -6.557066970198535e-05, -0.6404712494736977, -0.07710596452050314, -0.3893584123731214, 1.5707963267948974,
    2.745452371190014, 0.0005630202366139461,
)  # fmt: skip
"""The hand's origin cannot move along one line, found by minimising the smallest singular value of its Jacobian."""
PUSHES: dict[Span, tuple[float, float, float]] = {(30, 45): (0.0, 40.0, 0.0), (70, 75): (-35.0, 0.0, 20.0)}

SHORT = changed(react={"decay_cycles": 25})
HARD = changed(SHORT, approach={"rows": "hard"})
FLOOR = changed(approach={"rows": "floor"})
OFF = replace(QUICK, approach=None)
FREE = changed(SHORT, task={"orientation": "free"})
BLIND = replace(SHORT, perception=PROFILES["blind"].perception, approach=PROFILES["blind"].approach)
RAW = changed(SHORT, detect={"compare": "raw"})
FAST = changed(task={"control_period_s": 0.001})
AT_ONCE = changed(window={"samples": 2})
HARD_AT_ONCE = changed(AT_ONCE, approach={"rows": "hard"})
GENTLE = changed(AT_ONCE, detect={"compare": "raw"}, react={"compliance_m_s_n": 0.002})
YIELDS = ("track", "react", "hold", "solved", "skipped", "Measuring the arm", "A contact of")

SCENES = (
    Scene("paper", PROFILES["paper"], cycles=150, pushes={(110, 120): (0.0, -50.0, 0.0)}, near=(0.15, 1.2),
          circle=True, meets=(*YIELDS, "99 of 100 samples")),
    Scene("paper-near", SHORT, near=(0.02, 0.5), pushes=PUSHES, fixtures=table, meets=(*YIELDS, "violated")),
    Scene("blind", BLIND, pushes=PUSHES, meets=YIELDS),
    Scene("blind-resume", BLIND, change={40: spoilt("q", 3, np.nan)}, resume=(60,), meets=("RobotState.q holds nan",)),
    Scene("restrictions-off", OFF, near=(0.05, 0.8), pushes=PUSHES, fixtures=table, meets=YIELDS),
    Scene("hard", HARD, near=(0.1, 0.9), pushes=PUSHES, seed=1, meets=(*YIELDS, "infeasible")),
    Scene("hard-near", HARD_AT_ONCE, near=(0.03, 0.4), speed=0.3, seed=2, cycles=80,
          meets=("infeasible", "limits cannot be met")),
    Scene("hard-32", HARD, 32, cycles=100, near=(0.18, 0.8), pushes=PUSHES, seed=3,
          meets=(*YIELDS, "infeasible", "allow no motion")),
    Scene("hard-128", HARD_AT_ONCE, 128, near=(0.25, 0.7), cycles=25, odd=0.0, seed=7),
    Scene("floor", FLOOR, cycles=80, near=(0.02, 0.6), circle=True),
    Scene("floor-32", changed(AT_ONCE, approach={"rows": "floor"}), 32, near=(0.02, 0.4), cycles=40, speed=0.5,
          seed=4, meets=("solved", "violated")),
    Scene("slack-32", SHORT, 32, near=(0.04, 0.3), cycles=80, pushes=PUSHES, fixtures=table, meets=(*YIELDS, "many")),
    Scene("slack-32-moving", AT_ONCE, 32, near=(0.02, 0.2), cycles=45, speed=0.5, swing=12.0, seed=5, meets=("many",)),
    Scene("slack-128", AT_ONCE, 128, near=(0.02, 0.3), cycles=25, speed=0.5, fixtures=table, seed=6,
          meets=("many", "at the box")),
    Scene("free", FREE, near=(0.05, 0.6), pushes=PUSHES, meets=YIELDS),
    Scene("free-32", FREE, 32, near=(0.03, 0.3), cycles=50, circle=True, meets=("many",)),
    Scene("raw", RAW, near=(0.1, 0.8), pushes=PUSHES, noise=2.0, meets=YIELDS),
    Scene("still-force", QUICK, noise=0.0, pushes={(40, 50): (0.0, 15.0, 3.0)}),
    Scene("unfiltered", changed(perception={"self_margin_m": None}), 32, near=(0.02, 0.6), cycles=60, fixtures=table,
          meets=("violated", "penetration")),
    Scene("dropout", SHORT, silent={(40, 62): (0,), (70, 145): (2, 3)}, cycles=160, near=(0.1, 0.6),
          pushes={(95, 99): (60.0, 0.0, 0.0)}, meets=(*YIELDS, "from hand_front, hand_back:")),
    Scene("statuses", AT_ONCE, 32, near=(0.3, 0.9), cycles=45, statuses=tuple(s.value for s in RangeStatus),
          meets=("from unit_5 (it reports a hardware failure), unit_8, unit_9, unit_12,"
                 " unit_13 (it repeats the same reading), unit_14, unit_20 (it reports",)),
    Scene("room", AT_ONCE, 32, near=(0.3, 1.6), cycles=35, fixtures=table),
    Scene("broken-units", QUICK, odd=0.7, change=dict.fromkeys((30, 31, 45, 60), broken_units), near=(0.1, 0.6)),
    Scene("no-wrench", QUICK, no_wrench=((35, 70),), near=(0.1, 0.6), meets=("no force estimate",),
          change={90: spoilt("wrench", 1, np.inf), 91: spoilt("wrench", 4, np.nan), 92: spoilt("wrench", 5, -2e5)}),
    Scene("faults", QUICK, near=(0.05, 0.5), speed=0.2, cycles=160, resume=(60, 90, 91, 120, 150),
          late={45: 0.07, 135: 0.3},
          change={50: spoilt("qd", 2, np.inf), 51: spoilt("q_commanded", 0, -1e3), 100: aged(0.2),
                  80: lambda inputs: replace(inputs, stamp=inputs.stamp - 0.5), 120: aged(-0.2), 142: aged(np.nan),
                  140: spoilt("qd_commanded", 6, np.nan), 141: lambda inputs: replace(inputs, stamp=np.nan)},
          meets=("(RobotState.qd holds inf", "RobotState.q_commanded", "backwards", "0.201 s old",
                 "in the future", "RobotState.stamp holds", "Inputs.stamp is", "ago")),
    Scene("limits", QUICK, posture=NEAR_LIMITS, near=(0.05, 0.5), cycles=80, meets=("at the box",)),
    Scene("limits-moving", AT_ONCE, posture=NEAR_LIMITS, near=(0.05, 0.5), cycles=40, speed=0.4, seed=8),
    Scene("limits-free", FREE, posture=NEAR_LIMITS, near=(0.1, 0.9), cycles=60, meets=("at the box",)),
    Scene("singular", SHORT, posture=SINGULAR, near=(0.1, 0.9), pushes=PUSHES, meets=(*YIELDS, "damped")),
    Scene("singular-place", changed(GENTLE, task={"orientation": "free"}), posture=SINGULAR_PLACE, error=0.0,
          near=(0.1, 0.9), pushes={(2, 9): (20.0, -15.0, 30.0)}, cycles=20, meets=("damped", "react")),
    Scene("millisecond", FAST, near=(0.03, 0.5), pushes=PUSHES, swing=40.0, meets=YIELDS),
    Scene("millisecond-32", changed(FAST, window={"samples": 2}), 32, near=(0.02, 0.3), cycles=45,
          speed=0.2, swing=40.0, meets=("many",)),
    Scene("millisecond-hard", changed(FAST, approach={"rows": "hard"}), 32, near=(0.15, 0.8), swing=40.0, cycles=70,
          meets=("track", "infeasible")),
)  # fmt: skip


def looking_inwards(model: RobotModel) -> tuple[Scene, Skin]:
    """A unit that looks into the forearm, and sees what is before, then on, then again before the axis."""
    body = model.body
    c = int(np.argmax(body.radius))
    axis = (body.b[c] - body.a[c]) / np.linalg.norm(body.b[c] - body.a[c])
    out = np.cross(axis, [1.0, 0.0, 0.0])
    out /= np.linalg.norm(out)
    T = np.eye(4)
    T[:3, :3] = np.column_stack([axis, np.cross(-out, axis), -out])
    height = body.radius[c] + 0.3
    T[:3, 3] = (body.a[c] + body.b[c]) / 2 + height * out

    def seen(distance: float) -> Callable[[Inputs], Inputs]:
        return lambda i: replace(i, readings=RangeReadings(np.array([i.stamp]), np.array([distance]), np.zeros(1, int)))

    profile = changed(QUICK, perception={"self_margin_m": None})
    change = {0: seen(height - 0.01), 1: seen(height), 2: seen(height), 3: seen(height + 0.01), 4: seen(height)}
    scene = Scene("inwards", profile, 1, error=0.0, cycles=5, change=change, meets=("penetration", "hold"))
    return scene, Skin([SensorUnit("inwards", model.links[body.link[c]], T)], model)


def singular(seed: int) -> Scene:
    """A push in a posture that is singular to the last digit; without units, so that no row stands in its way."""
    rng = np.random.default_rng(seed)
    first, fourth, sixth, last = rng.uniform((-2.5, -2.5, 0.5, -2.5), (2.5, -0.5, 3.0, 2.5))
    posture = (first, 0.0, rng.choice([-1, 1]) * np.pi / 2, fourth, 0.0, sixth, last)
    push = {(2, 9): tuple(20.0 * rng.normal(size=3))}
    profile = replace(GENTLE, perception=None, approach=None)
    return Scene(f"singular-{seed}", profile, posture=posture, error=0.0, pushes=push, cycles=6, seed=seed)
