"""The arm's sensor units beside the robot's interface."""

from typing import Any

import numpy as np
import pytest

from pretouch.robot.description import panda
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import paper_skin
from pretouch.units.keys import Keys
from pretouch.units.receiver import SkinReceiver
from pretouch_fci.units import UnitsSetup

_LASTING = 600


@pytest.mark.slow
def test_in_lockstep_readings_are_the_same_to_the_last_bit(serve, raw):
    skin = paper_skin(RobotModel(panda()))
    runs = [_readings(serve, raw, skin) for _ in range(2)]
    np.testing.assert_array_equal(runs[0], runs[1])
    stamps = runs[0][-1][0]
    # the newest reading of each unit is a short time old, by the robot's own clock
    assert np.all(1000.6 - stamps < 0.1)
    assert np.all(stamps <= 1000.61)


def _readings(serve: Any, raw: Any, skin: Any) -> Any:
    """Stamps, distances and statuses (T, 3, K) after each millisecond of a motion."""
    keys, rng, now = Keys().with_new(skin.ids), np.random.default_rng([0, 8]), [0.0]
    with SkinReceiver(skin.ids, keys, clock=lambda: now[0], draw=rng.bytes) as receiver:
        served = serve(setup={"units": UnitsSetup(skin, keys, receiver.address)})
        client = raw(served)
        state, tables = client.begun(), []
        for _ in range(_LASTING):
            now[0] = 1e-3 * float(state["message_id"])
            receiver.receive()
            tables.append(receiver.table[:, :3].T.copy())
            state = client.turn(state, np.zeros(7))
        served.stop()
    return np.array(tables)
