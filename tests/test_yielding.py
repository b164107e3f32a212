"""Yielding, clamps and giving up through the whole controller, closed over an arm that follows its commands exactly."""

from dataclasses import replace

import numpy as np
import pytest

from pretouch.params import GiveUpParams
from pretouch.profiles import PROFILES, Profile, profile
from pretouch.recording.cycles import KeptState, packed_state
from pretouch.recording.packing import unpacked
from pretouch.robot.body import placed
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.types import ControlStep, Mode
from tests.following_arm import DT, Arm
from tests.fuzz.invariants import same
from tests.golden.script import Script
from tests.golden.streams import CROOK_NM, FOLDING, HAND, Stream, controller, model

RIGHT = 1  # unit of the paper's skin that looks along -y in the ready posture
OURS = PROFILES["pretouch"]
NO_LAG = replace(OURS, react=replace(OURS.react, lag_s=0.0))


class Pushed(Arm):
    """An arm whose joints feel forces on its body, with no noise and no lag."""

    def feel(self, torque: np.ndarray, **more: object) -> ControlStep:
        return self.step(change=lambda robot: replace(robot, tau_ext=torque), **more)

    def push(self, force: tuple[float, float, float], link: str = "", cycles: int = 1, **more: object):
        k = self.model.link_index(link) if link else self.model.ee
        steps = []
        for _ in range(cycles):
            kin = self.model.kinematics(self.q)
            torque = self.model.jacobian(kin, k, kin.position[k])[:3].T @ np.array(force)
            steps.append(self.feel(torque, force=force, **more))
        return steps

    def meet(self, face: float, cycles: int) -> list[ControlStep]:
        """Move where something at rest, of 5 N/mm, keeps the hand from going beyond y = face [m]."""
        return [step for _ in range(cycles) for step in self.push((0.0, min(0.0, 5e3 * (face - self.ee()[1])), 0.0))]

    def wait(self, most: int = 1000) -> None:
        """Until it goes on with its task."""
        for _ in range(most):
            if self.state.mode.mode is Mode.TRACK:
                return
            self.step()
        pytest.fail(f"It does not go on: {self.state.mode.reason}")

    def point(self, link: str) -> np.ndarray:
        return self.model.kinematics(self.q).position[self.model.link_index(link)]


def arm_of(model: RobotModel, skin: Skin, params: Profile = NO_LAG) -> Pushed:
    """An arm on its way along its path, which leads to +y."""
    arm = Pushed(model, skin, params)
    arm.run(150)
    assert arm.state.mode.mode is Mode.TRACK
    return arm


@pytest.fixture
def arm(panda_model: RobotModel, paper_skin: Skin) -> Pushed:
    return arm_of(panda_model, paper_skin)


def caught(arm: Pushed) -> list[ControlStep]:
    """Push the arm to -y, and hold it up there."""
    arm.push((0.0, -25.0, 0.0), cycles=50)
    return arm.push((0.0, 25.0, 0.0), cycles=4)


def modes(steps: list[ControlStep]) -> set[Mode]:
    return {s.mode for s in steps}


def test_it_yields_as_long_as_it_is_pushed_stands_and_goes_on_gently(arm: Pushed):
    steps = arm.push((0.0, -20.0, 0.0), cycles=30)
    speeds = [float(s.reaction_velocity[1]) for s in steps[1:]]
    assert modes(steps[1:]) == {Mode.REACT}
    assert max(speeds) < 0
    first = arm.ee()[1]
    arm.push((0.0, -20.0, 0.0), cycles=100)
    assert arm.ee()[1] < first - 0.1, "it is pushed on, for longer than a reaction of a fixed length"
    left = arm.push((0.0, 0.0, 0.0), cycles=99)
    sizes = np.linalg.norm([s.command for s in left], axis=1)
    assert np.all(np.diff(sizes) <= 1e-9), "let go, it only slows"
    assert sizes[-1] < 1e-3
    where = arm.ee()
    after = arm.run(60)
    assert modes(after[:10]) == {Mode.REACT}
    begins = next(s for s in after if s.mode is Mode.TRACK)
    np.testing.assert_allclose(begins.ee_position, where, atol=2e-3)
    assert np.linalg.norm(begins.desired_velocity) <= 1.0 * DT + 1e-9, "the speed along the path grows from 0"


def test_a_hand_that_keeps_pushing_keeps_it_away(arm: Pushed):
    arm.push((0.0, -20.0, 0.0), cycles=100)
    aside = arm.ee()[1]
    steps = arm.push((0.0, -8.0, 0.0), cycles=500)
    assert modes(steps) == {Mode.REACT}
    assert arm.ee()[1] <= aside


@pytest.mark.parametrize("force", [(0.0, -20.0, 0.0), (-20.0, 0.0, 0.0), (0.0, 0.0, 30.0)])
def test_a_push_that_is_held_moves_it_no_farther_than_its_reach_and_back_it_still_yields(arm: Pushed, force):
    start, reach = np.array(placed(arm.model.body, arm.model.kinematics(arm.q))[1:3]), OURS.react.reach_m
    steps = arm.push(force, cycles=800)
    assert modes(steps[20:]) == {Mode.REACT}
    there = np.array(placed(arm.model.body, arm.model.kinematics(arm.q))[1:3])
    assert 0.97 * reach < np.linalg.norm(there - start, axis=-1).max() < 1.03 * reach
    assert np.linalg.norm(steps[-1].command) < 0.02, "it stands there"
    assert "moves no farther" in steps[-1].reason
    begun = [step for step in steps if step.reaction_velocity.any()]
    assert all(step.reaction_velocity @ np.array(force) > 0 for step in begun[10:]), "never towards who pushes"
    hand = arm.ee()
    arm.push(tuple(-2 * f for f in force), cycles=60)
    assert (arm.ee() - hand) @ np.array(force) / np.linalg.norm(force) < -0.02


def test_another_contact_may_move_it_as_far_again(arm: Pushed):
    arm.push((0.0, -20.0, 0.0), cycles=500)
    arm.wait()
    first = arm.ee()[1]
    arm.push((0.0, -20.0, 0.0), cycles=500)
    assert arm.ee()[1] < first - 0.2


@pytest.mark.parametrize("link", ["panda_link4", "panda_link6", "panda_hand"])
@pytest.mark.parametrize("force", [(0.0, -30.0, 0.0), (0.0, 30.0, 0.0), (0.0, 0.0, 30.0)])
def test_the_link_that_is_pushed_goes_with_the_push(arm: Pushed, link: str, force):
    arm.push(force, link, cycles=20)
    before = arm.point(link)
    arm.push(force, link, cycles=20)
    assert (arm.point(link) - before) @ np.array(force) > 0


def test_caught_between_two_things_it_opens_the_way_it_came_and_holds_until_resumed(arm: Pushed):
    assert "Clamped between two objects" in caught(arm)[-1].reason
    start = arm.ee()[1]
    opening = arm.run(40)
    assert modes(opening) == {Mode.REACT}
    assert 0.02 < arm.ee()[1] - start < 0.06, "back, at no more than 0.1 m/s"
    held = arm.run(60)
    assert held[-1].mode is Mode.HOLD
    assert "clamped between two objects" in held[-1].reason
    assert "resume" in held[-1].reason
    assert arm.step(resume=True).mode is Mode.TRACK


def test_a_hand_moves_an_arm_that_holds_after_a_clamp_and_none_whose_state_is_not_known(arm: Pushed):
    caught(arm)
    arm.run(100)
    before = arm.ee()[1]
    steps = arm.push((0.0, 15.0, 0.0), cycles=50)
    assert modes(steps) == {Mode.HOLD}
    assert arm.ee()[1] > before + 0.01
    arm.run(60)
    before = arm.ee()[1]
    arm.push((0.0, -15.0, 0.0), cycles=50)
    assert arm.ee()[1] > before - 0.005, "back to where it was caught it cannot be pushed"
    arm.run(60)
    arm.step(change=lambda robot: replace(robot, q=np.full(7, np.nan)))
    assert "cannot be used" in arm.state.mode.reason
    arm.run(50)
    steps = arm.push((0.0, -15.0, 0.0), cycles=50)
    assert not any(s.command.any() for s in steps)


def test_a_person_who_pushes_thrice_at_one_place_does_not_make_it_give_up(arm: Pushed):
    for _ in range(4):
        arm.wait()
        arm.run(5)
        arm.push((0.0, -20.0, 0.0), cycles=30)
    assert Mode.TRACK in modes(arm.run(150))


@pytest.mark.parametrize("side", [(0.0, -1.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 0.0, -1.0)])
def test_light_touches_of_an_arm_that_stands_are_no_obstacle(arm: Pushed, side):
    arm.run(300)
    before = arm.ee()
    arm.run(10)
    np.testing.assert_allclose(arm.ee(), before, atol=1e-4, err_msg="it is at the end of its path")
    touches = 0
    for force, pause in zip((16, 14, 18, 15, 17, 16), (20, 30, 25, 60, 15, 40), strict=True):
        touches += any(s.contact is not None for s in arm.push(tuple(force * f for f in side), cycles=12))
        arm.wait()
        arm.run(pause)
    assert touches >= 4
    assert arm.state.mode.mode is Mode.TRACK


@pytest.mark.parametrize("pauses", [(15, 45, 80, 20, 60, 100), (60, 20, 90, 30, 75, 15)])
def test_light_touches_of_an_arm_that_passes_are_no_obstacle(panda_model, paper_skin, pauses):
    slow = replace(NO_LAG, task=replace(NO_LAG.task, speed_m_s=0.1))
    arm = arm_of(panda_model, paper_skin, slow)
    arm.run(500)  # touched in its first seconds, the detector doubts what it feels, and the arm yields less far
    for pause in pauses:
        arm.push((0.0, -15.0, 0.0), cycles=12)
        arm.wait()
        arm.run(pause)
    assert arm.state.mode.mode is Mode.TRACK


def test_after_three_contacts_at_one_place_it_gives_up_says_so_and_tries_again(panda_model, paper_skin):
    quick = replace(NO_LAG.react, quiet_s=0.3, give_up=GiveUpParams(push_j=100.0, retry_s=1.0))
    arm = arm_of(panda_model, paper_skin, replace(NO_LAG, react=quick))
    face = arm.ee()[1] + 0.05
    steps = arm.meet(face, 250)
    assert steps[-1].mode is Mode.HOLD
    assert "3 contacts at one place" in steps[-1].reason
    assert not arm.state.mode.latched
    again = arm.meet(face, 240)
    assert Mode.TRACK in modes(again), "no unit saw anything: it tries again after a while"
    while arm.state.mode.mode is not Mode.HOLD:  # the last attempt has its end too
        again += arm.meet(face, 1)
    held = np.array([s.mode is Mode.HOLD for s in again])
    assert np.count_nonzero(np.diff(held.astype(int)) == 1) >= 1, "one contact more, and it gives up again"
    assert sum(s.contact is not None for s in again) == np.count_nonzero(np.diff(held.astype(int)) == 1)
    assert arm.step(resume=True).mode is Mode.TRACK


@pytest.mark.parametrize("board", [-0.06, -0.15, -0.3])
def test_it_never_yields_into_what_it_sees(arm: Pushed, board: float):
    arm.push((0.0, -25.0, 0.0), cycles=20)
    unit = arm.skin.units[RIGHT]
    k, place = arm.model.link_index(unit.link), unit.T_link_sensor[:3, 3]

    def side() -> float:
        kin = arm.model.kinematics(arm.q)
        return float((kin.rotation[k] @ place + kin.position[k])[1])

    face = side() + board
    for _ in range(200):
        (step,) = arm.push((0.0, -25.0, 0.0), seen={RIGHT: max(side() - face, 0.001)})
        assert step.mode is Mode.REACT
        assert np.all(step.qp.slack < 0.01)
    near, kin = step.obstacles, arm.model.kinematics(step.q)
    J = arm.model.jacobian(kin, near.link[0], near.body_point[0])[:3]
    assert near.body_distance[0] > 0.0, "it stops before what the person pushes it to"
    assert near.direction[0] @ (J @ step.command) < 0.002


def test_what_holds_it_does_not_keep_a_caught_arm_from_opening(arm: Pushed):
    left = arm.skin.ids.index("hand_left")
    arm.push((0.0, -25.0, 0.0), cycles=50, seen={left: 0.04})
    arm.push((0.0, 25.0, 0.0), cycles=4, seen={left: 0.04})
    start = arm.ee()[1]
    arm.run(45, seen={left: 0.04})
    assert arm.ee()[1] - start > 0.02, "though it sees the hand that pushed it on the way back"


@pytest.mark.parametrize("change", ["", ":react.clamp=none"])
def test_self_clamping_is_looked_for_while_a_contact_lasts_whether_other_clamps_are_or_not(change: str):
    fold = Script(170, start=FOLDING)
    fold.move(100, 200, {3: -0.2})
    # a tap on the hand begins the reaction; 0.15 s later something is squeezed in the crook of the arm
    fold.push(model(), 150, 152, HAND, (0.0, 25.0, 0.0))
    fold.torque[165:] += CROOK_NM
    controlled = controller(Stream(f"pretouch{change}", lambda: fold, path=((0.21, 0.0, 0.38), (0.09, 0.0, 0.1))))
    state, steps = controlled.init(fold.state(0)), []
    for i in range(170):
        step, state = controlled.step(state, fold.inputs(i))
        steps.append(step)
    assert modes(steps[150:]) == {Mode.REACT}
    assert "Yielding to a contact" in steps[164].reason
    assert "panda_link2 and panda_link5" in steps[-1].reason


def test_a_gap_of_the_estimate_is_no_push_and_leaves_nothing_behind(arm: Pushed):
    arm.run(3, change=lambda robot: replace(robot, tau_ext=np.full(7, np.nan)))
    assert arm.state.mode.mode is Mode.HOLD
    assert "no force estimate" in arm.state.mode.reason
    arm.run(150)
    before = arm.ee()[1]
    arm.push((0.0, -25.0, 0.0), cycles=10)
    steps = arm.run(3, change=lambda robot: replace(robot, tau_ext=np.full(7, np.nan)))
    assert np.isfinite([s.command for s in steps]).all()
    arm.push((0.0, -25.0, 0.0), cycles=40)
    assert arm.state.mode.mode is Mode.REACT
    assert arm.ee()[1] < before - 0.03


@pytest.mark.parametrize("name", ["paper", "blind"])
def test_the_paper_does_not_look_at_joint_torques(panda_model, paper_skin, name: str):
    rng = np.random.default_rng(5)
    plain, other = (Pushed(panda_model, paper_skin, profile(name)) for _ in range(2))
    for i in range(400):
        force = (0.0, -25.0 * (150 < i < 180), 0.0)
        one = plain.step(force)
        two = other.feel(rng.normal(0, 20, 7), force=force)
        np.testing.assert_array_equal(one.command, two.command)
        assert (one.mode, one.reason) == (two.mode, two.reason)


def test_the_state_of_a_clamp_is_recorded_to_the_bit(arm: Pushed):
    caught(arm)
    arm.run(3)
    kept = unpacked(KeptState, packed_state(arm.state, False))
    assert same(kept, KeptState(False, arm.state))
    assert kept.state.reaction.clamp.torque > 0
