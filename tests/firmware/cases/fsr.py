"""A force-sensing resistor on a pin, and a unit that has one."""

from fake_unit import FakeUnit
from fsr import ForceResistor

TOUCH = 128
SECOND = 1_000_000
UNTOUCHED_MV = 300


class _Pin:
    """The voltage at a pin of a sensor with 33 kOhm across it and 3.3 kOhm to ground."""

    def __init__(self):
        self.us = 0
        self.broken = False

    def mv(self):
        if self.broken:
            return 2
        conductance = 1 / 33_000 + self.us / 1_000_000
        return round(3300 * 3300 / (3300 + 1 / conductance))

    def press(self, newtons):
        """With 10 mN by uS."""
        self.us = 1000 * newtons / 10


def _sensor():
    pin = _Pin()
    return ForceResistor(pin.mv, 3300, 10, 500), pin


def the_divider_by_hand():
    """3.3 V * 3.3 kOhm / 36.3 kOhm untouched; at 100 uS more 1 / 130.3 uS = 7.67 kOhm: 3.3 V * 3.3 / 10.97."""
    pin = _Pin()
    assert pin.mv() == UNTOUCHED_MV
    pin.us = 100
    assert pin.mv() == 992


def forces_are_told_within_some_per_cent():
    sensor, pin = _sensor()
    for newtons in (0, 0.3, 1, 3, 8):
        pin.press(newtons)
        sensor.look()
        assert abs(sensor.mn - 1000 * newtons) <= 20 + 25 * newtons, (newtons, sensor.mn)
        assert not sensor.failed


def beyond_the_range_of_the_converter_the_force_stays_the_same():
    sensor, pin = _sensor()
    told = []
    for newtons in (9, 20, 100):
        pin.press(newtons)
        sensor.look()
        told.append(sensor.mn)
    assert told[1] == told[2] >= told[0] > 8000, told
    assert sensor.touched


def a_touch_begins_at_the_smallest_force_and_ends_well_below_it():
    sensor, pin = _sensor()
    course = []
    for newtons in (0, 0.45, 0.55, 0.45, 0.37, 0.3, 0.45, 0.55):
        pin.press(newtons)
        changed = sensor.look()
        course.append((sensor.touched, changed))
    assert [touched for touched, _ in course] == [False, False, True, True, True, False, False, True]
    assert [changed for _, changed in course] == [False, False, True, False, False, True, False, True]


def a_broken_lead_is_a_failure_and_no_touch():
    sensor, pin = _sensor()
    pin.press(2)
    sensor.look()
    assert sensor.touched
    pin.broken = True
    assert sensor.look()
    assert sensor.failed
    assert not sensor.touched
    assert not sensor.look()
    pin.broken = False
    assert sensor.look()
    assert not sensor.failed


def _unit():
    sensor, pin = _sensor()
    unit = FakeUnit(touch=sensor)
    unit.run(SECOND)
    return unit, pin


def a_unit_tells_its_touch_with_each_sample():
    unit, pin = _unit()
    samples = unit.run(SECOND)
    assert 49 <= len(samples) <= 51
    assert all(s["flags"] & TOUCH for s in samples)
    assert {s["touch"][:4] for s in samples} == {(0, 0, UNTOUCHED_MV, samples[0]["touch"][3])}
    pin.press(2)
    contact, status, raw, force, age = unit.run(SECOND)[-1]["touch"]
    assert (contact, status) == (1, 0)
    assert raw > UNTOUCHED_MV
    assert abs(force - 2000) < 100
    assert age < 5_000


def a_touch_is_told_within_11_ms():
    unit, pin = _unit()
    for wait in range(0, 20_000, 3_000):
        pin.press(0)
        unit.run(SECOND // 2 + wait)
        pin.press(2)
        began = unit.now.now_us
        first = next(s for s in unit.run(SECOND // 10) if s["touch"][0])
        assert first["time_us"] - began <= 11_500, (wait, first["time_us"] - began)


def a_broken_sensor_is_told_as_such():
    unit, pin = _unit()
    pin.broken = True
    contact, status, raw, force, _ = unit.run(SECOND)[-1]["touch"]
    assert (contact, status, raw, force) == (0, 1, 2, 0xFFFFFFFF)
