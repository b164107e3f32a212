"""Between the checks and the motion nobody may have moved the arm."""

import numpy as np
import pytest

from pretouch.control.path import Circle, line
from pretouch.controller import Controller
from pretouch.errors import RobotError
from pretouch.loop import MonotonicClock
from pretouch.perception.scene_filter import no_fixtures
from pretouch.profiles import PROFILES
from pretouch.sensing.skin import Skin
from pretouch.session.preflight import PreflightParams
from pretouch.session.session import NoUnits, Session
from pretouch.session.standstill import watch
from tests.session.arms import PushedArm

PARAMS = PreflightParams()


def checked(model, path=None):
    """A session of an arm that stands where its path begins, and what was seen of it."""
    arm = PushedArm(model)
    arm.unfit = lambda: ()
    here = model.kinematics(arm.q).position[model.ee]
    path = path or line(tuple(here), tuple(here + np.array([0.0, 0.4, 0.0])))
    controller = Controller(model, Skin((), model), no_fixtures(), path, PROFILES["blind"])
    session = Session(arm, NoUnits(), None, controller, 0.0, MonotonicClock(0.01))
    return session, watch(arm, arm, model.description.qd_max, 1.0)


def test_an_arm_that_stands_where_it_was_checked_may_move(panda_model):
    session, seen = checked(panda_model)
    assert np.array_equal(session.recheck(seen, PARAMS, approach=False), panda_model.description.q_ready)


@pytest.mark.parametrize("moved", [0.01, np.nan])
@pytest.mark.parametrize("approach", [True, False])
def test_an_arm_that_was_guided_since_it_was_checked_may_not(panda_model, approach, moved):
    session, seen = checked(panda_model)
    session.arm.q = session.arm.q + moved * np.eye(7)[1]
    with pytest.raises(RobotError, match=r"moved after the checks, panda_joint\d by .* start again"):
        session.recheck(seen, PARAMS, approach)


def test_an_arm_away_from_its_path_may_only_where_it_goes_there_first(panda_model):
    session, seen = checked(panda_model, Circle())
    session.recheck(seen, PARAMS, approach=True)
    with pytest.raises(RobotError, match="--approach"):
        session.recheck(seen, PARAMS, approach=False)


def test_what_the_arm_itself_has_against_it_counts(panda_model):
    session, seen = checked(panda_model)
    session.arm.unfit = lambda: ("Its stop button is pressed.",)
    with pytest.raises(RobotError, match="stop button"):
        session.recheck(seen, PARAMS, approach=False)
