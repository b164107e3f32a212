"""Through the vendor's unmodified libraries, in lockstep with a simulated arm."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from fci.tests.driver.served import Served, output
from tests.ports import free_port

from pretouch.cli.skin_keys import with_new
from pretouch.hardware.keys import Keys, save_keys
from pretouch.recording.reader import Recorded, open_recording
from pretouch.robot.description import panda
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import paper_skin
from pretouch.types import Mode

KINDS = ("panda", "fr3")
Serve = Callable[..., Served]


def drive(served: Served, task: str, *more: str) -> dict:
    return json.loads(output("drive.py", served.kind, served.address, task, *more))


@pytest.mark.parametrize("kind", [pytest.param("panda", marks=pytest.mark.slow), "fr3"])
def test_an_exception_in_a_motion_stops_the_arm_before_it_is_raised(serve: Serve, kind: str) -> None:
    result = drive(serve(kind, "--lockstep"), "raises")
    assert result["states"] == 300
    assert result["trouble"] == "the disk is full"
    assert result["mode"] == "idle"


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_the_same_motion_gives_the_same_states_to_the_last_bit(serve: Serve, kind: str) -> None:
    first, second = (drive(serve(kind, "--lockstep"), "staircase") for _ in range(2))
    assert first["digest"] == second["digest"]
    assert first["states"] > 1500
    assert first["lost"] == 0
    assert first["mode"] == "idle"


@pytest.mark.parametrize("drop", [pytest.param("3/50", marks=pytest.mark.slow), "15/200"])
@pytest.mark.parametrize("kind", ["panda", pytest.param("fr3", marks=pytest.mark.slow)])
def test_bursts_of_lost_commands_are_survived(serve: Serve, kind: str, drop: str) -> None:
    served = serve(kind, "--lockstep", "--drop", drop)
    result = drive(served, "staircase")
    assert result["mode"] == "idle"
    assert result["lost"] > 10
    assert "Motion ended" not in served.said()


@pytest.mark.parametrize("kind", ["panda", pytest.param("fr3", marks=pytest.mark.slow)])
def test_a_contact_above_the_arms_own_threshold_is_its_reflex_and_it_recovers(serve: Serve, kind: str) -> None:
    result = drive(serve(kind, "--lockstep", "--push", "0.5:0,80,0:0.5"), "contact")
    assert "cartesian_reflex" in result["errors"]
    assert "cartesian_reflex" in result["trouble"]
    assert result["mode"] == "reflex"
    assert result["refused"].endswith(
        'is in mode "reflex" after cartesian_reflex; free it from what it touches, then let it recover.'
    )
    assert result["last_errors"] == result["errors"]
    # pushed towards +y, the arm pushes its environment towards -y
    assert np.array(result["forces"])[-1, 1] < -30.0


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_a_controller_in_lockstep_repeats_to_the_last_bit(serve: Serve, kind: str) -> None:
    first, second = (drive(serve(kind, "--lockstep", "--start", "path"), "control") for _ in range(2))
    assert first["digest"] == second["digest"]
    assert first["states"] == 250
    assert first["speed"] > 0.2
    assert first["mode"] == "idle"


class Units:
    """Keys of the seven units of an arm, and where they are heard."""

    def __init__(self, folder: Path) -> None:
        self.skin, self.keys, self.port = paper_skin(RobotModel(panda())), str(folder / "keys.toml"), str(free_port())
        save_keys(with_new(Keys(), self.skin.ids), Path(self.keys))

    @property
    def served(self) -> tuple[str, ...]:
        return "--lockstep", "--start", "path", "--units", f"127.0.0.1:{self.port}", "--keys", self.keys


@pytest.mark.slow
def test_units_in_lockstep_repeat_to_the_last_bit(serve: Serve, tmp_path: Path) -> None:
    units = Units(tmp_path)
    results = [drive(serve("panda", *units.served), "units", units.port, units.keys) for _ in range(2)]
    assert results[0] == results[1]
    assert results[0]["heard"] == len(units.skin)
    assert results[0]["speed"] > 0.1


def experiment(serve: Serve, kind: str, folder: Path, name: str, side: str, *scene: str) -> Recorded:
    """Play one with units; return the recording."""
    folder.mkdir()
    units, place = Units(folder), folder / "run.mcap"
    served = serve(kind, *units.served, *scene)
    drive(served, "experiment", name, side, "9", str(place), units.port, units.keys)
    assert "reflex" not in served.said()
    return open_recording(place)


def steps_as_written(recording: Recorded) -> list[bytes]:
    return [recording.step_data(i) for i in range(len(recording))]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "side", "push", "times"), [("panda", "+y", -1.0, 2), ("panda", "-y", 1.0, 1), ("fr3", "+y", -1.0, 1)]
)
def test_the_static_experiment_repeats_to_the_last_bit_and_the_arm_yields_away_from_the_board(
    serve: Serve, tmp_path: Path, kind: str, side: str, push: float, times: int
) -> None:
    words = "paper:approach=none", side, "--scene", "static", "--side", side
    runs = [experiment(serve, kind, tmp_path / str(k), *words) for k in range(times)]
    assert all(steps_as_written(run) == steps_as_written(runs[0]) for run in runs)
    steps = [kept.step for kept in runs[0]]
    contact = next(step.contact for step in steps if step.contact is not None)
    assert push * contact.force[1] > 5.0
    moving = [step for step in steps if step.mode is Mode.REACT]
    assert push * moving[20].ee_velocity[1] > 0.0


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "times"), [("panda", 1), ("fr3", 2)])
def test_the_dynamic_experiment_repeats_to_the_last_bit_and_the_arm_yields_to_the_push(
    serve: Serve, tmp_path: Path, kind: str, times: int
) -> None:
    runs = [experiment(serve, kind, tmp_path / str(k), "pretouch", "none", "--scene", "dynamic") for k in range(times)]
    assert all(steps_as_written(run) == steps_as_written(runs[0]) for run in runs)
    steps = [kept.step for kept in runs[0]]
    contact = next(i for i, step in enumerate(steps) if step.contact is not None)
    after = np.mean([step.ee_velocity for step in steps[contact + 20 : contact + 60]], axis=0)
    assert after @ steps[contact].contact.force > 0.0
