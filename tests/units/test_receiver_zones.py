"""Zones at the receiver: those of the skin are rows of readings, others are none and are named."""

import math
from dataclasses import asdict
from struct import pack

import numpy as np
import pytest

from pretouch.sensing.unit import NetworkUnits
from pretouch.types import RangeStatus
from pretouch.units.findings import findings
from pretouch.units.health import HealthParams, UnitWindow
from pretouch.units.skin import SharedOutputs, Traffic
from pretouch.units.wire import Flag, TouchPart
from tests.units.fake_unit import IDS, Bench, imu_taken

UNITS = NetworkUnits(IDS, (2, 1))
"""Rows 0 to 3, and 4."""
ZONED = int(Flag.RANGE_NEW | Flag.ZONES)


def zones(side: int, *mm: int, status: int = 0) -> bytes:
    return bytes([side, 0]) + b"".join(pack("<HHB", one, 8, status) for one in mm)


@pytest.fixture
def bench():
    with Bench(units=UNITS) as made:
        made.greet(*made.units)
        yield made


def test_a_range_with_zones_is_a_row_for_each(bench):
    zoned, plain = bench.units
    part = zones(2, 100, 200, 65535, 400, status=5)
    touch = TouchPart(1, 0, 0, 2500, 1000).encode()
    datagram = zoned.sample(bench.now, flags=ZONED | Flag.TOUCH, zones=part, touch=touch, range_mm=100)
    assert bench.send(datagram, plain.sample(bench.now, range_mm=321)) == 2
    readings = bench.receiver.readings()
    assert readings.distance == pytest.approx([0.1, 0.2, 65.535, 0.4, 0.321])
    assert readings.status.tolist() == [5, 5, 5, 5, 0]
    assert len(set(readings.stamp[:4])) == 1
    assert bench.receiver.touch().contact.tolist() == [True, False, False, False, False]
    assert [(batch.unit, len(batch.stamp)) for batch in imu_taken(bench.receiver)] == [(0, 2), (1, 2)]


def test_zones_without_a_new_range_are_no_reading(bench):
    assert bench.send(bench.units[0].sample(bench.now, flags=int(Flag.ZONES), zones=zones(2, 1, 2, 3, 4))) == 1
    assert set(bench.receiver.readings().status) == {RangeStatus.NONE}


@pytest.mark.parametrize(
    ("unit", "changes", "what"),
    [
        (0, {}, "unit 3 sends a single range, but the skin file has 2 x 2 zones"),
        (0, {"flags": ZONED, "zones": zones(1, 100)}, "unit 3 sends a single range"),
        (0, {"flags": ZONED, "zones": zones(3, *[100] * 9)}, "unit 3 sends 3 x 3 zones, but the skin file has 2 x 2"),
        (
            1,
            {"flags": ZONED, "zones": zones(2, *[100] * 4)},
            "unit 4 sends 2 x 2 zones, but the skin file has a single",
        ),
    ],
)
def test_other_zones_than_the_skins_are_no_reading_and_are_named(bench, unit, changes, what):
    for _ in range(20):
        bench.now += 0.02
        assert bench.send(bench.units[unit].sample(bench.now, **changes)) == 1
    assert set(bench.receiver.readings().status) == {RangeStatus.NONE}
    traffic, heard = bench.receiver.units[unit], bench.receiver.take_samples()
    assert traffic.misfits == 20
    assert all(math.isnan(one.stamp) for one in heard)
    window = UnitWindow(10.0)
    window.take(bench.now, heard, traffic)
    found = findings([window.health(bench.now, traffic)], HealthParams())
    assert [(f.level, f.sentence[: len(what)]) for f in found if f.what == "zones"] == [("fault", what)]


def test_a_reading_before_a_misfit_grows_old(bench):
    zoned = bench.units[0]
    good = zones(2, 100, 200, 300, 400)
    bench.send(zoned.sample(bench.now, flags=ZONED, zones=good))
    stamp = bench.receiver.readings().stamp[0]
    bench.now += 0.02
    bench.send(zoned.sample(bench.now, flags=ZONED, zones=zones(3, *[7] * 9)))
    assert bench.receiver.readings().stamp[0] == stamp
    assert bench.receiver.readings().distance[:4] == pytest.approx([0.1, 0.2, 0.3, 0.4])


def test_zones_that_repeat_are_stuck_and_one_that_changes_is_not(bench):
    zoned = bench.units[0]
    for moving in (True, False):
        for k in range(80):
            bench.now += 0.02
            part = zones(2, 100, 100, 100, 100 + k % 7 * moving)
            bench.send(zoned.sample(bench.now, flags=ZONED, zones=part, range_mm=100))
            bench.deliver()
        wanted = RangeStatus.OK if moving else RangeStatus.STUCK
        assert bench.receiver.readings().status[:4].tolist() == [wanted] * 4


def test_samples_with_zones_come_through_shared_memory_however_large(bench):
    outputs = SharedOutputs(UNITS, Traffic((), {}, 0))
    zoned, plain = bench.units
    eight = b"\x08\x00" + bytes(5 * 64)
    for datagram in (
        zoned.sample(bench.now, flags=ZONED, zones=zones(2, 100, 200, 300, 400), imu=b"0123456789ab" * 2),
        plain.sample(bench.now, flags=ZONED | Flag.TOUCH, zones=eight, touch=bytes(12), imu_count=32, imu=bytes(384)),
    ):
        bench.send(datagram)
        (arrival,) = bench.receiver.take_samples()
        bench.receiver._arrivals.append(arrival)
        outputs.put(bench.receiver)
        (back,) = outputs.take_samples()
        np.testing.assert_equal(asdict(back), asdict(arrival))  # of zones that do not fit the stamp is NaN
    assert outputs.table.read()[:4, 1] == pytest.approx([0.1, 0.2, 0.3, 0.4])
