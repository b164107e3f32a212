"""The sequential detector in the controller: absent torques, a change of method, and a simulated arm."""

from dataclasses import replace

import numpy as np
import pytest

from pretouch.control.path import Circle, line
from pretouch.controller import Controller
from pretouch.profiles import profile
from pretouch.sensing.skin import Skin, paper_skin
from pretouch.sim.plant_params import PlantParams
from pretouch.sim.scene import SceneSpec, fixtures
from pretouch.types import Inputs, Mode, RangeReadings, RobotState
from pretouch_lab.baselines.detection import BASELINES
from pretouch_lab.benchmarks.detection.arm import AWAY, Alone, path_of, record, sensing_of
from pretouch_lab.benchmarks.detection.replay import replay
from pretouch_lab.paper.claims.forces import Event, apply
from pretouch_lab.trial import Setup, play

NONE = RangeReadings(np.zeros(0), np.zeros(0), np.zeros(0, np.int64))


def controller(model, name: str) -> Controller:
    x = model.kinematics(model.description.q_ready).position[model.ee]
    way = line(tuple(x.tolist()), (float(x[0]), float(x[1]) + 0.1, float(x[2])))
    return Controller(model, Skin([], model), fixtures(SceneSpec()), way, profile(name))


def robot(model, stamp: float, tau_ext: object) -> RobotState:
    q, still = model.description.q_ready, np.zeros(model.n)
    return RobotState(stamp, q, still, q, still, tau_ext, np.zeros(6))  # type: ignore[arg-type]


@pytest.mark.parametrize("given", [None, "many", np.full(7, np.nan), np.zeros(3), np.full(7, 1e9)])
@pytest.mark.parametrize(("name", "holds"), [("pretouch", True), ("fixed", True), ("paper", False)])
def test_an_arm_without_torques_holds_if_its_detector_needs_them(panda_model, given, name, holds):
    c = controller(panda_model, f"{name}:window.samples=10")
    state = c.init(robot(panda_model, 0.0, given))
    for k in range(1, 40):
        step, state = c.step(state, Inputs(0.01 * k, robot(panda_model, 0.01 * k, given), NONE))
    assert (step.mode is Mode.HOLD) is holds
    assert np.isnan(step.residual).all()
    assert ("force" in step.reason) is holds


def test_another_method_begins_anew_and_what_was_learnt_can_be_given(panda_model):
    paper, ours = controller(panda_model, "paper"), controller(panda_model, "pretouch")
    state = paper.init(robot(panda_model, 0.0, np.zeros(7)))
    step, state = paper.step(state, Inputs(0.01, robot(panda_model, 0.01, np.zeros(7)), NONE))
    assert step.evidence == 0.0
    adopted = ours.adopt(state, paper)
    model = adopted.detector.test.model
    assert not model.weights.any()
    known = replace(model, weights=model.weights + 0.5)
    again = ours.init(robot(panda_model, 0.0, np.zeros(7)), known).detector.test.model
    np.testing.assert_array_equal(again.weights, 0.5)


@pytest.mark.slow
def test_a_simulated_arm_is_quiet_alone_and_feels_pushes(panda_model):
    pushes = tuple(
        Event("push", 20.0, start, np.array([0.0, side, 0.0])) for start, side in ((70.0, 1.0), (75.0, -1.0))
    )
    trial = play(
        Setup(
            panda_model, paper_skin(panda_model), profile("pretouch"), SceneSpec(), Circle(), 1071,
            prepare=lambda plant, _: apply(plant, pushes),
        ),
        lambda step, _: step.stamp >= 80.0,
    )  # fmt: skip
    felt = [(s.stamp, s.contact.force[1]) for s in trial.steps if s.contact is not None]
    assert len(felt) == 2
    for (at, force), push in zip(felt, pushes, strict=True):
        assert 0.0 < at - push.start < 0.1
        assert force * push.direction[1] > 0
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


@pytest.mark.slow
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
def test_what_stays_is_felt_once_and_the_task_goes_on(panda_model, seed, prepare):
    trial = play(
        Setup(
            panda_model, paper_skin(panda_model), profile("pretouch"), SceneSpec(), Circle(), seed, prepare=prepare
        ),
        lambda step, _: step.stamp >= 60.0,
    )  # fmt: skip
    assert sum(s.contact is not None for s in trial.steps) == 1
    assert all(s.mode is Mode.TRACK for s in trial.steps if s.stamp > 40.0)


@pytest.mark.slow
def test_an_arm_that_turns_round_hard_with_an_unknown_load_gives_no_alarm(panda_model):
    plant = replace(PlantParams(), payload_max_kg=0.5, friction_compensated=0.0)
    alone = Alone(path_of("line"), 0.3, plant, sensing_of("seven", 1112), 0.15, 1112, 120.0)
    stream = record(alone, lambda _: lambda _: AWAY)
    assert not replay(stream, BASELINES[-1], panda_model).onsets()
