"""What is said to be wrong with a unit: each by traffic that has it, and only it."""

from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from pretouch.types import RangeStatus
from pretouch.units.findings import findings
from pretouch.units.health import HealthParams, unit_health
from pretouch.units.wire import NO_FORCE, Flag, TouchPart
from tests.units.traffic import BEFORE, NOW, counts, heard, traffic

WELL = int(Flag.RANGE_NEW)
LATE = int(Flag.RANGE_NEW | Flag.RANGE_LATE)
SILENT = {"state": "silent", "last_arrival": NOW - 2.0}


def found(samples, counted=None, machine_late=0.0, **known):
    unit = unit_health(samples, NOW, traffic(**(counted or {}), **known), BEFORE)
    return findings([unit], HealthParams(), machine_late)


def without_clock(seconds=10.0):
    return [replace(one, stamp=np.nan, offset=np.nan, bound=np.inf) for one in heard(seconds)]


def wide(number):
    return round(500 + np.random.default_rng(number).normal(scale=40.0))


def touched(told):
    """Traffic of a unit whose touch sensor tells contact, status and force as a function of the sample's number."""
    return heard(flags=WELL | 128, touch=lambda n: TouchPart(*told(n)[:2], 900, told(n)[2], 0).encode())


FAULTS = [
    (lambda: found([], state="never heard", last_arrival=-np.inf), "silent", "nothing so far"),
    (lambda: found([], state="greeting", last_arrival=-np.inf), "silent", "asks for a session"),
    (lambda: found(heard(until=NOW - 2.0), **SILENT), "silent", "nothing for 2.0 s (limit 0.3 s)"),
    (lambda: found(heard(range_mm=312), stuck=True), "stuck", "repeats 0.312 m"),
    (lambda: found(heard(flags=lambda n: WELL * (n % 10 == 0))), "rate", "readings a second (limit 10)"),
    (lambda: found(heard(), counts(340, 160)), "loss", "loses 32% of its samples"),
    (lambda: found(without_clock(), bound=np.inf), "clock", "clock has been unknown for 10 s (limit 2 s)"),
    (lambda: found(heard(range_status=10)), "status", "fails in 100% of its readings (500 SYNC; limit 50%)"),
    (lambda: found(heard(battery_mv=3250)), "battery", "at 3.25 V (limit 3.3 V)"),
    (lambda: found(heard(temperature_cdeg=9000)), "temperature", "90 degrees C (limit 85)"),
]
WARNINGS = [
    (lambda: found(heard(flags=lambda n: WELL * (n % 2))), "rate", "readings a second (limit 34)"),
    (lambda: found(heard(), counts(424, 76)), "loss", "loses 15.2% of its samples in transmission (limit 15%)"),
    (lambda: found(heard(latency=0.09)), "latency", "in the median 90 ms (limit 80 ms)"),
    (lambda: found(heard(), bound=0.02), "clock", "known only to within 20.0 ms (limit 10 ms)"),
    (lambda: found(heard(), bound=0.01004), "clock", "known only to within 10.04 ms (limit 10 ms)"),
    (lambda: found(heard(), counts(500, 0, 0, 2)), "clock jump", "jumped 2 times"),
    (lambda: found(heard(range_sigma=61)), "sigma", "at 15.2 mm (limit 15 mm)"),
    (lambda: found(heard(range_mm=wide)), "noise", "from reading to reading (limit 20 mm)"),
    (lambda: found(heard(range_status=lambda n: 5 * (n % 4 == 0))), "status", "readings (125 HARDWARE; limit 10%)"),
    (lambda: found(heard(range_status=lambda n: (77, 254, 0, 0)[n % 4])), "status", "readings (125 77, 125 STUCK; "),
    (lambda: found(touched(lambda _: (1, 0, 2000))), "touch held", "has reported a touch for 10 s (limit 9 s)"),
    (lambda: found(touched(lambda n: (0, n % 4 == 0, NO_FORCE))), "touch failed", "in 25% of its readings (limit 10%)"),
    (lambda: found(heard(flags=lambda n: LATE if n % 100 == 0 else WELL)), "range late", "5 times in 10 s (limit 3)"),
    (lambda: found(heard(battery_mv=3499)), "battery", "at 3.499 V (limit 3.5 V)"),
    (lambda: found(heard(temperature_cdeg=6500)), "temperature", "65 degrees C (limit 60)"),
    (lambda: found(heard(temperature_cdeg=-2500)), "temperature", "-25 degrees C (limit -20)"),
    (lambda: found(heard(bus_errors=lambda n: n // 100)), "bus", "failed transfers on its bus"),
    (lambda: found(heard(imu_index=lambda n: 2 * n, imu_count=2)), "imu rate", "gives 100 IMU"),
    (lambda: found(heard(imu_count=0)), "imu rate", "gives 0 IMU samples a second (limit 375)"),
    (lambda: found(heard(imu_index=lambda n: 10 * n)), "imu loss", "loses 20% of its IMU"),
    (lambda: found(heard(), counts(500, 0, 1), reset=3), "reboot", "its watchdog ended a hang"),
]
CASES = [("fault", *case) for case in FAULTS] + [("warning", *case) for case in WARNINGS]


def test_each_status_is_that_of_a_sensor_that_works_or_of_one_that_failed():
    well = {"OK", "NO_WRAP_CHECK", "MERGED", "MIN_RANGE", "MIN_CLIPPED", "SIGMA", "SIGNAL", "OUT_OF_BOUNDS", "WRAPPED"}
    failed = {status.name for status in RangeStatus if found(heard(range_status=int(status)))}
    assert (failed & well, failed | well) == (set(), {status.name for status in RangeStatus})


@pytest.mark.parametrize(("level", "make", "what", "words"), CASES)
def test_each_trouble_is_named_with_as_many_digits_as_it_takes_and_nothing_else(level, make, what, words):
    (finding,) = make()
    assert (finding.unit, finding.level, finding.what) == ("hand-1", level, what)
    assert words in finding.sentence
    assert finding.sentence.startswith("hand-1")
    assert finding.sentence.endswith(".")
    assert ":" in finding.sentence  # and what to do


@pytest.mark.parametrize(
    "make",
    [
        lambda: found(heard()),
        lambda: found(heard(1.0, imu_count=0, latency=0.3)),  # has not settled
        lambda: found(heard(1.0, flags=LATE)),
        lambda: found(heard(flags=lambda n: LATE if n % 250 == 0 else WELL)),
        lambda: found(touched(lambda n: (n % 50 > 0, 0, 2000))),
        lambda: found([*heard(9.0, until=NOW - 1.0), *without_clock(1.0)], bound=np.inf),  # its clock has begun anew
        lambda: found([*heard(2.0, until=NOW - 8.0), *heard(2.0)]),  # was silent between
        lambda: found([replace(one, stamp=one.stamp - 0.3 * (i % 40 == 0)) for i, one in enumerate(heard())]),
        lambda: found(heard(), machine_late=9.0),
    ],
)
def test_what_is_well_or_too_early_to_judge_is_not_named(make):
    assert make() == ()


def test_rate_and_clock_are_not_judged_while_the_window_holds_a_reboot():
    slow = heard(flags=lambda n: WELL * (n % 2))
    assert [f.what for f in found(slow, counts(500, 0, 1), bound=0.02)] == ["reboot"]
    assert [f.what for f in found(slow, bound=0.02)] == ["rate", "clock"]


def test_a_healthy_unit_on_a_lossy_network_is_not_warned_of_again_and_again():
    samples, lost = heard(), np.random.default_rng(1).binomial(500, 0.1, size=200)
    assert not [n for n in lost if found(samples, counts(500 - n, n))]


def test_faults_come_before_warnings():
    told = found(heard(battery_mv=3200, range_sigma=100))
    assert [f.level for f in told] == ["fault", "warning"]


def test_a_machine_that_is_late_is_named_first_and_its_units_not_blamed():
    slow = heard(flags=lambda n: WELL * (n % 10 == 0), range_sigma=80, latency=0.09)
    assert {f.what for f in found(slow, counts(340, 160), 0.5)} == {"rate", "loss", "latency", "sigma"}
    machine, sigma = found(slow, counts(340, 160), 1.26)
    assert (machine.unit, machine.level, machine.what) == ("this machine", "fault", "machine")
    assert machine.sentence.startswith(
        "This machine is late, by 1.3 s of the last 10 s (limit 0.5 s), so that hand-1 cannot be judged: close other"
    )
    assert sigma.what == "sigma"


def test_a_unit_that_is_silent_is_named_behind_a_machine_that_is_late():
    machine, silent = found(heard(until=NOW - 2.0), None, 1.0, **SILENT)
    assert (machine.what, silent.what) == ("machine", "silent")


def test_every_limit_is_documented():
    text = (Path(__file__).parents[2] / "docs" / "reference" / "health.md").read_text()
    for f in fields(HealthParams):
        (row,) = (line for line in text.splitlines() if line.startswith(f"| `{f.name}` |"))
        assert row.split("|")[2].split()[0] == f"{f.default:g}", row
