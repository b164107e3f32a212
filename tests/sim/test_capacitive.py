"""An electrode in a simulated room: nearer, larger and grounded things give more; its baseline drifts."""

from itertools import pairwise

import mujoco
import numpy as np
import pytest

from pretouch.sensing.sensor import Capacitive, cone_rays
from pretouch.sim.capacitive import DIELECTRIC, DRIFT, ELECTRODE_M, LEAST, RINGS, Electrode, field, told
from pretouch.sim.rays import geoms_of
from pretouch.types import RangeStatus

SENSOR = Capacitive()


def room(distance, in_the_world=False, half=5.0):
    """An electrode that looks along z, before a slab."""
    slab = f'<geom type="box" size="{half} {half} 0.5" pos="0 0 {distance + 0.5}"/>'
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><worldbody><body><geom size="0.001"/></body>{slab if in_the_world else f"<body>{slab}</body>"}'
        "</worldbody></mujoco>"
    )
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return model, data


def felt(distance, sensor=SENSOR, **kind):
    model, data = room(distance, **kind)
    return field(1, np.eye(4), cone_rays(RINGS, sensor.angle), data.xpos, data.xmat, geoms_of(model, data), 20.0)


def test_a_wall_is_felt_as_the_sum_over_the_field_lines_says():
    distance, narrow = 0.1, Capacitive(field_of_view_deg=1.0)
    # all lines of a narrow field are as long as the axis
    assert felt(distance, narrow) == pytest.approx(ELECTRODE_M / (ELECTRODE_M + distance), rel=1e-3)
    assert felt(1e-6) == pytest.approx(1.0, rel=1e-3)


def test_what_is_farther_smaller_or_no_conductor_is_felt_less():
    signals = [felt(distance) for distance in (0.02, 0.05, 0.1, 0.2)]
    assert all(a > b for a, b in pairwise(signals))
    assert felt(0.1, half=0.04) < 0.5 * felt(0.1)
    assert felt(0.1, in_the_world=True) == pytest.approx(DIELECTRIC * felt(0.1))


def test_what_presses_on_the_electrode_is_a_touch():
    assert felt(-0.3) == pytest.approx(1.0)


def test_a_unit_tells_what_its_map_makes_of_a_signal():
    at = 0.08
    distance, status, sigma, signal = told(SENSOR, SENSOR.signal(at))
    assert distance == pytest.approx(at)
    assert status == RangeStatus.OK
    assert sigma == pytest.approx(SENSOR.spread_1 * at)
    assert signal == SENSOR.signal(at)
    assert told(SENSOR, 0.9 * LEAST)[1] == RangeStatus.SIGNAL
    assert told(SENSOR, -1.0)[:2] == (0.0, RangeStatus.SIGNAL)
    assert told(SENSOR, 10.0)[:2] == (0.0, RangeStatus.MIN_RANGE)
    assert told(SENSOR, SENSOR.signal(1.01 * SENSOR.farthest_m))[1] == RangeStatus.SIGNAL


def test_the_baseline_drifts_as_far_as_is_said():
    model, data = room(5.0)
    electrode = Electrode(SENSOR, 1, np.eye(4), data, geoms_of(model, data), np.random.default_rng(0))
    signals = np.array([electrode.measure(100.0 * k, 0.0)[3] for k in range(2000)])
    assert signals.std() == pytest.approx(DRIFT, rel=0.1)
    close = np.array([electrode.measure(3e5 + 0.01 * k, 0.0)[3] for k in range(100)])
    assert np.abs(np.diff(close)).max() < 0.2 * DRIFT
