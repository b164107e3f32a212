"""What others tell of the surroundings, points and fixtures that move, through controller, loop and recording."""

from dataclasses import replace

import numpy as np
import pytest

from pretouch.explanation import Limit, explain
from pretouch.perception.local_map import LocalMap
from pretouch.perception.scene_filter import no_fixtures
from pretouch.profiles import PROFILES
from pretouch.realtime import warm_up
from pretouch.recording.cycles import Cycles, inputs_of
from pretouch.sensing.skin import Skin
from pretouch.sound import MOST_POINTS, sound_points
from pretouch.types import SOMEWHERE, Inputs, Mode, MovingFixtures, SeenPoints
from tests.following_arm import PAPER, Arm, controller_of
from tests.fuzz.invariants import same
from tests.recording.runs import Run, assert_replays

PRETOUCH = PROFILES["pretouch"]
DEAF = replace(PRETOUCH, perception=replace(PRETOUCH.perception, outside=None))


def seen(now: float, *point, sigma: float = 0.005) -> SeenPoints:
    at = np.array(point, dtype=np.float64).reshape(-1, 3)
    return SeenPoints(now, np.full(len(at), now), at, np.full(len(at), sigma))


@pytest.mark.parametrize(("one", "other", "given"), [(PAPER, PAPER, True), (PRETOUCH, DEAF, False)])
def test_a_profile_that_takes_no_points_and_one_without_a_source_do_the_same_to_the_bit(
    panda_model, paper_skin, one, other, given
):
    plain, beside = Arm(panda_model, paper_skin, one), Arm(panda_model, paper_skin, other)
    for _ in range(150):
        points = seen(beside.time, beside.ee() + np.array([0.0, 0.2, 0.0])) if given else None
        assert same(plain.step(), beside.step(points=points))
    assert same(plain.state.memory.blocks, beside.state.memory.blocks)
    assert same(replace(plain.state, memory=beside.state.memory), beside.state)


@pytest.mark.parametrize("units", [7, 0])
def test_an_arm_slows_before_what_only_an_outside_source_sees(panda_model, paper_skin, units):
    skin = paper_skin if units else Skin([], panda_model)
    arm, free = Arm(panda_model, skin, PRETOUCH), Arm(panda_model, skin, PRETOUCH)
    grid = 0.04 * np.arange(-3, 4)
    board = arm.ee() + np.stack(np.meshgrid(grid, grid, 0.25), axis=-1).reshape(-1, 3)[:, [0, 2, 1]]
    fastest, least = 0.0, np.inf
    for _ in range(280):
        step, ahead = arm.step(points=seen(arm.time, *board)), free.step()
        fastest = max(fastest, ahead.ee_velocity[1])
        if len(step.obstacles.unit):
            assert step.obstacles.unit.min() >= units
            least = min(least, step.obstacles.body_distance.min())
    assert fastest > 0.25
    assert abs(step.ee_velocity[1]) < 0.02
    # less twice the points' standard deviation
    assert least == pytest.approx(PRETOUCH.approach.margin_m, abs=0.003)
    assert step.mode is Mode.TRACK


def test_a_source_once_given_that_falls_silent_stops_the_arm_and_lets_it_go_on(panda_model, paper_skin):
    arm = Arm(panda_model, paper_skin, PRETOUCH)
    for _ in range(150):
        arm.step(points=seen(arm.time))
    last = seen(arm.time)
    modes = [arm.step(points=last) for _ in range(60)]
    assert modes[15].mode is Mode.TRACK
    assert 0.0 < modes[30].speed_scale < 1.0
    assert modes[-1].mode is Mode.HOLD
    assert "outside source of points has been silent" in modes[-1].reason
    assert arm.step().mode is Mode.HOLD, "nor when there is no set at all"
    assert arm.step(points=seen(arm.time)).mode is Mode.TRACK


@pytest.mark.parametrize(
    ("points", "said"),
    [
        (5, "cannot be used (5 is no SeenPoints)"),
        (SeenPoints(1.0, np.zeros(1), np.zeros(3), np.zeros(1)), "SeenPoints.point has the shape (3,), not (1, 3)"),
        (SeenPoints("soon", np.zeros(1), np.zeros((1, 3)), np.zeros(1)), "SeenPoints.heard is 'soon', no number"),
        (seen(1.0, *np.zeros((MOST_POINTS + 1, 3))), f"gives 20001 points, more than {MOST_POINTS}"),
        (seen(1.0, *np.full((5, 3), 500.0), [np.nan] * 3, [0.0] * 3), "5 implausible points of 6: a coordinate"),
    ],
)
def test_points_that_cannot_be_used_are_named(panda_model, paper_skin, points, said):
    sound, wrong = sound_points(points)
    assert sound is None
    assert said in wrong
    arm = Arm(panda_model, paper_skin, PRETOUCH)
    for _ in range(150):
        arm.step(points=seen(arm.time))
    step = arm.step(points=points)
    assert step.mode is Mode.HOLD
    assert said in step.reason
    assert arm.step(points=seen(arm.time)).mode is Mode.TRACK


def test_a_run_with_points_of_any_shape_is_recomputed_bit_for_bit(panda_model, paper_skin, tmp_path):
    rng, sets = np.random.default_rng(4), [SeenPoints(0.0, np.zeros(2), np.zeros(5), np.zeros(2))]

    def with_points(k: int, inputs: Inputs) -> Inputs:
        """Points about the arm, a new set every 40 ms, and once such as cannot be."""
        if k > 100 and k % 4 == 0:
            sets.append(seen(inputs.stamp, *rng.uniform([-0.2, -0.6, 0.1], [0.9, 0.6, 1.0], (40, 3))))
        return replace(inputs, points=sets[-1] if k == 50 or k > 100 else None)

    recorded = assert_replays(Run(controller_of(panda_model, paper_skin, PRETOUCH), 2), tmp_path, with_points, 500)
    assert any((kept.step.obstacles.unit >= 7).any() for kept in recorded)


def test_points_are_written_once_and_with_each_snapshot(panda_model, paper_skin):
    run, points = Run(controller_of(panda_model, paper_skin, PRETOUCH)), seen(1.0, [0.1, 0.2, 0.3])
    cycles = Cycles(run.controller, {})
    kept = [cycles.keep(run.turn(lambda inputs: replace(inputs, points=points))) for _ in range(400)]
    whole = [i for i, each in enumerate(kept) if inputs_of(each.inputs).inputs.points is not None]
    assert whole == [i for i, each in enumerate(kept) if each.state is not None]
    assert len(whole) == 2
    assert [inputs_of(each.inputs).points_at for each in kept] == [whole[0]] * whole[1] + [whole[1]] * (400 - whole[1])


def test_with_another_number_of_obstacles_for_each_link_places_go_on_and_rows_begin_anew(panda_model, paper_skin):
    arm = Arm(panda_model, paper_skin, PRETOUCH)
    arm.step(points=seen(arm.time, arm.ee() + np.array([0.0, 0.3, 0.0])))
    memory = replace(PRETOUCH.perception.memory, per_link=1)
    other = controller_of(
        panda_model, paper_skin, replace(PRETOUCH, perception=replace(PRETOUCH.perception, memory=memory))
    )
    before, after = arm.state.memory, other.adopt(arm.state, arm.controller).memory
    assert before.get("places.number") == 1
    assert same(after.part("places", LocalMap), before.part("places", LocalMap))
    assert after.get("source_stamp") == before.get("source_stamp")
    assert (before.get("slots.link") >= 0).any()
    assert not (after.get("slots.link") >= 0).any()


def test_time_that_goes_backwards_forgets_what_a_source_showed(panda_model, paper_skin):
    arm = Arm(panda_model, paper_skin, PRETOUCH)
    assert (arm.step(points=seen(arm.time, arm.ee() + np.array([0.0, 0.3, 0.0]))).obstacles.unit >= 7).any()
    arm.time -= 0.5
    assert not (arm.step(points=seen(arm.time)).obstacles.unit >= 7).any()
    assert arm.state.memory.get("source_stamp") < arm.time


def test_warming_up_knows_of_points_and_leaves_the_arm_as_it_is(panda_model, paper_skin):
    arm = Arm(panda_model, paper_skin, PRETOUCH)
    arm.controller.fixtures = no_fixtures()
    robot, calls = arm.robot(), []
    step = arm.controller.step
    arm.controller.step = lambda state, inputs: calls.append(inputs.points) or step(state, inputs)
    warm_up(arm.controller, robot, points=True)
    assert {len(points.stamp) > 0 for points in calls} == {True, False}


# fixtures that move


def rod(x: float, y: float, stamp: float, speed: float = 0.0) -> MovingFixtures:
    """An upright rod of 5 cm radius that moves along y."""
    a, b = np.array([[x, y, 0.0]]), np.array([[x, y, 1.0]])
    v = np.array([[0.0, speed, 0.0]])
    return MovingFixtures(stamp, a, b, np.array([0.05]), v, v)


@pytest.mark.parametrize(
    "profile", [PRETOUCH, PAPER, replace(PRETOUCH, perception=None)], ids=["pretouch", "paper", "unseeing"]
)
def test_an_arm_keeps_off_a_rod_on_its_path_and_takes_it_for_no_person(panda_model, paper_skin, profile):
    arm = Arm(panda_model, paper_skin, profile)
    x, y, _ = arm.ee()
    least = np.inf
    for _ in range(400):
        step = arm.step(moving=rod(x, y + 0.35, arm.time))
        least = min(least, step.obstacles.body_distance.min())
        # no unit shows it, and no person's nearness slows the arm or bends the thresholds
        assert step.obstacles.unit.min() >= len(paper_skin)
        assert step.speed_scale == 1.0
    assert step.limited.by is Limit.APPROACH
    assert step.limited.unit >= len(paper_skin)
    assert "a fixture that moves is 0." in explain(step, paper_skin.ids, panda_model.links).sentence
    free = Arm(panda_model, paper_skin, profile)
    for _ in range(400):
        last = free.step()
    assert last.ee_position[1] > y + 0.3
    assert step.ee_position[1] < y + 0.25
    assert 0.0 < least < (0.2 if profile.name == "paper" else 0.03)


def test_a_braking_arm_gives_way_to_a_rod_that_comes(panda_model, paper_skin):
    still, coming = (Arm(panda_model, paper_skin, PRETOUCH) for _ in range(2))
    x, y, _ = still.ee()
    for i in range(130):
        still.step(moving=rod(x, y + 0.45, still.time))
        coming.step(moving=rod(x, y + 0.45 + 0.3 * (1.3 - 0.01 * i) - 0.39, coming.time, -0.3))
    assert coming.ee()[1] < y - 0.02 < y < still.ee()[1]


@pytest.mark.parametrize("profile", [PRETOUCH, PAPER], ids=lambda profile: profile.name)
def test_far_away_it_changes_no_command(panda_model, paper_skin, profile):
    plain, given = Arm(panda_model, paper_skin, profile), Arm(panda_model, paper_skin, profile)
    for _ in range(150):
        one, other = plain.step(), given.step(moving=rod(5.0, 5.0, given.time))
        assert one.command.tobytes() == other.command.tobytes()
        assert np.array(one.thresholds).tobytes() == np.array(other.thresholds).tobytes()


def test_silence_of_who_tells_holds_the_arm_until_it_is_told_for_the_first_time_and_again(panda_model, paper_skin):
    arm = Arm(panda_model, paper_skin, PRETOUCH)
    steps = [arm.step(moving=SOMEWHERE) for _ in range(9)]
    assert {step.mode for step in steps} == {Mode.HOLD}
    assert "have not been reported yet" in steps[-1].reason
    for _ in range(150):
        step = arm.step(moving=rod(5.0, 0.0, arm.time))
    assert step.mode is Mode.TRACK
    told = arm.time
    for _ in range(8):
        step = arm.step(moving=rod(5.0, 0.0, told))
    assert step.mode is Mode.HOLD
    assert step.reason == (
        "The moving fixtures were last reported 0.070 s ago: check their source; the arm continues when it reports"
        " again."
    )
    assert arm.step(moving=rod(5.0, 0.0, arm.time)).mode is Mode.TRACK


def test_a_recording_holds_them_to_the_bit_and_replays(panda_model, paper_skin, tmp_path):
    def beside(k: int, inputs: Inputs) -> Inputs:
        return replace(inputs, moving=rod(0.6, 0.3 + 0.001 * k, inputs.stamp, 0.1))

    assert_replays(Run(controller_of(panda_model, paper_skin)), tmp_path, beside, 60)
