"""Through the vendor's unmodified libraries, in lockstep with a simulated arm."""

import json
import os
import signal
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from pretouch.control.path import Circle
from pretouch.controller import Controller
from pretouch.hardware.franka.client import StateCallback
from pretouch.hardware.franka.limits import motion_limits
from pretouch.hardware.franka.lockstep import run_in_lockstep
from pretouch.hardware.franka.state import FrankaState
from pretouch.hardware.keys import save_keys
from pretouch.loop import Cycle
from pretouch.profiles import profile
from pretouch.robot.description import panda
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import paper_skin
from pretouch.serving.wire_skin import made_keys
from pretouch.sim.scene import SceneSpec, fixtures
from pretouch.types import RangeReadings
from tests.hardware.franka.made import CheckingArm, middle
from tests.hardware.franka.served import Served, loopback, output
from tests.ports import free_port

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


@pytest.mark.slow
def test_units_in_lockstep_repeat_to_the_last_bit(serve: Serve, tmp_path: Path) -> None:
    skin = paper_skin(RobotModel(panda()))
    keys, host = tmp_path / "keys.toml", loopback()
    save_keys(made_keys(skin.ids, 0), keys)
    results = []
    for _ in range(2):
        port = str(free_port())
        served = serve("panda", "--lockstep", "--start", "path", "--units", f"{host}:{port}", "--keys", str(keys))
        results.append(drive(served, "units", host, port, str(keys)))
    assert results[0] == results[1]
    assert results[0]["heard"] == len(skin)
    assert results[0]["speed"] > 0.1


@pytest.mark.slow
def test_what_goes_wrong_in_a_step_is_raised_when_the_arm_is_at_rest(serve: Serve) -> None:
    served = serve("panda", "--lockstep", "--start", "path")
    result = drive(served, "fail")
    assert result["trouble"] == "the disk is full"
    assert result["mode"] == "idle"
    assert "Motion ended" not in served.said()


class CheckingClient:
    """An arm that checks what it is told."""

    kind = "panda"

    def __init__(self, model: RobotModel) -> None:
        limits = motion_limits(model, "panda")
        self.arm, self.states, self.moving = CheckingArm(limits, middle(limits)), 0, False

    def read(self) -> FrankaState:
        return self.arm.state()

    def control(self, on_state: StateCallback) -> None:
        finished, self.moving = False, True
        while not finished:
            self.states += 1
            velocity, finished = on_state(self.arm.state(), 1e-3)
            self.arm.take(velocity.tolist())
        self.moving = False


class Nobody:
    """Records nothing."""

    def record(self, cycle: Cycle) -> None:
        pass


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_that_ends_a_program_waits_until_the_motion_has_ended(number: signal.Signals) -> None:
    model, came = RobotModel(panda()), []
    client = CheckingClient(model)
    controller = Controller(model, paper_skin(model), fixtures(SceneSpec()), Circle(), profile("blind"))
    silent = RangeReadings(np.full(7, -np.inf), np.zeros(7), np.full(7, 255))

    def readings_at(_time: float) -> RangeReadings:
        if client.states == 100:
            os.kill(os.getpid(), number)
        return silent

    before = signal.signal(number, lambda *_: came.append(client.moving))
    try:
        run_in_lockstep(client, controller, readings_at, Nobody(), lambda _: False)  # type: ignore[arg-type]
    finally:
        signal.signal(number, before)
    assert came == [False]
    assert client.states >= 100
