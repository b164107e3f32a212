"""What is seen of an arm that stands, what of that forbids a run, and that nobody moves it before it moves."""

import re
from dataclasses import replace

import numpy as np
import pytest

from pretouch.arms.franka.limits import LimiterParams
from pretouch.control.path import Circle, segment
from pretouch.controller import Controller
from pretouch.errors import RobotError
from pretouch.importing.mounting import weights_of
from pretouch.loop import MonotonicClock
from pretouch.perception.scene_filter import no_fixtures
from pretouch.ports import NoUnits
from pretouch.profiles import PROFILES, profile
from pretouch.sensing.skin import Skin
from pretouch.session.may_move import LEAST_ROOM_RAD, StandingArm, check, check_start, watch
from pretouch.session.run import plan_to_start
from tests.session.arms import PushedArm


@pytest.fixture(scope="module")
def controller(panda_model):
    return Controller(panda_model, Skin((), panda_model), no_fixtures(), Circle(), PROFILES["blind"])


def seen(arm, seconds=2.0):
    return watch(arm, arm, arm.model.description.qd_max, seconds)


def found(controller, seen, floor=-0.2):
    return check(controller, seen, floor)


def test_a_sound_arm_is_found_fit(controller, panda_model):
    assert found(controller, seen(PushedArm(panda_model, force=lambda _: np.array([1.0, -1.5, 2.0]), noise=1.8))) == ()


@pytest.mark.parametrize(
    ("about", "what", "said"),
    [
        ({"force": lambda _: np.array([0.0, 0.0, 6.0])}, "bias", r"\(0\.0, 0\.0, 6\.0\) N \(limit 5 N"),
        ({"noise": 4.0}, "noise", "standard deviation of"),
        (
            {"force": lambda t: np.array([0.0, 9.0 if 101.0 < t < 101.3 else 0.0, 0.0])},
            "touched", "do not touch the arm",
        ),
    ],
)  # fmt: skip
def test_a_force_at_rest_that_would_hide_contacts_is_refused(controller, panda_model, about, what, said):
    findings = {finding.what: finding for finding in found(controller, seen(PushedArm(panda_model, **about)))}
    assert findings[what].level == "fault"
    assert re.search(said, findings[what].sentence)


def test_torques_of_an_arm_that_is_mounted_otherwise_are_refused_and_named(controller, panda_model):
    standing = seen(PushedArm(panda_model))
    weight = weights_of(panda_model, standing.newest.q) @ (panda_model.gravity - [9.81, 0.0, 0.0])
    (finding,) = found(controller, replace(standing, tau_ext=standing.tau_ext + weight))
    assert (finding.what, finding.level) == ("mounting", "fault")
    assert re.search(r"gravity points along \(9\.8, -?0\.0, -?0\.0\) m/s\^2 in its base frame", finding.sentence)


def test_no_force_estimate_is_refused(controller, panda_model):
    standing = seen(PushedArm(panda_model))
    findings = found(controller, replace(standing, wrench=np.full_like(standing.wrench, np.nan)))
    assert [finding.what for finding in findings] == ["no force"]


def test_missing_torques_are_refused_where_they_detect_contacts(controller, panda_model):
    standing = seen(PushedArm(panda_model))
    untold = replace(standing, tau_ext=np.full_like(standing.tau_ext, np.nan))
    by_torques = Controller(
        panda_model, Skin((), panda_model), no_fixtures(), Circle(), profile("pretouch:perception=none")
    )
    assert found(controller, untold) == found(by_torques, standing) == ()
    (finding,) = found(by_torques, untold)
    assert "no external joint torques in 100% of its states, and the profile pretouch" in finding.sentence


def test_an_arm_that_moves_is_refused(controller, panda_model):
    standing = seen(PushedArm(panda_model))
    q = standing.q + np.linspace(0.0, 0.02, len(standing.q))[:, None] * np.eye(7)[3]
    (finding,) = found(controller, replace(standing, q=q))
    assert "joint4 moved by 0.020 rad" in finding.sentence


@pytest.mark.parametrize(("room", "refused"), [(0.003, True), (0.008, False), (0.05, False)])
def test_a_joint_near_its_limit_is_named(controller, panda_model, room, refused):
    standing = seen(PushedArm(panda_model))
    q = standing.newest.q.copy()
    q[5] = panda_model.q_max[5] - room
    (finding,) = found(controller, replace(standing, newest=replace(standing.newest, q=q)))
    assert (finding.level == "fault") == refused
    assert f"joint6 is at {q[5]:.3f} rad, {room:.3f} rad from its limit" in finding.sentence


def test_an_arm_that_its_own_limiter_has_brought_to_a_limit_is_not_refused(panda_model):
    assert LimiterParams().position_margin_rad < LEAST_ROOM_RAD
    assert PROFILES["paper"].task.position_margin_rad - 0.002 > LEAST_ROOM_RAD


def test_a_path_that_comes_down_to_the_floor_is_refused(controller, panda_model):
    (finding,) = found(controller, seen(PushedArm(panda_model)), floor=0.0)
    assert "z = 0.00 m" in finding.sentence
    assert "--floor" in finding.sentence


def test_the_way_to_the_start_ends_there_and_is_slow(controller, panda_model):
    q = panda_model.description.q_ready
    way = plan_to_start(panda_model, q, controller.path, -0.2)
    assert np.allclose(way.at(0.0)[0], q)
    assert not check_start(controller, way.at(way.duration)[0])
    assert plan_to_start(panda_model, way.at(way.duration)[0], controller.path, -0.2) is None
    times = np.linspace(0.0, way.duration, 200)
    x = np.array([panda_model.kinematics(way.at(t)[0]).position[panda_model.ee] for t in times])
    assert np.linalg.norm(np.diff(x, axis=0), axis=1).max() / (times[1] - times[0]) < 0.16


def test_a_way_through_the_floor_is_an_error(panda_model):
    with pytest.raises(RobotError, match="No motion to the start"):
        plan_to_start(panda_model, panda_model.description.q_ready, segment((0.5, 0.0, -0.1), (0.5, 0.1, -0.1)), 0.0)


# what is seen


@pytest.fixture
def arm(panda_model):
    return PushedArm(panda_model)


def test_force_and_noise_at_rest_are_those_the_arm_was_given(panda_model):
    bias = np.array([1.0, -2.0, 3.0])
    arm = PushedArm(panda_model, lambda _: bias, noise=1.0)
    standing = seen(arm, 10.0)
    assert np.allclose(standing.rest_wrench[:3], bias, atol=0.2)
    assert np.allclose(standing.noise, 1.0, atol=0.1)
    assert standing.disturbance < 2.0
    assert standing.missing_share == 0.0


def test_one_noisy_state_in_a_span_without_others_is_no_touch(arm):
    standing = seen(arm, 3.0)
    lone = np.searchsorted(standing.stamp, standing.stamp[0] + 1.02)
    kept = np.ones(len(standing.stamp), dtype=bool)
    kept[lone - 2 : lone + 8] = False
    kept[lone] = True
    standing.wrench[lone, 0] = 6.0
    thinned = replace(standing, stamp=standing.stamp[kept], wrench=standing.wrench[kept])
    assert thinned.disturbance < 1.0


def test_states_without_an_estimate_are_counted(arm):
    read, count = arm.read, iter(range(1000))
    arm.read = lambda: replace(read(), wrench=None) if next(count) % 2 else read()
    assert seen(arm).missing_share == pytest.approx(0.5, abs=0.02)


@pytest.mark.parametrize(
    ("change", "said"), [({"stamp": 100.0}, "sent 1 states in"), ({"q": np.full(7, np.nan)}, "cannot be used")]
)
def test_a_state_that_stands_still_or_is_no_number_is_an_error(arm, change, said):
    read = arm.read
    arm.read = lambda: replace(read(), **change)
    with pytest.raises(RobotError, match=said):
        seen(arm)


# between the checks and the motion


def checked(model, path=None, approach=False):
    """An arm that stands where its path begins, and what was seen of it."""
    arm = PushedArm(model)
    arm.unfit = lambda: ()
    here = model.kinematics(arm.q).position[model.ee]
    path = path or segment(tuple(here), tuple(here + np.array([0.0, 0.4, 0.0])))
    controller = Controller(model, Skin((), model), no_fixtures(), path, PROFILES["blind"])
    return StandingArm(arm, NoUnits(), controller, 0.0, MonotonicClock(0.01), approach), seen(arm)


def test_an_arm_that_stands_where_it_was_checked_may_move(panda_model):
    arm, standing = checked(panda_model)
    assert np.array_equal(arm.recheck(standing), panda_model.description.q_ready)


@pytest.mark.parametrize("moved", [0.01, np.nan])
@pytest.mark.parametrize("approach", [True, False])
def test_an_arm_that_was_guided_since_it_was_checked_may_not(panda_model, approach, moved):
    arm, standing = checked(panda_model, approach=approach)
    arm.arm.q = arm.arm.q + moved * np.eye(7)[1]
    with pytest.raises(RobotError, match=r"moved after the checks, panda_joint\d by .* start again"):
        arm.recheck(standing)


def test_an_arm_away_from_its_path_may_only_where_it_goes_there_first(panda_model):
    arm, standing = checked(panda_model, Circle(), approach=True)
    arm.recheck(standing)
    with pytest.raises(RobotError, match="--approach"):
        replace(arm, approach=False).recheck(standing)


def test_what_the_arm_itself_has_against_it_counts(panda_model):
    arm, standing = checked(panda_model)
    arm.arm.unfit = lambda: ("Its stop button is pressed.",)
    with pytest.raises(RobotError, match="stop button"):
        arm.recheck(standing)
