"""What made the steps: each controller is made again as it was."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from pretouch.control.path import Circle, WayPoints, segment
from pretouch.controller import Controller
from pretouch.errors import RecordingError
from pretouch.perception.scene_filter import Fixtures
from pretouch.recording.reader import open_recording
from pretouch.recording.verify import verify
from pretouch.robot.body import Capsules
from pretouch.robot.model import RobotModel
from pretouch.sensing.sensor import VL53L5CX
from pretouch.sensing.skin import Skin, paper_skin
from pretouch.sensing.unit import SensorUnit, TouchPatch
from tests.following_arm import SHORT, controller_of
from tests.fuzz.invariants import same
from tests.recording.runs import custom_arm, recorded_run

PATHS = [Circle((0.4, 0.1, 0.3), 0.17, 0.3), WayPoints(np.random.default_rng(0).normal(size=(5, 3)), closed=True),
         segment((0.1, 0.2, 0.3), (0.7, 0.1, 0.2))]  # fmt: skip


@pytest.mark.parametrize("path", PATHS)
def test_paths_of_ours_are_made_again_to_the_bit(controller, tmp_path, path):
    own = controller_of(controller.model, controller.skin, path=path)
    recorded_run(tmp_path / "a.mcap", own, 2)
    made = open_recording(tmp_path / "a.mcap").runs[0].path
    assert type(made) is type(path)
    assert (made.length, made.closed) == (path.length, path.closed)
    for phase in np.linspace(-0.5, 3.0, 50).tolist():
        assert same(made.point(phase), path.point(phase))
        assert same(made.tangent(phase), path.tangent(phase))


@pytest.mark.parametrize(
    ("length", "begins"),
    [pytest.param(1.0, 0.0, id="moves"), pytest.param(1.0, 0.4, id="dwells"), pytest.param(0.0, 0.0, id="stands")],
)
def test_a_path_of_another_class_is_drawn_and_has_to_be_given_to_go_on(controller, tmp_path, length, begins):
    model = controller.model
    start = model.kinematics(model.description.q_ready).position[model.ee]

    def point(phase: float) -> np.ndarray:
        along = np.clip(phase - begins, 0.0, length)
        return start + np.array([0.0, 0.5 * along * np.cos(along), 0.1 * along])

    path = SimpleNamespace(
        length=length, closed=False, tangent=lambda phase: np.array([0.0, np.cos(phase), np.sin(phase)]), point=point
    )
    recorded_run(tmp_path / "a.mcap", controller_of(controller.model, controller.skin, path=path), 40)
    recorded = open_recording(tmp_path / "a.mcap")
    near = recorded.runs[0].path
    assert near.closed is False
    for share in (0.0, 0.2, 0.55, 1.0):
        assert np.linalg.norm(near.points - path.point(share * length), axis=1).min() < 2e-3
    with pytest.raises(RecordingError, match=r"class SimpleNamespace.*run\.controller\(path=\.\.\.\)"):
        verify(recorded)
    verdict = verify(recorded, path=path)
    assert verdict.agrees, verdict.sentence
    assert verdict.exact


def test_arm_skin_and_fixtures_are_made_again_to_the_bit(tmp_path):
    model = RobotModel(custom_arm(tmp_path))
    T = np.eye(4)
    T[:3, 3] = 0.06, 1e-17, 1 / 3 * 0.1
    skin = Skin([SensorUnit("unit 1/ä", "b", T)], model)
    capsules = Capsules(np.zeros(1, np.int64), np.array([[0.1, 0.2, 1 / 3]]), np.ones((1, 3)), np.array([0.1]))
    own = Controller(model, skin, Fixtures(np.array([[0.0, 0.0, 1.0, -1 / 3]]), capsules), Circle(), SHORT)
    recorded_run(tmp_path / "a.mcap", own, 60)
    (tmp_path / "two.xml").unlink()
    recorded = open_recording(tmp_path / "a.mcap")
    assert verify(recorded).agrees
    made = recorded.runs[0].controller()
    assert made.model.links == model.links
    for name in ("q_ready", "qd_max", "qdd_max", "tau_max", "name", "source", "ee_body", "envelope"):
        assert same(getattr(made.model.description, name), getattr(model.description, name))
    assert made.skin.ids == skin.ids
    assert same(made.skin.T_link_sensor, skin.T_link_sensor)
    assert same(made.fixtures.planes, own.fixtures.planes)
    assert same(made.fixtures.capsules.a, capsules.a)
    assert same(made.fixtures.capsules.radius, capsules.radius)
    assert made.profile == own.profile
    recorded_run(tmp_path / "b.mcap", made, 2)  # whoever has it may record with it again


def test_zones_uncertain_places_and_touch_sensors_are_made_again_to_the_bit(tmp_path, panda_model, paper_skin):
    rng = np.random.default_rng(0)
    units = [
        replace(unit, position_sigma=rng.uniform(0.0, 0.03), orientation_sigma=rng.uniform(0.0, 0.2), **more)
        for unit, more in zip(paper_skin.units, [{}, {"touch": TouchPatch(0.01)}, {"sensor": VL53L5CX()}], strict=False)
    ]
    skin = Skin(units, panda_model)
    recorded_run(tmp_path / "a.mcap", controller_of(panda_model, skin), 60)
    recorded = open_recording(tmp_path / "a.mcap")
    made = recorded.runs[0].controller().skin
    assert (made.ids, made.boards) == (skin.ids, skin.boards)
    assert same(made.first, skin.first)
    for name in ("T_link_sensor", "position_sigma", "orientation_sigma"):
        assert same(getattr(made.arrays, name), getattr(skin.arrays, name))
    assert [(unit.id, unit.touch) for unit in made.mounted] == [(unit.id, unit.touch) for unit in units]
    assert verify(recorded).agrees


def test_the_envelope_of_an_arm_is_made_again(tmp_path, fr3_model):
    recorded_run(tmp_path / "a.mcap", controller_of(fr3_model, paper_skin(fr3_model)), 1)
    made = open_recording(tmp_path / "a.mcap").runs[0].model.description
    assert same(made.envelope, fr3_model.description.envelope)
    assert made.mjcf == fr3_model.description.mjcf
