"""Touch readings given to control steps: which are believed, what they change, and what they must not."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from pretouch.controller import Controller
from pretouch.loop import turn
from pretouch.ports import touch_of
from pretouch.profiles import PROFILES, profile
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.sensing.unit import SensorUnit, TouchPatch
from pretouch.sound import sound_touch
from pretouch.types import Inputs, Mode, TouchReadings, TouchStatus
from tests.following_arm import controller_of
from tests.fuzz.invariants import same
from tests.recording.runs import Run, assert_replays, custom_arm

OURS = PROFILES["pretouch"]


def readings(units: int = 7, stamp: float = 1.0, touched: tuple[int, ...] = ()) -> TouchReadings:
    contact = np.zeros(units, np.bool_)
    contact[list(touched)] = True
    return TouchReadings(np.full(units, stamp), contact, np.full(units, 2.0), np.zeros(units, np.int64))


@pytest.fixture
def feeling(panda_model, paper_skin) -> Skin:
    """The paper's skin with a touch sensor at each unit."""
    return Skin([replace(unit, touch=TouchPatch()) for unit in paper_skin.units], panda_model)


def test_readings_that_fit_are_copied():
    given = readings(touched=(2,))
    sound, wrong = sound_touch(given, 7)
    assert wrong == ""
    assert same(sound, given)
    assert sound is not None
    assert not np.shares_memory(sound.force, given.force)
    assert sound_touch(None, 7) == (None, "")


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (replace(readings(), force=np.zeros((7, 1))), "TouchReadings.force has the shape (7, 1), not (7,)"),
        (replace(readings(), contact=np.zeros(7)), "no array of yes and no"),
        (replace(readings(), status=np.array(["a"] * 7)), "no array of whole numbers"),
        ("nothing", "'nothing' is no TouchReadings"),
    ],
)
def test_readings_that_do_not_fit_are_said_and_hold_the_arm(panda_model, feeling, given, said):
    sound, wrong = sound_touch(given, 7)
    assert sound is None
    assert said in wrong
    step = Run(controller_of(panda_model, feeling, OURS)).turn(lambda inputs: replace(inputs, touch=given)).step
    assert step.mode is Mode.HOLD
    assert said in step.reason


def test_numbers_that_are_none_are_taken_for_nothing_known():
    given = replace(readings(touched=(0,)), stamp=np.array([np.nan] + [1.0] * 6),
                    force=np.array([-1.0, np.nan, np.inf, 2.0, 1e9, 0.0, 1.0]))  # fmt: skip
    sound, _ = sound_touch(given, 7)
    assert sound is not None
    assert sound.stamp[0] == -np.inf
    assert np.isnan(sound.force).tolist() == [True, True, True, False, True, False, False]


class Course:
    """An arm that stands, with noise on its torques and a push from the 30th step on."""

    def __init__(self, controller: Controller, push: np.ndarray, touched: tuple[int, ...] | None) -> None:
        rng, run = np.random.default_rng(3), Run(controller)
        self.steps = []
        state = run.state
        for k in range(140):
            given = run.inputs()
            torque = rng.normal(scale=0.05, size=controller.model.n) + (push if k >= 110 else 0.0)
            robot = replace(given.robot, tau_ext=torque, wrench=np.zeros(6), qd=np.zeros(controller.model.n))
            touch = None if touched is None else readings(7, run.time, touched if k >= 110 else ())
            ranges = replace(given.readings, status=np.full(7, 2))
            step, state = controller.step(state, Inputs(run.time, robot, ranges, False, touch))
            run.time += controller.profile.task.control_period_s
            self.steps.append(step)

    @property
    def evidence(self) -> list[float]:
        return [step.evidence for step in self.steps]


def push_of(model, skin: Skin, unit: int, newtons: float) -> np.ndarray:
    kin, link = model.kinematics(model.description.q_ready), int(skin.link[unit])
    T = skin.T_link_sensor[unit]
    at = kin.position[link] + kin.rotation[link] @ T[:3, 3]
    return np.asarray(model.jacobian(kin, link, at)[:3].T @ (-newtons * kin.rotation[link] @ T[:3, 2]))


def test_a_touch_makes_the_same_torques_more_evidence_of_a_contact(panda_model, feeling):
    push = push_of(panda_model, feeling, 4, 6.0)
    controller = controller_of(panda_model, feeling, OURS)
    without, touched = Course(controller, push, ()), Course(controller, push, (4,))
    assert without.evidence[:110] == touched.evidence[:110]
    assert max(touched.evidence[110:]) > max(without.evidence[110:]) > 0.0


def test_a_touch_alone_is_no_contact_and_is_not_learnt_from(panda_model, feeling):
    controller = controller_of(panda_model, feeling, OURS)
    course = Course(controller, np.zeros(7), (0, 1, 2, 3, 4, 5, 6))
    assert not any(step.contact is not None for step in course.steps)
    assert max(course.evidence) < 1.0


@pytest.mark.parametrize("touched", [None, (), (0, 4)])
def test_without_sensors_in_the_skin_or_without_the_switch_no_bit_changes(panda_model, paper_skin, feeling, touched):
    push = push_of(panda_model, feeling, 4, 6.0)
    plain = Course(controller_of(panda_model, paper_skin, OURS), push, None)
    off = profile("pretouch:detect.touch=none")
    for skin, chosen in ((paper_skin, OURS), (feeling, off)):
        found = Course(controller_of(panda_model, skin, chosen), push, touched)
        assert all(
            same(replace(a, reason=""), replace(b, reason="")) for a, b in zip(plain.steps, found.steps, strict=True)
        )
    assert PROFILES["paper"].detect.touch is None


def test_the_loop_hands_on_what_a_skin_feels(panda_model, feeling):
    run = Run(controller_of(panda_model, feeling, OURS))
    deaf = SimpleNamespace(read=lambda: run.inputs().readings)
    touched = SimpleNamespace(read=deaf.read, touch=lambda: readings(7, run.time, (3,)))
    arm = SimpleNamespace(read=lambda: run.inputs().robot, command=lambda qd: None)
    assert touch_of(deaf) is None
    cycle = turn(run.controller, run.state, arm, touched, 0.0)
    assert cycle.inputs.touch is not None
    assert cycle.inputs.touch.contact.tolist() == [k == 3 for k in range(7)]
    assert turn(run.controller, run.state, arm, deaf, 0.0).inputs.touch is None


def test_a_recording_with_touch_is_recomputed_to_the_bit_and_lacks_what_fits_no_message(panda_model, feeling, tmp_path):
    rng, run = np.random.default_rng(0), Run(controller_of(panda_model, feeling, OURS))

    def touch(k: int, stamp: float) -> TouchReadings | None:
        if k % 10 == 9:
            return None
        force = np.where(rng.random(7) < 0.3, np.nan, rng.uniform(0.0, 5.0, 7))
        status = np.where(rng.random(7) < 0.2, int(TouchStatus.FAILED), int(TouchStatus.OK))
        contact = ["yes"] * 7 if k == 30 else rng.random(7) < 0.3
        return TouchReadings(stamp - rng.uniform(0.0, 0.08, 7), contact, force, status)

    kept = assert_replays(run, tmp_path, lambda k, given: replace(given, touch=touch(k, given.stamp)), 60)
    assert [k for k in range(60) if kept[k].inputs is None] == [30]
    assert "numbers are none" in kept[30].unreadable
    assert [u.touch for u in kept.runs[0].skin.units] == [u.touch for u in feeling.units]
    assert run.cycles[-1].after.detector.touched.any()


def test_another_arm_feels_as_well(tmp_path):
    model, T = RobotModel(custom_arm(tmp_path)), np.eye(4)
    T[:3, 3] = [0.05, 0.0, 0.0]
    skin = Skin([SensorUnit("u", "b", T, touch=TouchPatch())], model)
    assert len(Run(controller_of(model, skin, OURS)).state.detector.touched) == 1
