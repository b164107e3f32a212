"""The ends of what is allowed: a parameter, path, fixture or skin is refused when it is made, or it works."""

from contextlib import suppress
from dataclasses import fields, is_dataclass, replace

import numpy as np
import pytest

from pretouch.control.path import Circle, WayPoints, segment
from pretouch.controller import Controller
from pretouch.errors import PretouchError
from pretouch.perception.scene_filter import Fixtures, no_fixtures
from pretouch.profiles import PROFILES, Profile
from pretouch.robot.body import Capsules
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin, paper_skin
from pretouch.types import QpOutcome
from tests.following_arm import DT, SHORT, Arm, controller_of
from tests.fuzz.invariants import arrays_of

PAPER = PROFILES["paper"]
PARAMETERS = [
    f"{group.name}.{item.name}"
    for group in fields(Profile)
    if is_dataclass(getattr(PAPER, group.name))
    for item in fields(getattr(PAPER, group.name))
    if type(getattr(getattr(PAPER, group.name), item.name)) is float
]
SIZES = [0.0, 5e-324, 1e-12, 1e12, 1.7e308]


def drive(arm: Arm) -> None:
    """Let an arm move, meet an obstacle and be pushed; every number stays finite and every problem is answered."""
    reach = arm.model.description.qdd_max * DT
    for i in range(24):
        before, near = arm.qd, dict.fromkeys(range(len(arm.skin)), 0.5 if i < 18 else 0.05)
        step = arm.step((0.1 * (i % 3), 60.0 if 12 < i < 16 else 0.0, 0.0), near)
        for name, array in arrays_of(step):
            assert name == "force" or np.isfinite(array).all(), name
        assert step.qp.outcome is not QpOutcome.FAILED, step.qp.status
        assert (np.abs(step.command - before) <= reach * (1 + 1e-9)).all()


@pytest.mark.parametrize("name", PARAMETERS)
def test_an_extreme_value_is_refused_or_works(panda_model: RobotModel, paper_skin: Skin, name: str):
    group, field = name.split(".")
    allowed = 0
    for value in (*SIZES, *(-size for size in SIZES)):
        try:
            profile = replace(SHORT, **{group: replace(getattr(SHORT, group), **{field: value})})
            arm = Arm(panda_model, paper_skin, profile)
        except PretouchError:
            continue
        allowed += 1
        drive(arm)
    assert allowed < 2 * len(SIZES)


@pytest.mark.parametrize("margin", [1.6, 3.0])
def test_a_margin_that_leaves_a_joint_no_range_is_refused(panda_model: RobotModel, paper_skin: Skin, margin: float):
    profile = replace(SHORT, task=replace(SHORT.task, position_margin_rad=margin))
    with pytest.raises(PretouchError, match="margin"):
        controller_of(panda_model, paper_skin, profile)


@pytest.mark.parametrize(
    "path",
    [
        lambda: Circle(radius=5e-324), lambda: Circle(radius=1e300), lambda: Circle(start_angle=1e300),
        lambda: Circle(center=(1e308, 0.0, 0.0)), lambda: WayPoints(np.array([[0.0, 0.0, 0.0], [1e200, 0.0, 0.0]])),
        lambda: segment((0.0, 0.0, 0.0), (1e308, -1e308, 0.0)), lambda: segment((0.0, 0.0, 0.3), (1e150, 0.0, 0.0)),
        lambda: WayPoints(np.array([[0.0, 0.0, 0.0], [1e-5, 0.0, 0.0]]), closed=True),
    ],
)  # fmt: skip
def test_an_extreme_path_is_refused_or_works(panda_model: RobotModel, paper_skin: Skin, path):
    with suppress(PretouchError):
        drive(Arm(panda_model, paper_skin, SHORT, path()))


NONE = no_fixtures().capsules


def capsules(link: int = 0, a: float = 0.5, radius: float = 0.1, links: int = 1) -> Capsules:
    return Capsules(np.full(links, link), np.full((1, 3), a), np.full((1, 3), 1.0), np.array([radius]))


@pytest.mark.parametrize(
    "fixtures",
    [
        lambda: Fixtures(np.zeros((1, 3)), NONE), lambda: Fixtures(np.zeros(4), NONE),
        lambda: Fixtures(np.full((1, 4), np.nan), NONE), lambda: Fixtures(np.zeros((0, 4)), capsules(link=500)),
        lambda: Fixtures(np.zeros((0, 4)), capsules(link=-1)), lambda: Fixtures(np.zeros((0, 4)), capsules(a=np.nan)),
        lambda: Fixtures(np.zeros((0, 4)), capsules(radius=-1.0)),
        lambda: Fixtures(np.zeros((0, 4)), capsules(radius=np.nan)),
        lambda: Fixtures(np.zeros((0, 4)), capsules(links=3)),
    ],
)  # fmt: skip
def test_fixtures_that_compiled_code_would_read_beyond_are_refused(panda_model: RobotModel, paper_skin: Skin, fixtures):
    with pytest.raises(PretouchError):
        Controller(panda_model, paper_skin, fixtures(), Circle(), SHORT)


def test_a_skin_of_another_arm_is_refused(panda_model: RobotModel):
    skin = paper_skin(panda_model)
    skin.link[:] = 500  # as of an arm with more links
    with pytest.raises(PretouchError, match="skin"):
        controller_of(panda_model, skin, SHORT)
