"""Instants of IMU samples that came from simulated units over a lossy network, through a recording."""

import numpy as np
import pytest

from pretouch.calibration.stamps import by_time
from pretouch.control.path import Circle
from pretouch.robot.postures import brought_to
from pretouch.sim.imu import ImuParams, Imus
from pretouch.sim.plant import Plant
from pretouch.sim.plant_params import PlantParams
from pretouch.sim.range_finder import RangeFinderParams
from pretouch.sim.scene import SceneSpec
from pretouch.units.fleet import ChannelParams, FleetParams, NetworkParams
from pretouch.units.skin_recording import SkinRecording, read_skin
from tests.wire_skin import WireSkin

EVEN = ChannelParams(delay_s=0.0012, jitter_s=0.0012, jitter_shape=2.0)
"""As fast one way as the other: what remains of the clocks' offset is not the network's, which nobody could know."""
LOSSY = ChannelParams(loss=0.3, delay_s=0.0012, jitter_s=0.003, overtaken=0.02, doubled=0.02)


def recorded(place, model, skin, network, duration, reboot_every):
    """Record units on an arm at rest.

    Return the true instants of each unit's samples by their counts, which noise makes almost all different; and how
    often units booted.
    """
    plant = Plant(model, SceneSpec(), PlantParams(), brought_to(model, Circle().point(0.0)), 0)
    params = FleetParams(network, imu=ImuParams(), reboot_every_s=reboot_every)
    true = [{} for _ in skin.ids]
    with WireSkin(plant, skin, RangeFinderParams(), params, 0) as units, SkinRecording(place) as recording:
        Imus(
            plant, skin, ImuParams(), 0, lambda s: true[s.unit].setdefault(tuple(s.counts.tolist()), []).append(s.time)
        )
        for _ in range(round(duration / 0.1)):
            plant.advance(0.1)
            recording.add(units.receiver.take_samples(), skin.ids)
        reboots = sum(unit.reboots for unit in units.receiver.units)
    return true, reboots


def instants_of_samples(place, ids, true):
    """Yield what was found for each unit, the true instants of its samples, and its samples."""
    found = read_skin(place)
    lsb = 1e-3 * np.repeat((np.deg2rad(17.5), 0.122 * 9.80665), 3)
    for name, by_counts in zip(ids, true, strict=True):
        imu = found.units[name].imu
        counts = np.round(np.hstack([imu.angular_velocity, imu.acceleration]) / lsb).astype(int)
        truth = [
            min(by_counts[tuple(row)], key=lambda instant: abs(instant - stamp))
            for row, stamp in zip(counts.tolist(), imu.stamp.tolist(), strict=True)
        ]
        yield np.array(truth), imu


@pytest.mark.slow
def test_instants_are_as_steady_as_the_sensors_though_a_third_is_lost_and_units_boot(tmp_path, panda_model, paper_skin):
    place = tmp_path / "units.mcap"
    true, reboots = recorded(place, panda_model, paper_skin, NetworkParams(LOSSY, EVEN), 12.0, 7.0)
    assert reboots >= 5
    for truth, imu in instants_of_samples(place, paper_skin.ids, true):
        known = np.isfinite(imu.stamp)
        assert known.mean() > 0.8
        error = imu.stamp[known] - truth[known]
        # the simulated network moves in steps of 1 ms, up later than down: half a step of every offset
        assert abs(error.mean() + 5e-4) < 1e-4
        assert np.ptp(error) < 2e-4
        trace = by_time(imu)
        np.testing.assert_array_equal(trace.stamp, np.sort(imu.stamp[known]))
        assert trace.acceleration.shape == trace.angular_velocity.shape == (known.sum(), 3)
