"""How `pretouch skin monitor` shows units: a table, the findings below it, and what was thrown away at the socket."""

import math
from collections.abc import Mapping, Sequence

from rich.console import Group, RenderableType
from rich.text import Text

from pretouch.cli.tables import PlainTable
from pretouch.types import RangeStatus
from pretouch.units.findings import Finding
from pretouch.units.health import UnitHealth, status_name
from pretouch.units.monitor import MonitorUpdate

_COLUMNS = (
    "unit", "state", "rate\n[Hz]", "loss\n[%]", "latency\n[ms]", "dist.\n[m]", "sigma\n[mm]", "batt.\n[V]",
    "temp.\n[C]", "IMU\n[Hz]", "clock\n[ms]",
)  # fmt: skip
_TARGET = (RangeStatus.OK, RangeStatus.NO_WRAP_CHECK, RangeStatus.MERGED, RangeStatus.MIN_CLIPPED)
"""Statuses of readings that have a distance."""
_STYLES = {"fault": "bold red", "warning": "yellow"}
_MEANINGS = {
    "size": "a size that no message has",
    "format": "an unknown magic, version or kind",
    "unit": "the number of an unknown unit",
    "tag": "a wrong tag (another key, or a forgery)",
    "replayed": "a sequence number seen already",
    "no session": "a sample outside a session",
    "too many hellos": "more hellos than are answered",
    "old hello": "a hello of the session that is live",
}


def view(update: MonitorUpdate, rejected: Mapping[str, int], notes: Sequence[str]) -> RenderableType:
    """Return the whole view of an update."""
    lines = [Text(f"{f.level}: {f.sentence}", style=_STYLES[f.level]) for f in update.findings]
    said = thrown_away(rejected)
    below = [Text(text, style="dim") for text in (*notes, *([said] if said else []))]
    return Group(table(update.units, update.findings), *(lines or [Text("Nothing is wrong.", style="green")]), *below)


def table(units: Sequence[UnitHealth], found: Sequence[Finding]) -> PlainTable:
    """Return one row per unit, coloured by the worst that was found of it."""
    worst = {f.unit: f.level for f in sorted(found, key=lambda f: f.level, reverse=True)}
    styles = [_STYLES.get(worst.get(unit.unit, ""), "") for unit in units]
    return PlainTable(_COLUMNS, [_cells(unit) for unit in units], left=(0, 1), styles=styles)


def _cells(unit: UnitHealth) -> tuple[str, ...]:
    standing = unit.standing
    bound = standing.bound if math.isfinite(standing.bound) else math.nan
    return (
        unit.unit, _state(unit), number(unit.rate_hz, 1), number(100 * unit.loss, 1),
        number(1000 * unit.latency_s, 1), number(unit.distance_m if unit.status in _TARGET else math.nan, 3),
        number(1000 * unit.sigma_m, 1), number(unit.battery_v, 2), number(unit.temperature_c, 1),
        number(unit.imu_rate_hz, 0), number(1000 * bound, 2),
    )  # fmt: skip


def _state(unit: UnitHealth) -> str:
    """Return what a live unit's newest reading is, or the state of another."""
    if unit.standing.state != "live" or not unit.statuses:
        return unit.standing.state
    if unit.standing.stuck:
        return RangeStatus.STUCK.name
    return status_name(unit.status)


def number(value: float, digits: int) -> str:
    """Return a number as text, '-' for one that is not known."""
    return f"{value:.{digits}f}" if math.isfinite(value) else "-"


def line(update: MonitorUpdate) -> str:
    """Return an update as one line."""
    live = [unit for unit in update.units if unit.standing.state == "live"]
    rates = [unit.rate_hz for unit in live if math.isfinite(unit.rate_hz)]
    losses = [unit.loss for unit in live if math.isfinite(unit.loss)]
    slowest, most = min(rates, default=math.nan), max(losses, default=math.nan)
    faults = sum(f.level == "fault" for f in update.findings)
    return (
        f"{update.elapsed:.0f} s: {len(live)} of {len(update.units)} units live, slowest {number(slowest, 1)} Hz,"
        f" largest loss {number(100 * most, 1)} %, {faults} faults, {len(update.findings) - faults} warnings."
    )


def thrown_away(rejected: Mapping[str, int]) -> str:
    """Say what was thrown away at the socket and why, or ''."""
    parts = [f"{count} with {_MEANINGS.get(why, why)}" for why, count in rejected.items() if count]
    return f"Thrown away: {', '.join(parts)}." if parts else ""
