"""Faults of a unit as sentences: unit, value, limit, and what to do."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

from pretouch.units.health import HealthParams, UnitHealth
from pretouch.units.wire import Reset

_FAILURES = frozenset(["HARDWARE", "CROSSTALK", "SYNC", "INVALID", "STUCK", "NONE"])
"""Statuses of a sensor that failed; others say that something is there, or that nothing near is."""
_MOST_DIGITS = 4
_ENDS: dict[int, str] = {
    Reset.POWER_ON: "it was powered on: check its battery and plug",
    Reset.HARD: "its reset line was pulled: check its wiring",
    Reset.WATCHDOG: "its watchdog ended a hang: check its firmware and bus",
    Reset.SOFT: "its program restarted: check its firmware",
}
_FAST = 4
"""Zones along a side up to which a sensor keeps the rate of one without."""

Level = Literal["fault", "warning"]


@dataclass(frozen=True)
class Finding:
    """One fault or warning."""

    unit: str
    """Name of the unit, or of another part."""
    level: Level
    what: str
    """A word for programs, as `rate` or `battery`."""
    sentence: str


_OF_TIME = frozenset({"rate", "range late", "loss", "imu rate", "imu loss", "latency", "clock"})
"""Findings that a late machine causes although the units are well."""


def findings(units: Iterable[UnitHealth], params: HealthParams, late: float = 0.0) -> tuple[Finding, ...]:
    """Return faults and warnings, unit by unit, faults first.

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


class _Findings(list[Finding]):
    """Faults of one unit; each sentence continues after the unit's name."""

    def __init__(self, unit: str) -> None:
        super().__init__()
        self._unit = unit

    def add(self, level: Level, what: str, sentence: str) -> None:
        """Add a fault or warning."""
        self.append(Finding(self._unit, level, what, self._unit + sentence))

    def beyond(
        self, what: str, value: float, limits: tuple[float, ...], sentence: str, digits: int = 0, below: bool = False
    ) -> None:
        """Add a warning if a value is over, or `below`, the first limit; a fault if it is beyond the second as well.

        The sentence has {value} and {limit} in it.
        """
        passed = [limit for limit in limits if (value < limit if below else value > limit)]
        if passed:
            words = sentence.format(value=_formatted(value, passed[-1], digits), limit=f"{passed[-1]:g}")
            self.add("fault" if len(passed) > 1 else "warning", what, words)


def _formatted(value: float, limit: float, digits: int = 0) -> str:
    """Return a value with so many digits, or as many more as set it off from its limit."""
    while digits < _MOST_DIGITS and f"{value:.{digits}f}" == f"{limit:.{digits}f}":
        digits += 1
    return f"{value:.{digits}f}"


def _of(unit: UnitHealth, params: HealthParams) -> list[Finding]:
    wrong = _Findings(unit.unit)
    silence = _silence(unit, params)
    if silence:
        wrong.add("fault", "silent", silence)
    else:
        _range_finder(wrong, unit, params)
        _touch_sensor(wrong, unit, params)
        if unit.heard_s >= params.settle_s:
            _rates(wrong, unit, params)
            _clock(wrong, unit, params)
    if unit.heard_s > 0:
        _unit_itself(wrong, unit, params)
    return wrong


def _silence(unit: UnitHealth, params: HealthParams) -> str:
    """Return the reason of a unit's silence, or ''."""
    if unit.silent_s <= params.silent_s:
        return ""
    if unit.traffic.state == "greeting":
        return (
            " asks for a session but does not receive the answers: allow UDP to it through the firewall and the access"
            " point (no client isolation)."
        )
    if not math.isfinite(unit.silent_s):
        return (
            " has sent nothing so far: check its power and Wi-Fi, and that it was provisioned with this host's address"
            " and port and with this key."
        )
    return (
        f" has sent nothing for {unit.silent_s:.1f} s (limit {params.silent_s:g} s): check its power and its distance"
        " from the access point."
    )


def _range_finder(wrong: _Findings, unit: UnitHealth, params: HealthParams) -> None:
    if unit.traffic.stuck:
        hangs = f" repeats {unit.distance_m:.3f} m to the last digit, so its range finder hangs: restart the unit, and"
        wrong.add("fault", "stuck", f"{hangs} replace the sensor if this happens again.")
    zones, sent = unit.traffic.zones, unit.traffic.zones_told
    if sent not in (0, zones):
        misfit = f" sends {_square(sent)}, but the skin file has {_square(zones)}, so its readings are not used: set"
        remedy = "zones and type of its sensor in the skin file, or provision and flash the unit for them."
        wrong.add("fault", "zones", f"{misfit} {remedy}")
    failed = {status: count for status, count in unit.statuses.items() if status in _FAILURES or status.isdecimal()}
    if failed:
        kinds = ", ".join(f"{count} {status}" for status, count in sorted(failed.items()))
        share = 100 * sum(failed.values()) / sum(unit.statuses.values())
        fails = f" fails in {{value}}% of its readings ({kinds}; limit {{limit}}%): check its wiring and supply, and"
        limits = 100 * params.failed, 100 * params.failed_fault
        wrong.beyond("status", share, limits, f"{fails} replace the sensor if this continues.")
    sigma = " estimates its own error at {value} mm (limit {limit} mm): clean its window, and shade it from the sun."
    wrong.beyond("sigma", 1000 * unit.sigma_m, (1000 * params.sigma_m,), sigma)
    noise = " scatters by {value} mm from reading to reading (limit {limit} mm): clean its window, and remove"
    wrong.beyond(
        "noise", 1000 * unit.noise_m, (1000 * params.noise_m,), f"{noise} anything shiny or moving in front of it."
    )


def _square(side: int) -> str:
    return f"{side} x {side} zones" if side > 1 else "a single range"


def _touch_sensor(wrong: _Findings, unit: UnitHealth, params: HealthParams) -> None:
    if unit.touched == 1.0 and unit.heard_s >= params.touch_held_s:
        touched = (
            f" has reported a touch for {unit.heard_s:.0f} s (limit {params.touch_held_s:g} s), so its touch sensor"
        )
        wrong.add(
            "warning",
            "touch held",
            f"{touched} is ignored: check that no cable or case presses on it, and calibrate it.",
        )
    failing = "'s touch sensor fails in {value}% of its readings (limit {limit}%): check its leads and the resistor"
    wrong.beyond("touch failed", 100 * unit.touch_failed, (100 * params.touch_failed,), f"{failing} across it.")


def _rates(wrong: _Findings, unit: UnitHealth, params: HealthParams) -> None:
    if _unbroken(unit, params):
        remedy = "check its wiring and supply, and its radio if samples are lost."
        if unit.traffic.zones_told > _FAST:
            remedy = "measure 4 x 4 zones, which is faster."
        slow = f" gives {{value}} readings a second (limit {{limit}}): {remedy}"
        wrong.beyond("rate", unit.rate_hz, (params.rate_hz, params.rate_fault_hz), slow, digits=1, below=True)
    if unit.range_late >= params.range_late:
        late = (
            f" had no new range in time {unit.range_late} times in {params.window_s:g} s (limit {params.range_late}):"
        )
        wrong.add("warning", "range late", f"{late} check its interrupt line and bus.")
    loss = (
        " loses {value}% of its samples in transmission (limit {limit}%): move the access point closer, or use a free"
    )
    wrong.beyond("loss", 100 * unit.loss, (100 * params.loss, 100 * params.loss_fault), f"{loss} channel.")
    rate = " gives {value} IMU samples a second (limit {limit}): check the IMU's wiring and its rate in the firmware."
    wrong.beyond("imu rate", unit.imu_rate_hz, (params.imu_rate_hz,), rate, below=True)
    lost = (
        " loses {value}% of its IMU samples before they are sent (limit {limit}%): its loop is too slow for the IMU's"
    )
    wrong.beyond(
        "imu loss", 100 * unit.imu_loss, (100 * params.imu_loss,), f"{lost} rate; lower the rate in the firmware."
    )


def _clock(wrong: _Findings, unit: UnitHealth, params: HealthParams) -> None:
    over = [
        f"{kind} {_formatted(1000 * value, 1000 * limit)} ms (limit {1000 * limit:g} ms)"
        for kind, value, limit in (
            ("in the median", unit.latency_s, params.latency_s),
            ("in one of twenty readings", unit.latency_late_s, params.latency_late_s),
        )
        if value > limit
    ]
    if over:
        remedy = "move the access point closer, and switch its power saving off."
        wrong.add("warning", "latency", f"'s readings arrive late, {' and '.join(over)}: {remedy}")
    if math.isfinite(unit.traffic.bound) and _unbroken(unit, params):
        vague = "'s clock is known only to within {value} ms (limit {limit} ms), because the network to it is slow or"
        limits = (1000 * params.bound_s,)
        vague += " asymmetric: move the access point closer."
        wrong.beyond("clock", 1000 * unit.traffic.bound, limits, vague, digits=1)
    if unit.clock_unknown_s >= params.settle_s:
        unknown = f"'s clock has been unknown for {unit.clock_unknown_s:.0f} s (limit {params.settle_s:g} s), so its"
        remedy = "it echoes no beacon in time; move the access point closer, and check its firmware."
        wrong.add("fault", "clock", f"{unknown} readings are not used: {remedy}")
    if unit.clock_jumps:
        jumps = f"'s clock jumped {unit.clock_jumps} times in {params.window_s:g} s: its crystal or firmware is faulty;"
        wrong.add("warning", "clock jump", f"{jumps} replace the board if this happens again.")


def _unbroken(unit: UnitHealth, params: HealthParams) -> bool:
    """Return True if the window contains neither a silence nor a reboot."""
    return unit.gap_s <= params.silent_s and not unit.reboots


def _unit_itself(wrong: _Findings, unit: UnitHealth, params: HealthParams) -> None:
    battery, hot, window = (params.battery_v, params.battery_fault_v), params.temperature_c, f"{params.window_s:g} s"
    charge = "'s battery is at {value} V (limit {limit} V): charge it."
    wrong.beyond("battery", unit.battery_v, battery, charge, digits=2, below=True)
    degrees = " is at {value} degrees C (limit {limit}): "
    cool = f"{degrees}move it away from the heat source."
    wrong.beyond("temperature", unit.temperature_c, (hot, params.temperature_fault_c), cool)
    wrong.beyond("temperature", unit.temperature_c, (params.temperature_low_c,), f"{degrees}warm it.", below=True)
    if unit.bus_errors >= params.bus_errors or unit.restarts:
        bus = f" had {unit.bus_errors} failed transfers on its bus and {unit.restarts} sensor restarts in {window}"
        limits = f"(limits {params.bus_errors} and 1)"
        wrong.add("warning", "bus", f"{bus} {limits}: check the plugs and the length of its wires.")
    if unit.reboots >= params.reboots:
        cause = _ENDS.get(unit.traffic.reset, "check its supply and firmware")
        wrong.add(
            "warning", "reboot", f" restarted {unit.reboots} times in {window} (limit {params.reboots}): {cause}."
        )
