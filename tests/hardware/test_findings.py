"""What is said to be wrong with a unit: each by traffic that has it, and only it."""

from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from pretouch.errors import ParameterError
from pretouch.hardware.findings import findings
from pretouch.hardware.health import Counts, HealthParams, UnitStatus, unit_health
from pretouch.hardware.wire import NO_FORCE, Flag, TouchPart
from tests.hardware.traffic import NOW, heard, traffic

LIMITS = HealthParams()
WELL = int(Flag.RANGE_NEW)


def found(samples, counted=None, **standing):
    unit = unit_health("hand-1", samples, NOW, UnitStatus.of(traffic(**standing)), counted or Counts(500))
    return findings([unit], LIMITS)


def without_clock():
    return [replace(one, stamp=np.nan, offset=np.nan, bound=np.inf) for one in heard()]


def wide(number):
    return round(500 + np.random.default_rng(number).normal(scale=40.0))


CASES = {
    "never heard": (lambda: found([], state="never heard", last_arrival=-np.inf), "fault", "silent", "nothing so far"),
    "greeting": (lambda: found([], state="greeting", last_arrival=-np.inf), "fault", "silent", "asks for a session"),
    "silent": (
        lambda: found(heard(until=NOW - 2.0), state="silent", last_arrival=NOW - 2.0), "fault", "silent",
        "nothing for 2.0 s (limit 0.3 s)",
    ),
    "stuck": (lambda: found(heard(range_mm=312), stuck=True), "fault", "stuck", "repeats 0.312 m"),
    "slow": (
        lambda: found(heard(flags=lambda n: WELL * (n % 2))), "warning", "rate", "readings a second (limit 34)"
    ),
    "very slow": (
        lambda: found(heard(flags=lambda n: WELL * (n % 10 == 0))), "fault", "rate", "readings a second (limit 10)"
    ),
    "lossy": (lambda: found(heard(), Counts(400, 100)), "warning", "loss", "loses 20% of its samples"),
    "hardly lossy": (
        lambda: found(heard(), Counts(424, 76)), "warning", "loss",
        "loses 15.2% of its samples in transmission (limit 15%)",
    ),
    "very lossy": (lambda: found(heard(), Counts(340, 160)), "fault", "loss", "loses 32% of its samples"),
    "late": (lambda: found(heard(latency=0.07)), "warning", "latency", "in the median 70 ms (limit 50 ms)"),
    "clock": (lambda: found(heard(), bound=0.02), "warning", "clock", "known only to within 20.0 ms (limit 10 ms)"),
    "clock never known": (
        lambda: found(without_clock(), bound=np.inf), "fault", "clock", "clock has been unknown for 10 s (limit 2 s)"
    ),
    "jumps": (lambda: found(heard(), Counts(500, 0, 0, 2)), "warning", "clock jump", "jumped 2 times"),
    "sigma": (lambda: found(heard(range_sigma=80)), "warning", "sigma", "own error at 20 mm (limit 15 mm)"),
    "noise": (lambda: found(heard(range_mm=wide)), "warning", "noise", "from reading to reading (limit 20 mm)"),
    "failing": (
        lambda: found(heard(range_status=lambda n: 5 if n % 4 == 0 else 0)), "warning", "status",
        "fails in 25% of its readings (125 HARDWARE; limit 10%)",
    ),
    "failed": (lambda: found(heard(range_status=10)), "fault", "status", "fails in 100% of its readings"),
    "unknown statuses": (
        lambda: found(heard(range_status=lambda n: (77, 254, 0, 0)[n % 4])), "warning", "status",
        "fails in 50% of its readings (125 77, 125 STUCK; limit 10%)",
    ),
    "touched for long": (
        lambda: found(heard(flags=WELL | 128, touch=TouchPart(1, 0, 900, 2000, 0).encode())), "warning", "touch held",
        "has reported a touch for 10 s (limit 9 s)",
    ),
    "touched now and then": (
        lambda: found(heard(flags=WELL | 128, touch=lambda n: TouchPart(n % 50 > 0, 0, 900, 2000, 0).encode())), None,
        "", "",
    ),
    "touch sensor broken": (
        lambda: found(heard(flags=WELL | 128, touch=lambda n: TouchPart(0, n % 4 == 0, 2, NO_FORCE, 0).encode())),
        "warning", "touch failed", "touch sensor fails in 25% of its readings (limit 10%)",
    ),
    "range late": (
        lambda: found(heard(flags=lambda n: WELL | (64 if n % 100 == 0 else 0))), "warning", "range late",
        "no new range in time 5 times in 10 s (limit 3)",
    ),
    "battery low": (lambda: found(heard(battery_mv=3450)), "warning", "battery", "at 3.45 V (limit 3.5 V)"),
    "battery flat": (lambda: found(heard(battery_mv=3250)), "fault", "battery", "at 3.25 V (limit 3.3 V)"),
    "warm": (lambda: found(heard(temperature_cdeg=6500)), "warning", "temperature", "65 degrees C (limit 60)"),
    "hot": (lambda: found(heard(temperature_cdeg=9000)), "fault", "temperature", "90 degrees C (limit 85)"),
    "cold": (lambda: found(heard(temperature_cdeg=-2500)), "warning", "temperature", "-25 degrees C (limit -20)"),
    "bus": (lambda: found(heard(bus_errors=lambda n: n // 100)), "warning", "bus", "failed transfers on its bus"),
    "imu slow": (lambda: found(heard(imu_index=lambda n: 2 * n, imu_count=2)), "warning", "imu rate", "gives 100 IMU"),
    "imu dead": (lambda: found(heard(imu_count=0)), "warning", "imu rate", "gives 0 IMU samples a second (limit 375)"),
    "imu loss": (lambda: found(heard(imu_index=lambda n: 10 * n)), "warning", "imu loss", "loses 20% of its IMU"),
    "reboot": (lambda: found(heard(), Counts(500, 0, 1), reset=3), "warning", "reboot", "its watchdog ended a hang"),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_each_trouble_is_named_and_nothing_else(case):
    make, level, what, words = CASES[case]
    told = make()
    if level is None:
        assert told == ()
        return
    (finding,) = told
    assert (finding.unit, finding.level, finding.what) == ("hand-1", level, what)
    assert words in finding.sentence
    assert finding.sentence.startswith("hand-1")
    assert finding.sentence.endswith(".")
    assert ":" in finding.sentence  # and what to do


def test_nothing_is_said_of_a_unit_that_is_well():
    assert found(heard()) == ()


def test_rates_are_not_judged_before_a_unit_has_settled():
    assert found(heard(1.0, imu_count=0, latency=0.3)) == ()


def test_a_range_finder_late_now_and_then_or_at_the_start_is_not_named():
    late = int(Flag.RANGE_NEW | Flag.RANGE_LATE)
    assert found(heard(flags=lambda n: late if n % 250 == 0 else WELL)) == ()
    assert found(heard(1.0, flags=late)) == ()


def test_a_clock_is_not_judged_right_after_it_began_anew():
    last = [replace(one, stamp=np.nan, offset=np.nan, bound=np.inf) for one in heard(1.0)]
    assert found([*heard(9.0, until=NOW - 1.0), *last], bound=np.inf) == ()


def test_rate_and_clock_are_not_judged_while_the_window_holds_a_silence_or_a_reboot():
    cut_off = [*heard(2.0, until=NOW - 8.0), *heard(2.0)]
    assert found(cut_off) == ()
    slow = heard(flags=lambda n: WELL * (n % 2))
    assert [f.what for f in found(slow, Counts(500, 0, 1), bound=0.02)] == ["reboot"]
    assert [f.what for f in found(slow, bound=0.02)] == ["rate", "clock"]


@pytest.mark.parametrize(
    ("standing", "changes", "words"),
    [
        ({}, {"battery_mv": 3499}, "at 3.499 V (limit 3.5 V)"),
        ({}, {"range_sigma": 61}, "at 15.2 mm (limit 15 mm)"),
        ({"bound": 0.01004}, {}, "known only to within 10.04 ms (limit 10 ms)"),
    ],
)
def test_a_value_is_told_with_as_many_digits_as_set_it_off_from_its_limit(standing, changes, words):
    (finding,) = found(heard(**changes), **standing)
    assert words in finding.sentence


def test_a_healthy_unit_on_a_lossy_network_is_not_warned_of_again_and_again():
    samples, lost = heard(), np.random.default_rng(1).binomial(500, 0.1, size=200)
    assert not [n for n in lost if found(samples, Counts(500 - n, n))]


def test_faults_come_before_warnings():
    told = found(heard(battery_mv=3200, range_sigma=100))
    assert [f.level for f in told] == ["fault", "warning"]


def test_single_late_readings_are_no_reason_for_a_warning():
    late = heard(latency=0.3)
    assert found([late[i] if i % 40 == 0 else one for i, one in enumerate(heard())]) == ()


def judged(samples, late, **standing):
    return findings(
        [unit_health("hand-1", samples, NOW, UnitStatus.of(traffic(**standing)), Counts(340, 160))], LIMITS, late
    )


def test_a_machine_that_is_late_is_named_first_and_its_units_not_blamed():
    slow = heard(flags=lambda n: WELL * (n % 10 == 0), range_sigma=80, latency=0.07)
    assert {f.what for f in judged(slow, 0.5)} == {"rate", "loss", "latency", "sigma"}
    machine, sigma = judged(slow, 1.26)
    assert (machine.unit, machine.level, machine.what) == ("this machine", "fault", "machine")
    assert machine.sentence.startswith(
        "This machine is late, by 1.3 s of the last 10 s (limit 0.5 s), so that hand-1 cannot be judged: close other"
    )
    assert sigma.what == "sigma"


def test_a_unit_that_is_silent_is_named_behind_a_machine_that_is_late():
    machine, silent = judged(heard(until=NOW - 2.0), 1.0, state="silent", last_arrival=NOW - 2.0)
    assert (machine.what, silent.what) == ("machine", "silent")


def test_a_machine_that_is_late_without_consequence_is_not_named():
    assert findings([unit_health("hand-1", heard(), NOW, UnitStatus.of(traffic()), Counts(500))], LIMITS, 9.0) == ()


@pytest.mark.parametrize("name", ["window_s", "rate_hz", "battery_v"])
def test_a_limit_that_makes_no_sense_is_refused(name):
    with pytest.raises(ParameterError, match=name):
        HealthParams(**{name: -1.0})


def test_every_limit_is_documented():
    text = (Path(__file__).parents[2] / "docs" / "reference" / "health.md").read_text()
    missing = [f.name for f in fields(HealthParams) if f"`{f.name}`" not in text]
    assert not missing
    for f in fields(HealthParams):
        (row,) = (line for line in text.splitlines() if line.startswith(f"| `{f.name}` |"))
        assert row.split("|")[2].split()[0] == f"{f.default:g}", row
