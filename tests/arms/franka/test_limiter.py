"""The limiter against an arm that checks each millisecond, and goes on by itself where a command is lost."""

from dataclasses import replace

import numpy as np
import pytest

from pretouch.arms.franka.limiter import SetPointLimiter, refusal
from pretouch.arms.franka.limits import FrankaLimits, LimiterParams, motion_limits, planned
from pretouch.errors import RobotError
from pretouch.robot.model import RobotModel
from tests.arms.franka.made import CheckingArm, middle


@pytest.fixture(params=["panda", "fr3"])
def limits(request: pytest.FixtureRequest, panda_model: RobotModel, fr3_model: RobotModel) -> FrankaLimits:
    return motion_limits(panda_model if request.param == "panda" else fr3_model, request.param)


def test_any_staircase_of_set_points_keeps_all_limits(limits: FrankaLimits) -> None:
    draw = np.random.default_rng(1)
    arm, limiter = CheckingArm(limits, middle(limits)), SetPointLimiter(limits, LimiterParams())
    wanted = np.zeros(7)
    for k in range(30_000):
        if k % 10 == 0 and draw.random() < 0.02:
            wanted = limits.qd_max * draw.choice([-1.0, 0.0, 0.3, 1.0], 7)
        arm.take(limiter.step(arm.state(), wanted.tolist()))
    assert np.abs(arm.q - middle(limits)).max() > 0.5


@pytest.mark.parametrize("by", [1.0, -1.0])
@pytest.mark.parametrize("steps", [0, 1, 300])
def test_a_false_report_of_what_is_commanded_is_an_error_and_no_step(
    limits: FrankaLimits, steps: int, by: float
) -> None:
    arm, limiter = CheckingArm(limits, middle(limits)), SetPointLimiter(limits, LimiterParams())
    wanted = (0.1 * limits.qd_max).tolist()
    for _ in range(steps):
        arm.take(limiter.step(arm.state(), wanted))
    state = arm.state()
    lie = replace(state, dq_d=state.dq_d + by * (np.arange(7) == 1))
    with pytest.raises(RobotError, match=r"^Joint 2 is said to be commanded .*, which no lost command explains"):
        limiter.step(lie, wanted)


@pytest.mark.parametrize(("lost", "of"), [(3, 50), (15, 200)])
def test_lost_commands_break_no_limit(limits: FrankaLimits, lost: int, of: int) -> None:
    draw = np.random.default_rng(2)
    arm, limiter = CheckingArm(limits, middle(limits)), SetPointLimiter(limits, LimiterParams())
    wanted, noticed = np.zeros(7), 0
    for k in range(20_000):
        if k % 100 == 0:
            wanted = 0.3 * limits.qd_max * draw.choice([-1.0, 0.0, 1.0], 7) * (-1) ** (k // 100)
        command = limiter.step(arm.state(), wanted.tolist())
        noticed += limiter.lost
        arm.take(None if k % of < lost and k > of else command)
    assert noticed > 20_000 / of


def test_a_command_that_comes_a_millisecond_late_and_is_still_taken_breaks_no_limit(limits: FrankaLimits) -> None:
    arm, limiter = CheckingArm(limits, middle(limits)), SetPointLimiter(limits, LimiterParams())
    for k in range(4000):
        wanted = 0.2 * limits.qd_max * (-1) ** (k // 300)
        command = limiter.step(arm.state(), wanted.tolist())
        if k % 20 == 7:
            arm.take(None)
            arm.take(command)
        else:
            arm.take(command)


def test_the_way_to_rest_ends_exactly_at_rest(limits: FrankaLimits) -> None:
    arm, limiter = CheckingArm(limits, middle(limits)), SetPointLimiter(limits, LimiterParams())
    assert not limiter.at_rest
    for _ in range(500):
        arm.take(limiter.step(arm.state(), (0.3 * limits.qd_max).tolist()))
    assert not limiter.at_rest
    for _ in range(1500):
        arm.take(limiter.step(arm.state(), [0.0] * 7))
    assert limiter.at_rest
    assert np.abs(arm.qd).max() < 1e-9


def test_without_a_loss_nothing_is_begun_anew(limits: FrankaLimits) -> None:
    arm, limiter = CheckingArm(limits, middle(limits)), SetPointLimiter(limits, LimiterParams())
    for _ in range(500):
        state = arm.state()
        rounded = replace(state, dq_d=np.float32(state.dq_d).astype(float))
        arm.take(limiter.step(rounded, (0.5 * limits.qd_max).tolist()))
        assert not limiter.lost


@pytest.mark.parametrize("joint", [0, 6])
@pytest.mark.parametrize("name", ["q_d", "dq_d", "ddq_d"])
def test_an_arm_that_reports_no_numbers_in_a_motion_is_an_error_with_a_sentence(
    limits: FrankaLimits, name: str, joint: int
) -> None:
    arm, limiter = CheckingArm(limits, middle(limits)), SetPointLimiter(limits, LimiterParams())
    for _ in range(200):
        arm.take(limiter.step(arm.state(), [0.3] * 7))
    getattr(wrong := arm.state(), name)[joint] = np.nan
    with pytest.raises(RobotError, match=r"nan.*, which is not finite: check the arm"):
        limiter.step(wrong, [0.3] * 7)


@pytest.mark.parametrize(
    ("joint", "value", "words"),
    [(0, np.nan, "joint 1 was to move at nan"), (6, -np.inf, "joint 7 was"), (3, 2.7, "limit ")],
)
def test_a_set_point_that_is_none_is_named(limits: FrankaLimits, joint: int, value: float, words: str) -> None:
    wanted = [0.0] * 7
    wanted[joint] = value
    assert words in refusal(wanted, limits)
    assert refusal(limits.qd_max.tolist(), limits) == ""
    assert "6 joint velocities were asked for" in refusal(wanted[:6], limits)


def test_a_controller_is_told_the_acceleration_that_is_used(panda_model: RobotModel) -> None:
    told = RobotModel(planned(panda_model.description, LimiterParams(acceleration_share=0.25)))
    np.testing.assert_array_equal(told.description.qdd_max, panda_model.description.qdd_max / 4)
    # what the arm takes is what it was
    np.testing.assert_array_equal(motion_limits(told, "panda").qdd_max, panda_model.description.qdd_max)
