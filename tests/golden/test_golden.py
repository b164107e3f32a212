"""What the controller does with inputs by script is what it did: stored values hold to 1e-12."""

import numpy as np
import pytest

from pretouch.profiles import PROFILES
from pretouch.types import ControlStep
from tests.golden import streams
from tests.golden.closed import CLOSED
from tests.golden.fields import FIELDS, leaves
from tests.golden.kept import Steps, close, first_difference, read
from tests.golden.streams import STREAMS, run
from tests.golden.values import FILE, STORED


@pytest.fixture(scope="module")
def stored() -> Steps:
    return read(FILE)


@pytest.mark.parametrize("name", STORED)
def test_steps_are_the_stored_ones(stored: Steps, name: str):
    steps = run(STREAMS[name])
    here = {name: {i: steps[i] for i in stored[name]}}
    said = first_difference({name: stored[name]}, here, close, ("values.npz", "this checkout"))
    assert not said, f"{said} If that is meant, say `make golden-values` and commit the file alone."


def test_all_of_the_stored_values_are_compared(stored: Steps):
    assert set(stored) == set(STORED)
    assert {field for cycles in stored.values() for values in cycles.values() for field in values} == set(FIELDS)
    assert all(cycles for cycles in stored.values())


def test_every_profile_has_an_input():
    assert set(streams.PROFILES) == set(PROFILES)
    assert not any(" " in name for name in (*STREAMS, *CLOSED))


def test_the_walk_sees_what_is_within_and_what_is_optional():
    places = set(leaves(ControlStep))
    assert {"stamp", "contact.axes", "qp.outcome", "touched.sigma", "thresholds.upper"} <= places
    assert not places & {"contact", "qp", "touched"}


def test_inputs_are_rounded_and_the_same_each_time():
    for a, b in zip(*([STREAMS["course/paper"].script().inputs(i) for i in (0, 240)] for _ in range(2)), strict=True):
        assert a.robot.tau_ext.tobytes() == b.robot.tau_ext.tobytes()
        assert np.array_equal(a.robot.tau_ext, np.round(a.robot.tau_ext, 9))
