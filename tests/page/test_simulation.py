"""A live session: time, the hand, the object, a reset."""

import gc
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from tests.page.sessions import ARMED_S, modes, poke, set_speed

from pretouch.control.path import Circle
from pretouch.controller import Controller
from pretouch.errors import ParameterError
from pretouch.loop import run
from pretouch.page.room import HAND_FORCE_N, HAND_SPEED_M_S, LiveSettings, Mouse
from pretouch.page.simulation import LiveSimulation
from pretouch.profiles import at_rate, profile
from pretouch.robot.postures import brought_to
from pretouch.sim.hand import Hand, PersonArm
from pretouch.sim.plant import Plant, PlantClock
from pretouch.sim.plant_params import PlantParams
from pretouch.sim.range_finder import RangeFinderParams, RangeFinders
from pretouch.sim.scene import HandSpec, SceneSpec, fixtures
from pretouch.types import ControlStep, Mode

OBJECTS = ("none", "board -y", "board +y")
PATHS = ("circle", "line")


def test_a_session_runs_as_an_experiment_does(live, panda_model, paper_skin):
    session = live(seed=7)
    steps = [session.frame.step, *session.advance(2.0)]

    path, hand = Circle(), HandSpec()
    scene = SceneSpec(hand=hand)
    plant = Plant(panda_model, scene, PlantParams(), brought_to(panda_model, path.point(0.0)), 7)
    units = RangeFinders(plant, paper_skin, RangeFinderParams(), 7)
    Hand(plant, Mouse(np.array(hand.start), scene, hand), PersonArm(HAND_SPEED_M_S))
    plant.advance(0.2)
    recorded: list[ControlStep] = []

    recorder = SimpleNamespace(record=lambda cycle: recorded.append(cycle.step))
    controller = Controller(panda_model, paper_skin, fixtures(scene), path, session.settings.profile)
    run(controller, plant, units, PlantClock(plant, 0.01), recorder, lambda step: len(recorded) == len(steps))
    for ours, theirs in zip(steps, recorded, strict=True):
        assert ours.stamp == theirs.stamp
        np.testing.assert_array_equal(ours.command, theirs.command)
        np.testing.assert_array_equal(ours.range_distance, theirs.range_distance)


def test_time_passes_in_whole_cycles_and_the_rest_is_kept(live):
    session = live()
    assert session.time == pytest.approx(0.21)
    assert [len(session.advance(0.004)) for _ in range(10)] == [0, 0, 1, 0, 1, 0, 0, 1, 0, 1]
    assert session.time == pytest.approx(0.25)
    session.single_step()
    assert session.time == session.frame.step.stamp == pytest.approx(0.26)
    assert session.advance(0.0) == []
    stamps = [step.stamp for step in session.advance(0.1)]
    assert np.diff(stamps) == pytest.approx(np.full(9, 0.01))


def commanded(session: LiveSimulation, pieces: list[float]) -> np.ndarray:
    """Commands of a session in which a person interferes before cycles 50, 120 and 200, in pieces of time [s]."""
    steps = [session.frame.step]
    for until, act in (
        (0.5, lambda: session.move_hand(np.array([0.6, 0.1, 0.3]))),
        (1.2, lambda: session.set_path("line")),
        (2.0, lambda: session.silence(frozenset({session.skin.ids[2]}))),
        (2.5, lambda: session.resume()),
    ):
        while len(steps) - 1 < round(until / 0.01):
            left = until - 0.01 * (len(steps) - 1)
            steps += session.advance(min(pieces[len(steps) % len(pieces)], left))
        act()
    return np.array([step.command for step in steps])


def test_the_same_commands_before_the_same_cycles_give_the_same_run(live):
    first = commanded(live(seed=3), [0.1])
    np.testing.assert_array_equal(first, commanded(live(seed=3), [0.03, 0.01, 0.07]))
    assert not np.array_equal(first, commanded(live(seed=4), [0.1]))


HAND_M_S = HAND_SPEED_M_S * 7 / 6
"""The hand's spring overshoots by a sixth (tests/sim/test_hand.py)."""
ARM_M_S = 0.3
"""No point of the arm comes at the hand faster, tracking or reacting."""
IMPACT_N = (HAND_M_S + ARM_M_S) * np.sqrt(2 * HandSpec.stiffness * HandSpec.mass) + HAND_FORCE_N
"""A mass on two springs at once, with the person behind it."""


@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.slow)])
def test_a_target_inside_the_arm_neither_jumps_nor_crushes(live, seed):
    session, rng = live(seed=seed), np.random.default_rng(seed)
    plant, hand = session.room.plant, session.room.hand
    seen = []
    plant.before_each_step(lambda time: seen.append((*hand.position, *plant.true_force)))
    session.advance(ARMED_S)
    body = session.model.body
    for _ in range(40):
        kin, c = session.model.kinematics(session.frame.step.q), rng.integers(len(body.radius))
        middle = (body.a[c] + body.b[c]) / 2
        session.move_hand(kin.position[body.link[c]] + kin.rotation[body.link[c]] @ middle)
        session.advance(0.5)
    positions, forces = np.split(np.array(seen), 2, axis=1)
    assert np.all(np.isfinite(positions))
    assert np.all(np.isfinite(forces))
    assert np.linalg.norm(np.diff(positions, axis=0), axis=1).max() < (HAND_M_S + 2 * ARM_M_S) * 0.001
    assert HAND_FORCE_N < np.linalg.norm(forces, axis=1).max() < IMPACT_N


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("thing", OBJECTS)
def test_nothing_touches_at_the_start_and_the_hand_begins_where_it_is_to(live, thing, path):
    session = live(object=thing, path=path)
    assert not session.room.plant.touching
    np.testing.assert_allclose(session.frame.hand, LiveSettings().hand_start, atol=1e-3)
    np.testing.assert_allclose(session.frame.hand, session.frame.hand_target, atol=1e-6)


@pytest.mark.parametrize(("thing", "sign"), [("board -y", -1.0), ("board +y", 1.0)])
@pytest.mark.parametrize("path", PATHS)
def test_a_blind_arm_runs_into_the_board(live, thing, sign, path):
    session = live(object=thing, path=path, profile=profile("blind"))
    (board,) = session.world.boxes
    assert sign * board.center[1] == pytest.approx(0.27)
    assert sign * session.frame.step.ee_position[1] < -0.2, "it begins on the side of the board"
    within = (session.single_step() for _ in range(700))
    touch = next(step for step in within if step.mode is Mode.REACT)
    assert sign * touch.contact.force[1] < -5.0


def test_a_line_is_run_there_and_back_without_false_contacts(live):
    steps = (session := live(path="line")).advance(15.0)
    y = np.array([s.ee_position[1] for s in steps])
    assert y.min() == pytest.approx(-0.5, abs=0.03)
    assert y[np.argmin(y) :].max() == pytest.approx(0.5, abs=0.03)
    assert modes(steps) == [Mode.HOLD, Mode.TRACK]
    assert session.world.path.closed


def test_a_reset_begins_again_with_all_as_it_is_set(live):
    session = live(seed=2)
    fresh = session.advance(0.5)
    session.set_path("line")
    set_speed(session, 0.1)
    session.move_hand(np.array([0.8, 0.2, 0.4]))
    session.advance(1.0)
    world = session.world
    session.reset()
    assert session.time == pytest.approx(0.21)
    assert session.frame.hand == pytest.approx(LiveSettings().hand_start)
    assert session.world is not world
    assert (session.settings.path, session.settings.profile.task.speed_m_s) == ("line", 0.1)
    session.reset(path="circle", profile=LiveSettings().profile)
    again = session.advance(0.5)
    assert all(np.array_equal(a.command, b.command) for a, b in zip(fresh, again, strict=True))


def test_a_reset_that_cannot_be_leaves_the_session_as_it_is(live):
    session = live()
    session.advance(0.5)
    with pytest.raises(ParameterError, match=r"LiveSettings.object is 'piano': choose one of none, board -y, board"):
        session.reset(object="piano")
    with pytest.raises(ParameterError, match=r"The control period is 0.0015 s: give a multiple of the physics step"):
        session.reset(profile=profile("paper:task.control_period_s=0.0015"))
    assert session.settings == LiveSettings()
    assert session.time == pytest.approx(0.71)
    assert session.advance(0.02)


def test_a_reset_may_change_the_control_period(live):
    session = live()
    session.reset(profile=at_rate(profile("paper"), 500.0))
    steps = session.advance(1.5)
    assert len(steps) == 750
    assert steps[-1].mode is Mode.TRACK


def allocated_blocks() -> int:
    gc.collect()
    return sys.getallocatedblocks()


def test_a_long_session_does_not_fill_the_memory(live):
    """Blocks of memory that are held are counted: tracemalloc keeps traces of arguments that compiled code let go."""
    session = live()
    poke(session)
    session.advance(4.5)  # until what is kept for reuse is there
    early = allocated_blocks()
    cycles = len(session.advance(12.0))
    assert allocated_blocks() - early < cycles / 2  # a log keeps at least one of each cycle


def test_a_frame_shows_where_hand_and_target_are_and_where_the_arm_is_touched(live):
    session = live(profile=profile("blind"))
    assert session.frame.hand == pytest.approx(LiveSettings().hand_start)
    session.move_hand(np.array([0.9, 9.0, 0.5]))
    session.advance(ARMED_S)
    assert session.frame.hand_target == pytest.approx([0.9, 1.2, 0.5])
    assert session.frame.hand[1] > 0.6
    assert session.frame.true_force == pytest.approx(np.zeros(3))
    assert session.frame.true_point is None
    poke(session)
    assert np.linalg.norm(session.frame.true_force) > 1.0
    assert np.linalg.norm(session.frame.true_point - session.frame.hand) == pytest.approx(HandSpec().radius, abs=0.01)
