"""Through the vendor's unmodified libraries, in lockstep with a simulated arm."""

import json

import pytest
from fci.tests.driver.served import Served, output


def drive(served: Served, task: str) -> dict:
    return json.loads(output("drive.py", served.kind, served.address, task))


@pytest.mark.parametrize("kind", [pytest.param("panda", marks=pytest.mark.slow), "fr3"])
def test_an_exception_in_a_motion_stops_the_arm_before_it_is_raised(serve, kind):
    result = drive(serve(kind, "--lockstep"), "raises")
    assert result["states"] == 300
    assert result["trouble"] == "the disk is full"
    assert result["mode"] == "idle"


@pytest.mark.parametrize("drop", [pytest.param("3/50", marks=pytest.mark.slow), "15/200"])
@pytest.mark.parametrize("kind", ["panda", pytest.param("fr3", marks=pytest.mark.slow)])
def test_bursts_of_lost_commands_are_survived(serve, kind, drop):
    served = serve(kind, "--lockstep", "--drop", drop)
    result = drive(served, "staircase")
    assert result["mode"] == "idle"
    assert result["lost"] > 10
    assert "Motion ended" not in served.said()


@pytest.mark.parametrize("kind", ["panda", pytest.param("fr3", marks=pytest.mark.slow)])
def test_a_contact_above_the_arms_own_threshold_is_its_reflex_and_it_recovers(serve, kind):
    result = drive(serve(kind, "--lockstep", "--push", "0.5:0,80,0:0.5"), "contact")
    assert "cartesian_reflex" in result["errors"]
    assert "cartesian_reflex" in result["trouble"]
    assert result["mode"] == "reflex"
    assert result["refused"].endswith(
        'is in mode "reflex" after cartesian_reflex; free it from what it touches, then let it recover.'
    )
    assert result["last_errors"] == result["errors"]
    # pushed towards +y, the arm pushes its environment towards -y
    assert result["force"][1] < -30.0
