"""Inputs by script: for each a profile, what the arm and its units say, and what the controller is to come to."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from pretouch.control.path import segment
from pretouch.controller import Controller
from pretouch.perception.scene_filter import Fixtures, no_fixtures
from pretouch.profiles import profile
from pretouch.robot.description import panda
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin, paper_skin
from pretouch.sensing.unit import TouchPatch
from pretouch.types import Inputs, RangeReadings, RangeStatus
from tests.golden.fields import Values, values_of
from tests.golden.script import Script

PROFILES = ("paper", "blind", "slowing-only", "thresholds-only", "paper-0.5m", "pretouch")
HAND, FOREARM, ELBOW = "panda_hand", "panda_link5", "panda_link4"
START = (0.306890567, 0.0, 0.486882052)
"""Where the end-effector is in the posture READY [m]."""
ASIDE = START, (START[0], 0.4, START[2])
FOLDING = (0.0, -1.2, 0.0, -2.85, 0.0, 1.75, 0.785)
"""Forearm and upper arm come together from here."""
CROOK_NM = (0.0, 0.0, 0.12, 9.1, 0.16, 0.0, 0.0)
"""Torques of 60 N that push upper arm and forearm apart [Nm]."""


@dataclass(frozen=True)
class Stream:
    """One input by script."""

    profile: str
    script: Callable[[], Script]
    reaches: tuple[str, ...] = ()
    """Values of mode and outcome, marks of `_marks`, and words of a reason that some step has to have."""
    path: tuple[tuple[float, float, float], ...] = ASIDE
    floor: float | None = None
    """Height of a floor that is known [m]."""
    touching: bool = False
    """Whether the units have touch sensors."""


@cache
def model() -> RobotModel:
    """The arm of all inputs."""
    return RobotModel(panda())


@cache
def skin(touching: bool = False) -> Skin:
    """The paper's seven units."""
    units = paper_skin(model()).units
    return Skin([replace(unit, touch=TouchPatch()) for unit in units] if touching else units, model())


def controller(stream: Stream) -> Controller:
    """Return the controller that is given a stream."""
    fixtures = no_fixtures()
    if stream.floor is not None:
        fixtures = Fixtures(np.array([[0.0, 0.0, 1.0, stream.floor]]), fixtures.capsules)
    return Controller(model(), skin(stream.touching), fixtures, segment(*stream.path), profile(stream.profile))


def run(stream: Stream) -> dict[int, Values]:
    """Give the inputs of a stream to a controller; an error if it does not come to what it is to reach."""
    found, script = controller(stream), stream.script()
    state = found.init(script.state(0))
    steps = {}
    for i in range(len(script.time)):
        step, state = found.step(state, script.inputs(i))
        steps[i] = values_of(step)
    missing = not_reached(stream, steps)
    if missing:
        raise AssertionError(f"{stream.profile} by {stream.script.__name__} does not reach {', '.join(missing)}.")
    return steps


def not_reached(stream: Stream, steps: dict[int, Values]) -> list[str]:
    """What a stream is to reach and does not."""
    marks = set().union(*map(_marks, steps.values()))
    reasons = {str(values["reason"]) for values in steps.values()}
    return [word for word in stream.reaches if word not in marks and not any(word in reason for reason in reasons)]


def _marks(values: Values) -> set[str]:
    """What is so in one step."""
    marks = {
        "contact": values["contact.force"] is not None,
        "restricted": values["restricted"].size > 0,
        "slack": values["qp.slack"].max(initial=0.0) > 1e-6,
        "slowed": values["speed_scale"] < 1.0,
        "evidence": 0.0 < values["detector.evidence"] < 1.0,
        "localised": values["localisation.link"].size > 0,
        "raised thresholds": values["thresholds.obstacle_positive"].any(),
        "reaction": values["reaction_velocity"].any(),
    }
    return {str(values["mode"]), str(values["qp.outcome"])} | {name for name, so in marks.items() if so}


def course() -> Script:
    """Something comes near from both sides, then a push at the hand, and one that grows, beside something near."""
    s = Script(520)
    s.move(100, 460, {0: 0.6, 3: 0.3})
    s.see(0, 120, 215, 0.7, 0.06)
    s.see(1, 150, 300, 0.5, 0.25)
    s.see(4, 110, 180, 0.4, 0.3)
    s.push(model(), 230, 255, HAND, (5.0, -40.0, 0.0))
    s.see(0, 440, 520, 0.3, 0.2)
    for i in range(450, 510):
        s.push(model(), i, i + 1, HAND, (0.0, -0.7 * (i - 450), 0.1 * (i - 450)))
    return s


def release() -> Script:
    """A push that lasts and is let go, twice."""
    s = Script(620)
    s.push(model(), 130, 190, HAND, (0.0, -25.0, 5.0))
    s.move(130, 190, {0: -0.2})
    s.push(model(), 430, 445, FOREARM, (0.0, 35.0, 0.0))
    return s


def clamp() -> Script:
    """A push that goes over into one from the other side."""
    s = Script(330)
    s.move(130, 180, {0: -0.25})
    s.push(model(), 130, 180, HAND, (0.0, -25.0, 0.0))
    s.push(model(), 180, 186, HAND, (0.0, 25.0, 0.0))
    s.move(190, 230, {0: 0.1})
    s.resume(310)
    return s


def pinch() -> Script:
    """Upper arm and forearm come together, and something between them pushes them apart."""
    s = Script(260, start=FOLDING)
    s.move(100, 200, {3: -0.2})
    s.torque[150:175] += CROOK_NM
    return s


def press() -> Script:
    """The hand comes down on something that lies on a floor."""
    s = Script(260)
    s.move(100, 220, {1: 0.12, 3: -0.12})
    s.push(model(), 160, 185, HAND, (0.0, 0.0, 60.0))
    return s


def blocked() -> Script:
    """A fast arm with things so near on all sides that no way is left within the acceleration limits."""
    s = Script(260)
    s.move(100, 190, {0: 0.9, 1: 0.3, 3: 0.4})
    for unit in range(7):
        s.see(unit, 130, 200, 0.3, 0.02)
        s.see(unit, 200, 240, 0.12, 0.5)
    return s


def silent() -> Script:
    """A unit is silent for a while, one has a clock that is ahead, one fails, and one repeats itself."""
    s = Script(420)
    s.move(100, 400, {0: 0.4})
    s.see(0, 110, 400, 0.6, 0.3)
    s.stamp[140:200, 2] = s.time[140]
    s.stamp[230:250, 3] += 1.0
    s.status[270:320, 4] = int(RangeStatus.HARDWARE)
    s.status[350:400, 5] = int(RangeStatus.STUCK)
    s.stamp[330:340] = -np.inf
    return s


def faulty() -> Script:
    """The arm's interface and the clock fail in many ways, and a person resumes."""
    s = Script(460)
    s.move(100, 440, {0: 0.5, 5: -0.3})
    s.see(0, 130, 440, 0.7, 0.2)
    nan = np.full(7, np.nan)
    s.change(140, 142, lambda given: replace(given, robot=replace(given.robot, q=nan)))
    s.change(160, 161, lambda given: replace(given, robot=replace(given.robot, qd_commanded=nan)))
    s.change(180, 190, lambda given: replace(given, robot=replace(given.robot, stamp=1.75)))
    s.change(200, 201, lambda given: replace(given, stamp=given.stamp - 1.0))
    s.change(230, 265, lambda given: replace(given, robot=replace(given.robot, wrench=None, tau_ext=nan)))
    s.change(285, 286, lambda given: replace(given, robot=replace(given.robot, wrench=np.full(6, np.inf))))
    s.change(300, 303, lambda given: replace(given, readings=_few(given)))
    s.change(320, 325, lambda given: replace(given, robot=replace(given.robot, stamp=given.stamp + 2.0)))
    s.time[350:] += 0.08
    s.stamp[350:] += 0.08
    s.resume(146, 166, 196, 206, 210, 290, 330, 335)
    return s


def _few(given: Inputs) -> RangeReadings:
    """Readings of a smaller skin."""
    return RangeReadings(given.readings.stamp[:3], given.readings.distance[:3], given.readings.status[:3])


def touched() -> Script:
    """Units are touched where the arm is pushed, where it is not, and for so long that they are not believed."""
    s = Script(420)
    s.touches = True
    s.push(model(), 130, 160, HAND, (0.0, -9.0, 0.0))
    s.contact[130:160, 4] = s.contact[300:420, 1] = True
    s.touch_force[150:155, 4] = np.nan
    s.push(model(), 330, 350, HAND, (0.0, 14.0, 0.0))
    return s


def outside() -> Script:
    """A source of points shows what comes near, nothing, and then is silent."""
    s = Script(400)
    s.move(100, 300, {0: 0.4})
    s.see(0, 120, 300, 0.7, 0.4)
    cloud = 0.03 * s.rng.uniform(-1, 1, (60, 3))
    for i in range(300):
        s.points[i] = cloud + np.array([START[0], 0.6 - 0.0018 * i, START[2]])
        if i >= 250:
            s.points[i] = np.zeros((0, 3))
    return s


def fuzz(seed: int) -> Callable[[], Script]:
    """Anything, for twenty cycles each."""

    def drawn() -> Script:
        s = Script(600, seed=seed)
        s.move(0, 600, dict(enumerate(s.rng.uniform(-0.3, 0.3, 7))))
        kinds = np.array([*map(int, RangeStatus), 42])
        for i in range(120, 600, 20):
            now = slice(i, i + 20)
            for unit in np.flatnonzero(s.rng.uniform(size=7) < 0.6):
                s.see(unit, i, i + 20, *s.rng.uniform(-0.1, 1.3, 2))
            if s.rng.uniform() < 0.3:
                s.status[now] = s.rng.choice(kinds, 7)
            if s.rng.uniform() < 0.3:
                s.push(model(), i, i + 12, (HAND, FOREARM, ELBOW)[s.rng.integers(3)], 40.0 * s.rng.uniform(-1, 1, 3))
            if s.rng.uniform() < 0.2:
                s.stamp[now] -= s.rng.uniform(0.0, 0.5)
            if s.rng.uniform() < 0.2:
                s.torque[i + 3, s.rng.integers(7)] = s.rng.choice([np.nan, np.inf, 1e5, -80.0])
            if s.rng.uniform() < 0.2:
                s.resume(i + 10)
        return s

    drawn.__name__ = f"fuzz {seed}"
    return drawn


_SENSES = ("track", "hold", "react", "contact", "reaction", "restricted", "slowed")
_OURS = ("track", "react", "contact", "evidence", "localised", "reaction")
_REACHED = {
    "paper": (*_SENSES, "raised thresholds", "slack"),
    "blind": ("track", "hold", "react", "contact", "reaction"),
    "pretouch": (*_OURS, "restricted"),
}  # fmt: skip

STREAMS = {
    **{f"course/{name}": Stream(name, course, _REACHED.get(name, ())) for name in PROFILES},
    "release/paper": Stream("paper", release, ("react", "track")),
    "release/pretouch": Stream("pretouch", release, ("react", "track")),
    "clamp": Stream("pretouch", clamp, ("Clamped between two objects", "free it, then resume")),
    "pinch": Stream(
        "pretouch", pinch, ("link2 and panda_link5",), path=((0.21, 0.0, 0.38), (0.09, 0.0, 0.1)),
    ),
    "press": Stream(
        "pretouch", press, ("and a fixture",), path=(START, (START[0], 0.0, 0.1)), floor=0.3,
    ),
    "blocked/hard": Stream("paper:approach.rows=hard", blocked, ("infeasible", "restricted")),
    "blocked/floor": Stream("paper:approach.rows=floor", blocked, ("restricted", "slack")),
    "blocked/pretouch": Stream("pretouch", blocked, ("restricted",)),
    "silent/paper": Stream("paper", silent, ("No usable reading", "slowed")),
    "silent/pretouch": Stream("pretouch", silent, ("No usable reading", "slowed")),
    "faults/paper": Stream("paper", faulty, (
        "cannot be used", "Time went backwards", "The robot's state is", "no force estimate", "do not fit",
        "The last step was",
    )),
    "faults/pretouch": Stream("pretouch", faulty, ("cannot be used", "Time went backwards", "do not fit")),
    "touch": Stream("pretouch", touched, ("contact", "localised"), touching=True),
    "outside-points": Stream("pretouch", outside, ("restricted", "outside source")),
    **{f"fuzz/{name}": Stream(name, fuzz(7 + i), ("track", "react")) for i, name in enumerate(("paper", "pretouch"))},
}  # fmt: skip
"""Name -> input. Names stay, and have no spaces."""
