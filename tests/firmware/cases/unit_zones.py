"""A unit whose range finder has zones. Runs in both interpreters."""

import os
import sys

import fake_vl53l5cx
from fake_unit import FakeUnit

os.chdir(sys.path[0])
SECOND = 1_000_000


def _made(zones=4):
    with open("vl53l5cx.bin", "wb") as file:
        file.write(fake_vl53l5cx.FILE)
    return FakeUnit(zones=zones)


def _measured(samples):
    return [s for s in samples if s["flags"] & 1]


def each_zone_of_a_new_range_is_told():
    for side, least in ((4, 55), (8, 14)):
        unit = _made(side)
        unit.run(6 * SECOND)
        samples = unit.run(SECOND)
        new = _measured(samples)
        assert len(new) >= least, len(new)
        assert all(bool(s["zones"]) == bool(s["flags"] & 1) for s in samples)
        assert {len(s["zones"]) for s in new} == {2 + 5 * side * side}
        assert not any(s["flags"] & 64 for s in samples), "late"


def the_fields_of_the_range_are_of_the_nearest():
    unit = _made()
    unit.run(6 * SECOND)
    unit.vl53l5cx.target = lambda us: [(255, 0, 0, 0, 0)] * 5 + [(5, 1, 4000, 128, 0)] + [(5, 1, 8000, 128, 0)] * 10
    unit.run(SECOND // 10)
    assert {(s["status"], s["mm"]) for s in _measured(unit.run(SECOND))} == {(0, 1009)}


def lost_power_is_told_and_begun_anew():
    unit = _made()
    unit.run(6 * SECOND)
    unit.vl53l5cx.power_off()
    unit.run(SECOND)
    unit.vl53l5cx.power_on()
    samples = unit.run(10 * SECOND)
    assert any(s["flags"] & 16 for s in samples)
    assert len(_measured(samples[-50:])) > 30


def a_unit_without_its_program_goes_on_without_ranges():
    unit = _made()
    os.remove("vl53l5cx.bin")
    unit.run(2 * SECOND)
    samples = unit.run(SECOND)
    assert samples
    assert not _measured(samples)
    assert all(s["flags"] & 2 for s in samples)
