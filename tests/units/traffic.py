"""Traffic of one unit that is well, with what one likes changed."""

from dataclasses import replace

import numpy as np

from pretouch.units.unit import Received, UnitTraffic
from pretouch.units.wire import Flag, Sample

NOW, BOOTED = 1000.0, 400.0
PERIOD, IMU_HZ, BATCH = 0.02, 400, 8


def sample(number: int) -> Sample:
    """The sample of a number: 20 ms after the one before, with a distance that wavers by millimetres."""
    wavering = int(np.random.default_rng(number).integers(-4, 5))
    return Sample(
        unit=7, flags=int(Flag.RANGE_NEW), sequence=number, time_us=20_000 * number, beacon=number // 25,
        beacon_hold_us=1000, battery_mv=3900, temperature_cdeg=3100, bus_errors=5, range_stream=number % 128 + 128,
        range_status=0, range_mm=500 + wavering, range_age_us=9000, range_sigma=16, range_signal=800, range_ambient=20,
        range_spads=4000, imu_count=BATCH, imu_scale=0x21, imu_rate_hz=IMU_HZ, imu_index=BATCH * number, imu_age_us=500,
        imu=bytes(12 * BATCH),
    )  # fmt: skip


def heard(seconds: float = 10.0, latency: float = 0.015, until: float = NOW, **changes) -> list[Received]:
    """All samples of so many seconds up to an instant; a change is a value, or a function of the sample's number."""
    last = round((until - BOOTED) / PERIOD)
    arrived = []
    for number in range(last - round(seconds / PERIOD) + 1, last + 1):
        given = {name: change(number) if callable(change) else change for name, change in changes.items()}
        at = BOOTED + PERIOD * number
        arrived.append(Received(0, at, at - latency, BOOTED, 5e-4, replace(sample(number), **given)))
    return arrived


BEFORE = UnitTraffic("hand-1", 7)
"""What it knew before it heard of the unit."""


def counts(accepted: int = 500, lost: int = 0, reboots: int = 0, clock_jumps: int = 0) -> dict[str, int]:
    """What a receiver has counted, as changes of `traffic`."""
    return {"accepted": accepted, "lost": lost, "reboots": reboots, "clock_jumps": clock_jumps}


def traffic(**changes) -> UnitTraffic:
    """What a receiver knows of the unit when all is well."""
    well = UnitTraffic(
        "hand-1", 7, state="live", accepted=500, firmware=0x0100, reset=1, last_arrival=NOW, offset=BOOTED, bound=5e-4
    )
    return replace(well, **changes)
