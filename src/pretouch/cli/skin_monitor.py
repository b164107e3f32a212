"""The command `pretouch skin monitor`: units watched in the terminal, and recorded."""

import math
import socket
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, nullcontext, suppress
from dataclasses import dataclass
from functools import cache
from ipaddress import ip_address
from pathlib import Path
from typing import Any

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.text import Text

from pretouch.cli.options import JsonFile, OptionalFile, Words
from pretouch.cli.tables import PlainTable
from pretouch.cli.writing import numbers_to
from pretouch.errors import HardwareError
from pretouch.robot.description import robot_named
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import load_skin
from pretouch.sensing.unit import NetworkUnits
from pretouch.signals import Terminated
from pretouch.types import RangeStatus
from pretouch.units import EVERYWHERE, HOST, PORT
from pretouch.units.findings import Finding
from pretouch.units.health import UnitHealth, status_name
from pretouch.units.keys import load_keys
from pretouch.units.skin import NetworkSkin
from pretouch.units.skin_recording import SkinRecording
from pretouch.units.watch import UnitWatch, WatchUpdate

_SECOND_S = 1.0
_UPDATE_S = 0.25
"""Time between two updates [s]: as often as a person can read."""
_COLUMNS = ["unit", "state", "rate\n[Hz]", "loss\n[%]", "latency\n[ms]", "dist.\n[m]", "sigma\n[mm]", "batt.\n[V]"]
_COLUMNS += ["temp.\n[C]", "IMU\n[Hz]", "clock\n[ms]"]
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


@dataclass(frozen=True)
class Monitor:
    """Watch sensor units: rates, losses, latency, batteries, and what is wrong, with what to do about it."""

    keys: Path
    """File of the units' keys."""
    skin: OptionalFile = None
    """Skin file whose units to watch; by default all in the file of keys."""
    units: Words = ()
    """Names of the units to watch, separated by commas."""
    arm: str = "panda"
    """The arm of the skin file: panda, fr3, or the folder of an imported arm."""
    host: str = HOST
    """Address to listen at. Real units need 0.0.0.0, which is every address of this machine."""
    port: int = PORT
    """UDP port to listen at."""
    record: OptionalFile = None
    """Recording to write: all samples as received, ranges and IMU."""
    duration: float = 0.0
    """Time to watch [s]; 0: until Ctrl-C. The exit code is then 1 if a unit is faulty at the end."""
    json: JsonFile = None

    def run(self) -> int:
        """Watch units; return 1 if one is faulty after a given time or recording failed, or else 0."""
        if not (math.isfinite(self.duration) and self.duration >= 0):
            raise HardwareError(f"--duration is {self.duration:g} s: give 0 or more.")
        duration = self.duration or math.inf
        with numbers_to(self.json) as write:
            return _monitored(self, duration, write)


def _monitored(command: Monitor, duration: float, write: Callable[[Any], None]) -> int:
    if not command.host:
        raise HardwareError(
            f"The address to listen on is empty: give {HOST}, or {EVERYWHERE} for every address of this machine."
        )
    keys = load_keys(command.keys)
    units = _watched(command, tuple(keys))
    last: WatchUpdate | None = None
    with ExitStack() as stack:
        receiver = stack.enter_context(NetworkSkin(units, keys, command.host, command.port))
        recording = stack.enter_context(SkinRecording(command.record)) if command.record else None
        updates = UnitWatch(receiver, _UPDATE_S).updates(duration)
        try:
            for update in _shown(updates, receiver, recording):
                last = update
        except (KeyboardInterrupt, Terminated):
            with suppress(OSError):  # the terminal may be gone
                _conclude(last, receiver, recording, write)
            raise
        _conclude(last, receiver, recording, write)
    faulty = math.isfinite(duration) and last is not None and any(f.level == "fault" for f in last.findings)
    return int(faulty or bool(recording and recording.trouble))


def _watched(command: Monitor, all_ids: tuple[str, ...]) -> NetworkUnits:
    if command.skin and command.units:
        raise HardwareError("Both --skin and --units are given: leave one of them out.")
    if command.skin:
        return load_skin(command.skin, RobotModel(robot_named(command.arm))).network
    ids = command.units or all_ids
    if not ids:
        raise HardwareError(f"{command.keys} holds no unit: `pretouch skin provision` or `skin keys` adds one.")
    return NetworkUnits.of(ids)


def _shown(
    updates: Iterator[WatchUpdate], receiver: NetworkSkin, recording: SkinRecording | None
) -> Iterator[WatchUpdate]:
    """Show, record and yield each update."""
    console, second, before = Console(highlight=False, soft_wrap=True), 0.0, dict[tuple[str, str], str]()
    live = None if not console.is_terminal else Live(console=console, auto_refresh=False, transient=True)
    with live or nullcontext():
        for update in updates:
            full = update.elapsed >= second
            second += _SECOND_S * full
            if recording:
                recording.add(update.samples, [unit.unit for unit in update.units])
            if live:
                notes = _nothing_received(receiver)
                if recording:
                    notes.append(recording.trouble or f"Recording {recording.place}: {recording.samples} samples.")
                live.update(view(update, receiver.traffic().rejected, notes), refresh=True)
            elif full:
                before = _print_line(console, update, before)
            yield update


def _print_line(
    console: Console, update: WatchUpdate, before: dict[tuple[str, str], str]
) -> dict[tuple[str, str], str]:
    """Print a line for an update, and each finding when it appears and when it is over; return those there are."""
    console.print(_line(update), markup=False)
    current = {(f.unit, f.what): f"{f.level}: {f.sentence}" for f in update.findings}
    for sentence in (sentence for key, sentence in current.items() if key not in before):
        console.print(f"  {sentence}", markup=False)
    for unit, what in (key for key in before if key not in current):
        console.print(f"  over: {unit}, {what}", markup=False)
    return current


def _conclude(
    last: WatchUpdate | None, receiver: NetworkSkin, recording: SkinRecording | None, write: Callable[[Any], None]
) -> None:
    """Close the recording, and show and write the last update."""
    sentences = [recording.close()] if recording else []
    console = Console(highlight=False, soft_wrap=True)
    if last is None:
        console.print(*sentences, markup=False)
        return
    rejected, notes = receiver.traffic().rejected, [*_nothing_received(receiver), *sentences]
    console.print(view(last, rejected, notes))
    numbers = {"elapsed_s": last.elapsed, "units": last.units, "findings": last.findings}
    write(numbers | {"rejected": rejected, "notes": [*notes, *_thrown_away(rejected)]})


def _nothing_received(receiver: NetworkSkin) -> list[str]:
    """Say where the receiver listens and what may be wrong while nothing has been received."""
    if any(unit.state != "never heard" for unit in receiver.traffic().units):
        return []
    host, port = receiver.address
    local = f", which only programs on this machine can reach: real units need --host {EVERYWHERE}"
    return [f"Nothing was received at {host}:{port}{local if only_here(host) else ''}."]


@cache
def only_here(host: str) -> bool:
    """Return True if only programs on this machine can send to an address."""
    try:
        address = socket.getaddrinfo(host, None, type=socket.SOCK_DGRAM)[0][4][0]
    except (OSError, UnicodeError):
        return False
    return ip_address(str(address).partition("%")[0]).is_loopback


def view(update: WatchUpdate, rejected: Mapping[str, int], notes: Sequence[str]) -> RenderableType:
    """Return the whole view of an update: a table, the findings below it, and what was thrown away at the socket."""
    lines = [Text(f"{f.level}: {f.sentence}", style=_STYLES[f.level]) for f in update.findings]
    below = [Text(text, style="dim") for text in (*notes, *_thrown_away(rejected))]
    return Group(table(update.units, update.findings), *(lines or [Text("Nothing is wrong.", style="green")]), *below)


def table(units: Sequence[UnitHealth], findings: Sequence[Finding]) -> PlainTable:
    """Return one row per unit, coloured by the worst that is wrong with it."""
    worst = {f.unit: f.level for f in sorted(findings, key=lambda f: f.level, reverse=True)}
    styles = [_STYLES.get(worst.get(unit.unit, ""), "") for unit in units]
    return PlainTable(tuple(_COLUMNS), [_cells(unit) for unit in units], left=(0, 1), styles=styles)


def _cells(unit: UnitHealth) -> tuple[str, ...]:
    """Return a unit's row; its state is the status of its newest reading while it is live."""
    state: str = unit.traffic.state
    if state == "live" and unit.statuses:
        state = RangeStatus.STUCK.name if unit.traffic.stuck else status_name(unit.status)
    distance = unit.distance_m if unit.status in _TARGET else math.nan
    of_range = (100 * unit.loss, 1), (1000 * unit.latency_s, 1), (distance, 3), (1000 * unit.sigma_m, 1)
    of_unit = (unit.battery_v, 2), (unit.temperature_c, 1), (unit.imu_rate_hz, 0), (1000 * unit.traffic.bound, 2)
    numbers = (unit.rate_hz, 1), *of_range, *of_unit
    return unit.unit, state, *(_number(value, digits) for value, digits in numbers)


def _number(value: float, digits: int) -> str:
    """Return a number as text, '-' for one that is not known."""
    return f"{value:.{digits}f}" if math.isfinite(value) else "-"


def _line(update: WatchUpdate) -> str:
    """Return an update as one line."""
    live = [unit for unit in update.units if unit.traffic.state == "live"]
    slowest = min((unit.rate_hz for unit in live if math.isfinite(unit.rate_hz)), default=math.nan)
    most = max((unit.loss for unit in live if math.isfinite(unit.loss)), default=math.nan)
    faults = sum(f.level == "fault" for f in update.findings)
    return (
        f"{update.elapsed:.0f} s: {len(live)} of {len(update.units)} units live, slowest {_number(slowest, 1)} Hz,"
        f" largest loss {_number(100 * most, 1)} %, {faults} faults, {len(update.findings) - faults} warnings."
    )


def _thrown_away(rejected: Mapping[str, int]) -> list[str]:
    """Say what was thrown away at the socket and why."""
    parts = [f"{count} with {_MEANINGS.get(why, why)}" for why, count in rejected.items() if count]
    return [f"Thrown away: {', '.join(parts)}."] if parts else []
