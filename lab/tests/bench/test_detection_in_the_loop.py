"""The sequential detector on a simulated arm: quiet alone, and it feels pushes, loads and errors of the sensors."""

from dataclasses import replace

import numpy as np
import pytest

from pretouch.control.path import Circle
from pretouch.sim.plant_params import PlantParams
from pretouch.sim.scene import SceneSpec
from pretouch.types import Mode
from pretouch_lab.bench.contenders import DETECTORS
from pretouch_lab.bench.replays import Steps, alarms_of
from pretouch_lab.bench.scenes import path_of, sensing_of
from pretouch_lab.bench.streams import AWAY, Alone, record
from pretouch_lab.trial import play

pytestmark = pytest.mark.slow
PRETOUCH = {"profile": "pretouch"}


def test_a_simulated_arm_is_quiet_alone_and_feels_pushes(context):
    starts, sides = (70.0, 75.0), (1.0, -1.0)

    def prepare(plant, _) -> None:
        """Push the hand with half a sine of 20 N for 0.2 s along y."""
        push = plant.mj_data.xfrc_applied[int(plant.mj_model.body(plant.model.description.ee_body).id)]

        def before_step(time: float) -> None:
            phase = [(5.0 * np.pi * (time - start), side) for start, side in zip(starts, sides, strict=True)]
            push[1] = sum(20.0 * side * np.sin(angle) for angle, side in phase if 0.0 < angle < np.pi)

        plant.before_each_step(before_step)

    setup = context.setup(PRETOUCH, 1071, SceneSpec(), Circle(), prepare=prepare)
    trial = play(setup, lambda step, _: step.stamp >= 80.0)
    felt = [(s.stamp, s.contact.force[1]) for s in trial.steps if s.contact is not None]
    assert len(felt) == 2
    for (at, force), start, side in zip(felt, starts, sides, strict=True):
        assert 0.0 < at - start < 0.1
        assert force * side > 0
        goes_on = next(s.stamp for s in trial.steps if s.stamp > at and s.mode is Mode.TRACK)
        assert goes_on - at < 3.0, "nothing is left of the push to be found out"


def loaded(kg: float, since: float, until: float):
    """Have a weight hang on the hand for a time."""

    def prepare(plant, _) -> None:
        data, body = plant.mj_data, int(plant.mj_model.body(plant.model.description.ee_body).id)

        def before_step(time: float) -> None:
            data.xfrc_applied[body, 2] = -9.81 * kg if since <= time < until else 0.0

        plant.before_each_step(before_step)

    return prepare


def biased(joint: int, torque: float, since: float):
    """Have a joint's torque sensor err by a constant more."""

    def prepare(plant, _) -> None:
        right = plant._err.copy()

        def before_step(time: float) -> None:
            plant._err[joint] = right[joint] + (torque if time >= since else 0.0)

        plant.before_each_step(before_step)

    return prepare


@pytest.mark.parametrize(
    ("seed", "prepare"),
    [
        (1150, loaded(0.5, 30.0, np.inf)),
        (1150, loaded(0.5, -np.inf, 30.0)),
        (1163, biased(3, 2.0, 30.0)),
        (1163, biased(3, -1.0, 30.0)),
    ],
    ids=["gripped", "put down", "a step of the estimate", "one hardly felt"],
)
def test_what_stays_is_felt_once_and_the_task_goes_on(context, seed, prepare):
    setup = context.setup(PRETOUCH, seed, SceneSpec(), Circle(), prepare=prepare)
    trial = play(setup, lambda step, _: step.stamp >= 60.0)
    assert sum(s.contact is not None for s in trial.steps) == 1
    assert all(s.mode is Mode.TRACK for s in trial.steps if s.stamp > 40.0)


def test_an_arm_that_turns_round_hard_with_an_unknown_load_gives_no_alarm(panda_model):
    plant = replace(PlantParams(), payload_max_kg=0.5, friction_compensated=0.0)
    alone = Alone(path_of("line"), 0.3, plant, sensing_of("seven", 1112), 0.15, 1112, 120.0)
    stream = record(alone, lambda _: lambda _: AWAY)
    assert not alarms_of(Steps(stream, panda_model), DETECTORS[-1]).onsets()
