"""Fixtures that move, through the whole controller, the loop and a recording."""

from dataclasses import replace

import numpy as np
import pytest

from pretouch.explanation import explain
from pretouch.limited import Limit
from pretouch.moving_fixtures import SOMEWHERE, MovingFixtures
from pretouch.profiles import PROFILES
from pretouch.recording.reader import open_recording
from pretouch.recording.verify import verify
from pretouch.recording.writer import Recording
from pretouch.types import Mode
from tests.following_arm import Arm
from tests.fuzz.invariants import same
from tests.recording.runs import Run, controller_of

PRETOUCH = PROFILES["pretouch"]


def rod(x: float, y: float, stamp: float, speed: float = 0.0) -> MovingFixtures:
    """An upright rod of 5 cm radius that moves along y."""
    a, b = np.array([[x, y, 0.0]]), np.array([[x, y, 1.0]])
    v = np.array([[0.0, speed, 0.0]])
    return MovingFixtures(stamp, a, b, np.array([0.05]), v, v)


@pytest.mark.parametrize(
    "profile", [PRETOUCH, PROFILES["paper"], replace(PRETOUCH, perception=None)], ids=["pretouch", "paper", "unseeing"]
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
        step = coming.step(moving=rod(x, y + 0.45 + 0.3 * (1.3 - 0.01 * i) - 0.39, coming.time, -0.3))
    assert step.command[0] < still.qd[0]


@pytest.mark.parametrize("profile", [PRETOUCH, PROFILES["paper"]], ids=lambda profile: profile.name)
def test_far_away_it_changes_no_command(panda_model, paper_skin, profile):
    plain, given = Arm(panda_model, paper_skin, profile), Arm(panda_model, paper_skin, profile)
    for _ in range(150):
        one, other = plain.step(), given.step(moving=rod(5.0, 5.0, given.time))
        assert one.command.tobytes() == other.command.tobytes()
        assert one.thresholds.parts.tobytes() == other.thresholds.parts.tobytes()


def test_silence_of_who_tells_holds_the_arm_until_it_is_told_for_the_first_time_and_again(panda_model, paper_skin):
    arm = Arm(panda_model, paper_skin, PRETOUCH)
    steps = [arm.step(moving=SOMEWHERE) for _ in range(9)]
    assert {step.mode for step in steps} == {Mode.HOLD}
    assert "have not been told of yet" in steps[-1].reason
    for _ in range(150):
        step = arm.step(moving=rod(5.0, 0.0, arm.time))
    assert step.mode is Mode.TRACK
    told = arm.time
    for _ in range(8):
        step = arm.step(moving=rod(5.0, 0.0, told))
    assert step.mode is Mode.HOLD
    assert step.reason == (
        "The fixtures that move were last known 0.070 s ago: check who tells of them; the arm goes on when it is told"
        " again."
    )
    assert arm.step(moving=rod(5.0, 0.0, arm.time)).mode is Mode.TRACK


def test_a_recording_holds_them_to_the_bit_and_replays(panda_model, paper_skin, tmp_path):
    run = Run(controller_of(panda_model, paper_skin))
    for i in range(60):
        run.turn(lambda inputs, i=i: replace(inputs, moving=rod(0.6, 0.3 + 0.001 * i, inputs.stamp, 0.1)))
    place = tmp_path / "beside.mcap"
    with Recording(place, run.controller) as recording:
        for cycle in run.cycles:
            recording.record(cycle)
    found = open_recording(place)
    assert [same(kept.inputs, cycle.inputs) for kept, cycle in zip(found, run.cycles, strict=True)] == 60 * [True]
    assert verify(found).agrees
