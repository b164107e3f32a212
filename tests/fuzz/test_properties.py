"""Any numbers whatever in any input: an answer within the limits."""

from dataclasses import replace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from pretouch.control.approach import ApproachRestriction
from pretouch.control.path import Circle
from pretouch.params import RowKind
from pretouch.perception.scene_filter import no_fixtures
from pretouch.profiles import PROFILES, Profile
from pretouch.robot.description import panda
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import paper_skin
from pretouch.types import Inputs, RangeReadings, RangeStatus
from tests.examples import examples
from tests.fuzz.machine import Course, Machine
from tests.fuzz.weather import STATUS
from tests.fuzz.worlds import World

MODEL = RobotModel(panda())
SKIN = paper_skin(MODEL)
PAPER = PROFILES["paper"]
SHORT = replace(PAPER, window=replace(PAPER.window, samples=3), detect=replace(PAPER.detect, compare="raw"))
K, N = len(SKIN), MODEL.n


def restricted(rows: RowKind, **task: object) -> Profile:
    return replace(SHORT, approach=ApproachRestriction(rows=rows), task=replace(SHORT.task, **task))


profiles = st.sampled_from([
    *map(restricted, ("slack", "hard", "floor")), replace(SHORT, approach=None),
    restricted("hard", control_period_s=0.001), restricted("slack", orientation="free"),
    replace(SHORT, perception=replace(SHORT.perception, self_margin_m=None)),
])  # fmt: skip


def between(low: np.ndarray, high: np.ndarray) -> st.SearchStrategy[np.ndarray]:
    """Vectors whose parts are anywhere between, and often at the ends."""
    share = st.lists(st.one_of(st.sampled_from([0.0, 1.0]), st.floats(0.0, 1.0)), min_size=N, max_size=N)
    return share.map(lambda s: low + np.array(s) * (high - low))


postures = st.one_of(
    st.just(MODEL.description.q_ready),
    st.just(np.zeros(N)),  # stretched and beyond a limit
    between(MODEL.q_min + 0.01, MODEL.q_max - 0.01),
    between(MODEL.q_min - 0.5, MODEL.q_max + 0.5),
)
speeds = between(-1.5 * MODEL.description.qd_max, 1.5 * MODEL.description.qd_max)
some_floats = st.one_of(st.floats(-1.0, 5.0), st.floats())
readings = st.tuples(
    st.lists(st.one_of(st.just(0.0), st.floats(-1.0, 1.0), st.floats()), min_size=K, max_size=K),  # stamps, from now
    st.lists(some_floats, min_size=K, max_size=K),
    st.lists(st.one_of(st.just(0), st.sampled_from(STATUS), st.integers(-300, 300)), min_size=K, max_size=K),
)
wrenches = st.none() | st.lists(st.one_of(st.floats(-80, 80), st.floats()), min_size=6, max_size=6).map(np.array)


def calm(course: Course) -> Inputs:
    """No target in view, and nothing felt."""
    robot = replace(course.robot(), wrench=np.zeros(6))
    none = RangeReadings(np.full(K, course.time), np.zeros(K), np.full(K, int(RangeStatus.SIGNAL)))
    return Inputs(course.time, robot, none)


def begun(profile: Profile, q: np.ndarray, qd: np.ndarray) -> Course:
    """An arm that was in that state, after some calm steps: past the filling of its window, on the move if it may."""
    world = World(MODEL, profile, SKIN, no_fixtures(), Circle(), q, qd, lying=True, measured_off=0.0)
    a = Course(Machine(0), world)
    a.time, a.weather.feel = 100.0, "calm"
    a.begin(calm(a).robot)
    for _ in range(6):
        a.step(calm(a), deep=False)
    return a


stamps = st.one_of(st.just(0.0), st.floats(-0.2, 0.2), st.floats())
parts = st.sampled_from(["q", "qd", "q_commanded", "qd_commanded", "tau_ext"])
spoilt = st.tuples(parts, st.integers(0, N - 1), st.floats())
moments = st.tuples(
    st.none() | readings, st.just(np.zeros(6)) | wrenches, st.none() | st.tuples(stamps, stamps), st.none() | spoilt,
    st.booleans(),
)  # fmt: skip


@given(profiles, postures, speeds, st.lists(moments, min_size=1, max_size=8))
@examples(150, least=75)
def test_any_posture_and_any_numbers(profile, q, qd, sequence):
    arm = begun(profile, q, qd)
    for seen, wrench, late, spoils, resume in sequence:
        inputs = calm(arm)
        robot, now = replace(inputs.robot, wrench=wrench), arm.time
        if late is not None:
            now += late[0]
            robot = replace(robot, stamp=now + late[1])
        if spoils is not None:
            part, joint, value = spoils
            wrong = getattr(robot, part).copy()
            wrong[joint] = value
            robot = replace(robot, **{part: wrong})
        units = inputs.readings
        if seen is not None:
            stamp, distance, status = map(np.array, seen)
            units = RangeReadings(now + stamp, distance, status)
        arm.step(Inputs(now, robot, units, resume), deep=True)
