"""Simulated units whole: IMU samples come once, late, and a datagram at a time; vibration has the size asked for."""

import numpy as np
import pytest

from pretouch.sim.imu import ImuParams
from pretouch.sim.plant import Plant
from pretouch.sim.plant_params import PlantParams
from pretouch.sim.range_finder import RangeFinderParams
from pretouch.sim.scene import SceneSpec
from pretouch_lab.studies.impacts.units import DATAGRAM_S, UnitsWithImus


def units(model, skin, imu, **radio):
    plant = Plant(model, SceneSpec(), PlantParams(), model.description.q_ready, 3)
    return plant, UnitsWithImus(plant, skin, RangeFinderParams(**radio), imu, 3)


def listened(plant, skin, seconds):
    """Give the samples of each 10 ms, with the time they came."""
    for _ in range(round(seconds / 0.01)):
        plant.advance(0.01)
        yield plant.time, skin.imu()


def test_each_sample_comes_once_in_order_and_late(panda_model, paper_skin):
    plant, skin = units(panda_model, paper_skin, ImuParams(), dropout=0.0, jitter_s=0.0)
    came = list(listened(plant, skin, 1.0))
    for u in range(len(paper_skin)):
        stamps = np.concatenate([imu.stamp[imu.unit == u] for _, imu in came])
        assert len(np.unique(stamps)) == len(stamps)
        assert np.all(np.diff(stamps) > 0)
        assert len(stamps) == pytest.approx(416.0 * (1.0 - 0.008 - DATAGRAM_S / 2), rel=0.06)
    age = np.concatenate([time - imu.stamp for time, imu in came])
    assert age.min() >= 0.008
    assert age.max() <= 0.008 + DATAGRAM_S + 0.01 + 0.003
    assert len(skin.read().stamp) == len(paper_skin)


def test_what_is_lost_is_lost_by_the_datagram(panda_model, paper_skin):
    plant, skin = units(panda_model, paper_skin, ImuParams(), dropout=0.3)
    stamps = np.sort(np.concatenate([imu.stamp[imu.unit == 0] for _, imu in listened(plant, skin, 2.0)]))
    gaps = np.diff(stamps)
    long = gaps[gaps > 0.004]
    assert len(long) > 5
    assert np.all(long > DATAGRAM_S - 0.004)


def test_vibration_has_the_size_that_is_asked_for(panda_model, paper_skin):
    spreads = []
    for size in (0.0, 0.3):
        plant, skin = units(panda_model, paper_skin, ImuParams(vibration_m_s2=size, acceleration_noise_ug=0.0))
        came = [imu for time, imu in listened(plant, skin, 6.0) if time > 2.0]
        values, unit = (np.concatenate([getattr(i, name) for i in came]) for name in ("acceleration", "unit"))
        spreads.append(np.array([values[unit == u].std(axis=0) for u in range(len(paper_skin))]))
    added = np.sqrt(np.maximum(spreads[1] ** 2 - spreads[0] ** 2, 0.0))
    assert added.mean() == pytest.approx(0.3, rel=0.1)
