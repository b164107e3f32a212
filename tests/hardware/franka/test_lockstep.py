"""Through the vendor's unmodified libraries, in lockstep with a simulated arm."""

import json
from collections.abc import Callable

import numpy as np
import pytest

from tests.hardware.franka.served import Served, output

KINDS = ("panda", "fr3")
Serve = Callable[..., Served]


def drive(served: Served, task: str) -> dict:
    return json.loads(output("drive.py", served.kind, served.address, task))


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_the_same_motion_gives_the_same_states_to_the_last_bit(serve: Serve, kind: str) -> None:
    first, second = (drive(serve(kind, "--lockstep"), "staircase") for _ in range(2))
    assert first["digest"] == second["digest"]
    assert first["states"] > 1500
    assert first["lost"] == 0
    assert first["mode"] == "idle"


@pytest.mark.parametrize("drop", [pytest.param("3/50", marks=pytest.mark.slow), "15/200"])
@pytest.mark.parametrize("kind", KINDS)
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
        'is in mode "reflex" after cartesian_reflex: clear what it touches, then let it recover.'
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
def test_what_goes_wrong_in_a_step_is_raised_when_the_arm_is_at_rest(serve: Serve) -> None:
    served = serve("panda", "--lockstep", "--start", "path")
    result = drive(served, "fail")
    assert result["trouble"] == "the disk is full"
    assert result["mode"] == "idle"
    assert "Motion ended" not in served.said()
