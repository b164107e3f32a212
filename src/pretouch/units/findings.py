"""What is wrong with a unit, as sentences: unit, value, limit, and what to do."""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Literal

from pretouch.types import RangeStatus
from pretouch.units.health import HealthParams, UnitHealth
from pretouch.units.wire import Reset

_MEASURED = {s.name for s in (
    RangeStatus.OK, RangeStatus.NO_WRAP_CHECK, RangeStatus.MERGED, RangeStatus.MIN_CLIPPED, RangeStatus.MIN_RANGE,
    RangeStatus.SIGMA, RangeStatus.SIGNAL, RangeStatus.OUT_OF_BOUNDS, RangeStatus.WRAPPED,
)}  # fmt: skip
"""Statuses that say that something is there, or that nothing near is; all others are of a sensor that failed."""
_MOST_DIGITS = 4
_ENDS: dict[int, str] = {
    Reset.POWER_ON: "it was powered on: check its battery and plug",
    Reset.HARD: "its reset line was pulled: check its wiring",
    Reset.WATCHDOG: "its watchdog ended a hang: check its firmware and bus",
    Reset.SOFT: "its program restarted: check its firmware",
}

Level = Literal["fault", "warning"]


@dataclass(frozen=True)
class Finding:
    """One thing that is wrong with a unit."""

    unit: str
    level: Level
    what: str
    """A word for programs, as `rate` or `battery`."""
    sentence: str


_OF_TIME = frozenset({"rate", "range late", "loss", "imu rate", "imu loss", "latency", "clock"})
"""What a machine that is late makes of units that are well."""


def findings(units: Iterable[UnitHealth], params: HealthParams, late: float = 0.0) -> tuple[Finding, ...]:
    """Return what is wrong, unit by unit, faults first.

    Where the machine itself was `late` for longer than `machine_late_s` within the window [s], it comes first: in place
    of what may be its doing, and before units that are silent.
    """
    every = [finding for unit in units for finding in sorted(_of(unit, params), key=lambda f: f.level)]
    doubted = [finding for finding in every if finding.what in {*_OF_TIME, "silent"}]
    if late <= params.machine_late_s or not doubted:
        return tuple(every)
    names = ", ".join(dict.fromkeys(finding.unit for finding in doubted))
    sentence = (
        f"This machine is late, by {late:.1f} s of the last {params.window_s:g} s (limit {params.machine_late_s:g} s),"
        f" so that {names} cannot be judged: close other programs, or take a faster machine."
    )
    machine = Finding("this machine", min(finding.level for finding in doubted), "machine", sentence)
    return machine, *(finding for finding in every if finding.what not in _OF_TIME)


def _of(unit: UnitHealth, params: HealthParams) -> Iterator[Finding]:
    silence = _silence(unit, params)
    if silence:
        yield Finding(unit.unit, "fault", "silent", silence)
    else:
        yield from _range_finder(unit, params)
        yield from _touch_sensor(unit, params)
        if unit.heard_s >= params.settle_s:
            yield from _rates(unit, params)
            yield from _clock(unit, params)
    if unit.heard_s > 0:
        yield from _unit_itself(unit, params)


def _silence(unit: UnitHealth, params: HealthParams) -> str:
    """Say why nothing comes of a unit, or ''."""
    name, state = unit.unit, unit.standing.state
    if state == "greeting":
        return (
            f"{name} asks for a session but does not receive the answers: allow UDP to it through the firewall and the"
            " access point (no client isolation)."
        )
    if state == "never heard":
        return (
            f"{name} has sent nothing so far: check its power and Wi-Fi, and that it was provisioned with this host's"
            " address and port and with this key."
        )
    if unit.silent_s > params.silent_s:
        return (
            f"{name} has sent nothing for {unit.silent_s:.1f} s (limit {params.silent_s:g} s): check its power and its"
            " distance from the access point."
        )
    return ""


def _range_finder(unit: UnitHealth, params: HealthParams) -> Iterator[Finding]:
    if unit.standing.stuck:
        yield Finding(
            unit.unit, "fault", "stuck",
            f"{unit.unit} repeats {unit.distance_m:.3f} m to the last digit, so its range finder hangs: restart the"
            " unit, and replace the sensor if this happens again.",
        )  # fmt: skip
    zones, told = unit.standing.zones, unit.standing.zones_told
    if told not in (0, zones):
        yield Finding(
            unit.unit, "fault", "zones",
            f"{unit.unit} sends {_square(told)}, but the skin file has {_square(zones)}, so its readings are not used:"
            " set zones and type of its sensor in the skin file, or provision and flash the unit for them.",
        )  # fmt: skip
    failed = {status: count for status, count in unit.statuses.items() if status not in _MEASURED}
    if failed:
        kinds = ", ".join(f"{count} {status}" for status, count in sorted(failed.items()))
        yield from _beyond(
            unit, "status", 100 * sum(failed.values()) / sum(unit.statuses.values()),
            (100 * params.failed, 100 * params.failed_fault),
            f" fails in {{value}}% of its readings ({kinds}; limit {{limit}}%): check its wiring and supply, and"
            " replace the sensor if this continues.",
        )  # fmt: skip
    yield from _beyond(
        unit, "sigma", 1000 * unit.sigma_m, (1000 * params.sigma_m,),
        " estimates its own error at {value} mm (limit {limit} mm): clean its window, and shade it from the sun.",
    )  # fmt: skip
    yield from _beyond(
        unit, "noise", 1000 * unit.noise_m, (1000 * params.noise_m,),
        " scatters by {value} mm from reading to reading (limit {limit} mm): clean its window, and remove anything"
        " shiny or moving in front of it.",
    )  # fmt: skip


def _square(side: int) -> str:
    return f"{side} x {side} zones" if side > 1 else "a single range"


def _touch_sensor(unit: UnitHealth, params: HealthParams) -> Iterator[Finding]:
    if unit.touched == 1.0 and unit.heard_s >= params.touch_held_s:
        yield Finding(
            unit.unit, "warning", "touch held",
            f"{unit.unit} has reported a touch for {unit.heard_s:.0f} s (limit {params.touch_held_s:g} s), so its"
            " touch sensor is ignored: check that no cable or case presses on it, and calibrate it.",
        )  # fmt: skip
    yield from _beyond(
        unit, "touch failed", 100 * unit.touch_failed, (100 * params.touch_failed,),
        "'s touch sensor fails in {value}% of its readings (limit {limit}%): check its leads and the resistor across"
        " it.",
    )  # fmt: skip


_FAST = 4
_FEW_ZONES = "measure 4 x 4 zones, which is faster."
_SUPPLY = "check its wiring and supply, and its radio if samples are lost."


def _rates(unit: UnitHealth, params: HealthParams) -> Iterator[Finding]:
    if _unbroken(unit, params):
        yield from _beyond(
            unit, "rate", unit.rate_hz, (params.rate_hz, params.rate_fault_hz),
            " gives {value} readings a second (limit {limit}): "
            + (_FEW_ZONES if unit.standing.zones_told > _FAST else _SUPPLY),
            digits=1, below=True,
        )  # fmt: skip
    if unit.range_late >= params.range_late:
        yield Finding(
            unit.unit, "warning", "range late",
            f"{unit.unit} had no new range in time {unit.range_late} times in {params.window_s:g} s (limit"
            f" {params.range_late}): check its interrupt line and bus.",
        )  # fmt: skip
    yield from _beyond(
        unit, "loss", 100 * unit.loss, (100 * params.loss, 100 * params.loss_fault),
        " loses {value}% of its samples in transmission (limit {limit}%): move the access point closer, or use a free"
        " channel.",
    )  # fmt: skip
    yield from _beyond(
        unit, "imu rate", unit.imu_rate_hz, (params.imu_rate_hz,),
        " gives {value} IMU samples a second (limit {limit}): check the IMU's wiring and its rate in the firmware.",
        below=True,
    )  # fmt: skip
    yield from _beyond(
        unit, "imu loss", 100 * unit.imu_loss, (100 * params.imu_loss,),
        " loses {value}% of its IMU samples before they are sent (limit {limit}%): its loop is too slow for the IMU's"
        " rate; lower the rate in the firmware.",
    )  # fmt: skip


def _clock(unit: UnitHealth, params: HealthParams) -> Iterator[Finding]:
    over = [
        f"{kind} {_formatted(1000 * value, 1000 * limit)} ms (limit {1000 * limit:g} ms)"
        for kind, value, limit in (
            ("in the median", unit.latency_s, params.latency_s),
            ("in one of twenty readings", unit.latency_late_s, params.latency_late_s),
        )
        if value > limit
    ]
    if over:
        yield Finding(
            unit.unit, "warning", "latency",
            f"{unit.unit}'s readings arrive late, {' and '.join(over)}: move the access point closer, and switch its"
            " power saving off.",
        )  # fmt: skip
    if math.isfinite(unit.standing.bound) and _unbroken(unit, params):
        yield from _beyond(
            unit, "clock", 1000 * unit.standing.bound, (1000 * params.bound_s,),
            "'s clock is known only to within {value} ms (limit {limit} ms), because the network to it is slow or"
            " asymmetric: move the access point closer.",
            digits=1,
        )  # fmt: skip
    if unit.clock_unknown_s >= params.settle_s:
        yield Finding(
            unit.unit, "fault", "clock",
            f"{unit.unit}'s clock has been unknown for {unit.clock_unknown_s:.0f} s (limit {params.settle_s:g} s), so"
            " its readings are not used: it echoes no beacon in time; move the access point closer, and check its"
            " firmware.",
        )  # fmt: skip
    if unit.clock_jumps:
        yield Finding(
            unit.unit, "warning", "clock jump",
            f"{unit.unit}'s clock jumped {unit.clock_jumps} times in {params.window_s:g} s: its crystal or firmware is"
            " faulty; replace the board if this happens again.",
        )  # fmt: skip


def _unbroken(unit: UnitHealth, params: HealthParams) -> bool:
    """Whether the window holds neither a silence nor a reboot."""
    return unit.gap_s <= params.silent_s and not unit.reboots


def _unit_itself(unit: UnitHealth, params: HealthParams) -> Iterator[Finding]:
    yield from _beyond(
        unit, "battery", unit.battery_v, (params.battery_v, params.battery_fault_v),
        "'s battery is at {value} V (limit {limit} V): charge it.",
        digits=2, below=True,
    )  # fmt: skip
    yield from _beyond(
        unit, "temperature", unit.temperature_c, (params.temperature_c, params.temperature_fault_c),
        " is at {value} degrees C (limit {limit}): move it away from the heat source.",
    )  # fmt: skip
    yield from _beyond(
        unit, "temperature", unit.temperature_c, (params.temperature_low_c,),
        " is at {value} degrees C (limit {limit}): warm it.",
        below=True,
    )  # fmt: skip
    name = unit.unit
    if unit.bus_errors >= params.bus_errors or unit.restarts:
        yield Finding(
            name, "warning", "bus",
            f"{name} had {unit.bus_errors} failed transfers on its bus and {unit.restarts} sensor restarts in"
            f" {params.window_s:g} s (limits {params.bus_errors} and 1): check the plugs and the length of its wires.",
        )  # fmt: skip
    if unit.reboots >= params.reboots:
        yield Finding(
            name, "warning", "reboot",
            f"{name} restarted {unit.reboots} times in {params.window_s:g} s (limit {params.reboots}):"
            f" {_ENDS.get(unit.standing.reset, 'check its supply and firmware')}.",
        )  # fmt: skip


def _beyond(
    unit: UnitHealth, what: str, value: float, limits: tuple[float, ...], sentence: str, *,
    digits: int = 0, below: bool = False,
) -> Iterator[Finding]:  # fmt: skip
    """Yield a warning if a value is over, or `below`, the first limit; a fault if it is beyond the second as well.

    The sentence goes on from the unit's name, with {value} and {limit} in it.
    """
    passed = [limit for limit in limits if (value < limit if below else value > limit)]
    if passed:
        told = sentence.format(value=_formatted(value, passed[-1], digits), limit=f"{passed[-1]:g}")
        yield Finding(unit.unit, "fault" if len(passed) > 1 else "warning", what, unit.unit + told)


def _formatted(value: float, limit: float, digits: int = 0) -> str:
    """Return a value with so many digits, or as many more as set it off from its limit."""
    while digits < _MOST_DIGITS and f"{value:.{digits}f}" == f"{limit:.{digits}f}":
        digits += 1
    return f"{value:.{digits}f}"
