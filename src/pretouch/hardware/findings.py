"""What is wrong with a unit, as sentences: unit, value, limit, and what to do."""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Literal

from pretouch.hardware.health import UnitHealth
from pretouch.hardware.health_params import HealthParams
from pretouch.hardware.wire import Reset
from pretouch.types import RangeStatus

_FAILED = tuple(s.name for s in (
    RangeStatus.HARDWARE, RangeStatus.CROSSTALK, RangeStatus.SYNC, RangeStatus.INVALID, RangeStatus.NONE
))  # fmt: skip
"""Statuses of a sensor that failed; the others say that something is there, or that nothing near is."""
_ENDS: dict[int, str] = {
    Reset.POWER_ON: "its power came on: see to its battery and plug",
    Reset.HARD: "its reset line was pulled: see to its wiring",
    Reset.WATCHDOG: "its watchdog ended a hang: see to its firmware and bus",
    Reset.SOFT: "its program began anew: see to its firmware",
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


def findings(units: Iterable[UnitHealth], params: HealthParams) -> tuple[Finding, ...]:
    """Return what is wrong, unit by unit, faults first."""
    return tuple(finding for unit in units for finding in sorted(_of(unit, params), key=lambda f: f.level))


def _of(unit: UnitHealth, params: HealthParams) -> Iterator[Finding]:
    silence = _silence(unit, params)
    if silence:
        yield Finding(unit.unit, "fault", "silent", silence)
    else:
        yield from _range_finder(unit, params)
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
            f"{name} says hello but opens no session: the answers do not reach it; let UDP to it pass the firewall and"
            " the access point (no client isolation)."
        )
    if state == "never heard":
        return (
            f"{name} has not been heard: see that it has power and Wi-Fi, and that it was provisioned with this"
            " host's address and port and with this key."
        )
    if unit.silent_s > params.silent_s:
        return (
            f"{name} has sent nothing for {unit.silent_s:.1f} s (limit {params.silent_s:g} s):"
            " see to its power and to its distance from the access point."
        )
    return ""


def _range_finder(unit: UnitHealth, params: HealthParams) -> Iterator[Finding]:
    name = unit.unit
    if unit.standing.stuck:
        yield Finding(
            name, "fault", "stuck",
            f"{name} repeats {unit.distance_m:.3f} m to the last digit: its range finder hangs; restart the unit, and"
            " replace the sensor if it comes again.",
        )  # fmt: skip
    readings = sum(unit.statuses.values())
    failed = sum(count for status, count in unit.statuses.items() if status in _FAILED)
    if readings and failed / readings > params.failed:
        level, limit = _graded(failed / readings, params.failed, params.failed_fault, above=True)
        kinds = ", ".join(f"{unit.statuses[s]} {s}" for s in _FAILED if s in unit.statuses)
        yield Finding(
            name, level, "status",
            f"{name} fails in {failed / readings:.0%} of its readings ({kinds}; limit {limit:.0%}): see to its wiring"
            " and supply, and replace the sensor if it stays.",
        )  # fmt: skip
    if unit.sigma_m > params.sigma_m:
        yield Finding(
            name, "warning", "sigma",
            f"{name} estimates its own error at {1000 * unit.sigma_m:.0f} mm (limit {1000 * params.sigma_m:g} mm):"
            " clean its window, and shade it from the sun.",
        )  # fmt: skip
    if unit.noise_m > params.noise_m:
        yield Finding(
            name, "warning", "noise",
            f"{name} scatters by {1000 * unit.noise_m:.0f} mm from reading to reading (limit"
            f" {1000 * params.noise_m:g} mm): clean its window, and see that nothing shiny or moving is before it.",
        )  # fmt: skip
    if unit.range_late:
        yield Finding(
            name, "warning", "range late",
            f"{name} had nothing measured in time {unit.range_late} times in {params.window_s:g} s: see to its"
            " interrupt line and bus.",
        )  # fmt: skip


def _rates(unit: UnitHealth, params: HealthParams) -> Iterator[Finding]:
    name = unit.unit
    if unit.rate_hz < params.rate_hz:
        level, limit = _graded(unit.rate_hz, params.rate_hz, params.rate_fault_hz, above=False)
        yield Finding(
            name, level, "rate",
            f"{name} gives {unit.rate_hz:.1f} readings a second (limit {limit:g}): see to its wiring and supply, and"
            " to its radio if samples are lost.",
        )  # fmt: skip
    if unit.loss > params.loss:
        level, limit = _graded(unit.loss, params.loss, params.loss_fault, above=True)
        yield Finding(
            name, level, "loss",
            f"{name} loses {unit.loss:.0%} of its samples on their way (limit {limit:.0%}): bring the access point"
            " nearer, or take a free channel.",
        )  # fmt: skip
    if unit.imu_rate_hz < params.imu_rate_hz:
        yield Finding(
            name, "warning", "imu rate",
            f"{name} gives {unit.imu_rate_hz:.0f} IMU samples a second (limit {params.imu_rate_hz:g}): see to the IMU's"
            " wiring, and to its rate in the firmware.",
        )  # fmt: skip
    if unit.imu_loss > params.imu_loss:
        yield Finding(
            name, "warning", "imu loss",
            f"{name} loses {unit.imu_loss:.0%} of its IMU samples before they are sent (limit {params.imu_loss:.0%}):"
            " its loop is too slow for the IMU's rate; lower that in the firmware.",
        )  # fmt: skip


def _clock(unit: UnitHealth, params: HealthParams) -> Iterator[Finding]:
    name = unit.unit
    over = [
        f"{kind} {1000 * value:.0f} ms (limit {1000 * limit:g} ms)"
        for kind, value, limit in (
            ("in the median", unit.latency_s, params.latency_s),
            ("in one of twenty readings", unit.latency_late_s, params.latency_late_s),
        )
        if value > limit
    ]
    if over:
        yield Finding(
            name, "warning", "latency",
            f"{name} is heard {' and '.join(over)} after its measurement: bring the access point nearer, and see that"
            " its power save is off.",
        )  # fmt: skip
    if params.bound_s < unit.standing.bound < math.inf:
        yield Finding(
            name, "warning", "clock",
            f"{name}'s clock is known to {1000 * unit.standing.bound:.1f} ms only (limit"
            f" {1000 * params.bound_s:g} ms): the way to it is slow or one-sided; bring the access point nearer.",
        )  # fmt: skip
    if unit.clock_jumps:
        yield Finding(
            name, "warning", "clock jump",
            f"{name}'s clock jumped {unit.clock_jumps} times in {params.window_s:g} s: its crystal or firmware is not"
            " sound; replace the board if it comes again.",
        )  # fmt: skip


def _unit_itself(unit: UnitHealth, params: HealthParams) -> Iterator[Finding]:
    name = unit.unit
    if unit.battery_v < params.battery_v:
        level, limit = _graded(unit.battery_v, params.battery_v, params.battery_fault_v, above=False)
        yield Finding(
            name, level, "battery", f"{name}'s battery is at {unit.battery_v:.2f} V (limit {limit:g} V): charge it."
        )
    if unit.temperature_c > params.temperature_c:
        level, limit = _graded(unit.temperature_c, params.temperature_c, params.temperature_fault_c, above=True)
        yield Finding(
            name, level, "temperature",
            f"{name} is at {unit.temperature_c:.0f} degrees C (limit {limit:g}): take it from what heats it.",
        )  # fmt: skip
    if unit.temperature_c < params.temperature_low_c:
        yield Finding(
            name, "warning", "temperature",
            f"{name} is at {unit.temperature_c:.0f} degrees C (limit {params.temperature_low_c:g}): warm it.",
        )  # fmt: skip
    if unit.bus_errors >= params.bus_errors or unit.restarts:
        yield Finding(
            name, "warning", "bus",
            f"{name} had {unit.bus_errors} failed transfers on its bus and {unit.restarts} sensors begun anew in"
            f" {params.window_s:g} s (limits {params.bus_errors} and 1): see to the plugs and length of its wires.",
        )  # fmt: skip
    if unit.reboots >= params.reboots:
        yield Finding(
            name, "warning", "reboot",
            f"{name} began anew {unit.reboots} times in {params.window_s:g} s (limit {params.reboots}):"
            f" {_ENDS.get(unit.standing.reset, 'see to its supply and firmware')}.",
        )  # fmt: skip
    firmware = unit.standing.firmware
    if firmware and firmware < params.firmware:
        yield Finding(
            name, "fault", "firmware",
            f"{name} runs firmware {version(firmware)} (oldest that is served: {version(params.firmware)}): flash it"
            " anew (docs/hardware/flashing.md).",
        )  # fmt: skip


def version(firmware: int) -> str:
    """Return a firmware version as text."""
    return f"{firmware >> 8}.{firmware & 0xFF}"


def _graded(value: float, warning: float, fault: float, above: bool) -> tuple[Level, float]:
    """Return how bad a value beyond the limit of a warning is, and which limit it passed."""
    beyond = value > fault if above else value < fault
    return ("fault", fault) if beyond else ("warning", warning)
