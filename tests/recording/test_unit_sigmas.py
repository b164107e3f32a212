"""How well the places of units are known goes with a recording."""

import json
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from pretouch.errors import RecordingError
from pretouch.recording.messages import decoded, definition, encoded
from pretouch.recording.reader import open_recording
from pretouch.recording.setting import RUN, decode_run, encode_run
from pretouch.recording.verify import verify
from pretouch.sensing.sensor import VL53L5CX
from pretouch.sensing.skin import Skin
from pretouch.sensing.unit import SensorUnit, TouchPatch
from tests.fuzz.invariants import same
from tests.recording.runs import controller_of, recorded_run


def unsure(skin: Skin, model) -> Skin:
    sigmas = np.random.default_rng(0).uniform(0.0, (0.03, 0.2), (len(skin), 2))
    units = [replace(u, position_sigma=p, orientation_sigma=o) for u, (p, o) in zip(skin.units, sigmas, strict=True)]
    return Skin([skin.units[0], *units[1:]], model)


def with_robot(data: bytes, change: Callable[[dict], dict]) -> bytes:
    """A Run message with what it says of the robot changed."""
    message = decoded(RUN, data)
    message.robot = json.dumps(change(json.loads(message.robot)))
    return encoded(RUN, message)


def test_a_run_with_uncertain_units_is_recomputed_to_the_bit(panda_model, paper_skin, tmp_path):
    skin = unsure(paper_skin, panda_model)
    run = recorded_run(tmp_path / "a.mcap", controller_of(panda_model, skin), 60)
    recorded = open_recording(tmp_path / "a.mcap")
    made = recorded.runs[0].skin
    assert same(made.position_sigma, skin.position_sigma)
    assert same(made.orientation_sigma, skin.orientation_sigma)
    found = verify(recorded)
    assert found.exact
    assert found.agrees
    plain = recorded_run(tmp_path / "b.mcap", controller_of(panda_model, paper_skin), 60)
    assert not same(run.cycles[-1].step.obstacles, plain.cycles[-1].step.obstacles)


def test_a_recording_that_says_nothing_of_uncertainties_has_none(panda_model, paper_skin):
    data = encode_run(0, controller_of(panda_model, unsure(paper_skin, panda_model)), {})
    silent = with_robot(data, lambda robot: {key: robot[key] for key in robot if key != "unit_sigma"})
    skin = decode_run(silent, lambda _: {}).skin
    assert skin.exact
    assert same(skin.T_link_sensor, paper_skin.T_link_sensor)


def test_the_message_names_all_that_is_kept_of_units(panda_model):
    patch, sensor = TouchPatch(0.01), VL53L5CX()
    pose = np.diag([1.0, 1.0, 1.0, 1.0]) + 0.2 * np.eye(4, k=3)
    unit = SensorUnit("a", panda_model.links[-1], pose, 0.01, 0.02, patch, sensor)
    data = encode_run(0, controller_of(panda_model, Skin([unit], panda_model)), {})
    names = {key for key in json.loads(decoded(RUN, data).robot) if key.startswith("unit_")}
    assert len(names) == 4
    assert all(f"# {name}: " in definition(RUN) for name in names)


def test_of_exact_units_nothing_is_said(panda_model, paper_skin):
    data = encode_run(0, controller_of(panda_model, paper_skin), {})
    assert "unit_sigma" not in json.loads(decoded(RUN, data).robot)


@pytest.mark.parametrize(
    "sigmas", [None, 3, {}, [], [[0.0, 0.0]] * 6, [[0.0]] * 7, [[0.0, 0.0, 0.0]] * 7, [["a", 0.0]] * 7, [[-1.0, 0]] * 7,
               [[float("nan"), 0.0]] * 7],
)  # fmt: skip
def test_uncertainties_that_are_none_are_refused(panda_model, paper_skin, sigmas):
    data = encode_run(0, controller_of(panda_model, paper_skin), {})
    with pytest.raises(RecordingError, match="does not describe a controller that can be made again"):
        _ = decode_run(with_robot(data, lambda robot: robot | {"unit_sigma": sigmas}), lambda _: {}).skin
