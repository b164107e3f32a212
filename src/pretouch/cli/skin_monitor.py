"""What `pretouch skin monitor` does: units watched in the terminal, and recorded."""

import math
import socket
from collections.abc import Callable, Iterator
from contextlib import ExitStack, nullcontext, suppress
from dataclasses import asdict, dataclass
from functools import cache
from ipaddress import ip_address
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.live import Live

from pretouch.cli.options import JsonFile, Numbers, OptionalFile, Words
from pretouch.cli.skin_table import line, thrown_away, view
from pretouch.cli.writing import numbers_to
from pretouch.errors import HardwareError
from pretouch.perception.scene_filter import no_fixtures
from pretouch.robot.description import robot_named
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import load_skin
from pretouch.sensing.unit import NetworkUnits
from pretouch.signals import Terminated
from pretouch.types import FloatArray
from pretouch.units.health import HealthParams
from pretouch.units.keys import load_keys
from pretouch.units.model_check import ModelCheck, ModelCheckParams
from pretouch.units.monitor import MonitorUpdate, Posture, watch
from pretouch.units.receiver import SkinReceiver
from pretouch.units.skin_recording import SkinRecording
from pretouch.units.udp import EVERYWHERE, HOST, PORT

_ONCE_S = 5.0
_SECOND_S = 1.0


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
    posture: Numbers = ()
    """Joint positions [rad], separated by commas, of the arm that stands still: with --skin, units whose readings
    contradict the model are named. Nothing but the arm may be near."""
    host: str = HOST
    """Address to listen at. Real units need 0.0.0.0, which is every address of this machine."""
    port: int = PORT
    """UDP port to listen at."""
    record: OptionalFile = None
    """Recording to write: all samples as received, ranges, IMU and diagnostics."""
    duration: float = 0.0
    """Time to watch [s]; 0: until Ctrl-C. The exit code is then 1 if a unit is faulty at the end."""
    once: bool = False
    """Watch for 5 s and print one table."""
    json: JsonFile = None

    def run(self) -> int:
        """Watch units; return 1 if one is faulty after a given time or recording failed, or else 0."""
        duration = _duration(self)
        with numbers_to(self.json) as write:
            return _monitored(self, duration, write)


def _monitored(command: Monitor, duration: float, write: Callable[[Any], None]) -> int:
    if not command.host:
        raise HardwareError(
            f"The address to listen on is empty: give {HOST}, or {EVERYWHERE} for every address of this machine."
        )
    keys = load_keys(command.keys)
    units, posture = _watched(command, tuple(keys))
    with ExitStack() as stack:
        receiver = stack.enter_context(SkinReceiver(units, keys, command.host, command.port))
        recording = stack.enter_context(SkinRecording(command.record)) if command.record else None
        updates, last = watch(receiver, HealthParams(), duration, posture), None
        try:
            for update in _shown(updates, receiver, recording, command.once):
                last = update
        except (KeyboardInterrupt, Terminated):
            with suppress(OSError):  # the terminal may be gone
                _conclude(last, receiver, recording, write)
            raise
        _conclude(last, receiver, recording, write)
    faulty = math.isfinite(duration) and last is not None and any(f.level == "fault" for f in last.findings)
    return int(faulty or bool(recording and recording.trouble))


def _conclude(
    last: MonitorUpdate | None, receiver: SkinReceiver, recording: SkinRecording | None, write: Callable[[Any], None]
) -> None:
    """Close the recording, and show and write the last update."""
    sentence = recording.close() if recording else ""
    notes = [note for note in (_nothing_received(receiver), sentence) if note]
    console = Console(highlight=False, soft_wrap=True)
    if last is not None:
        console.print(view(last, receiver.rejected, notes))
        write(_numbers(last, receiver, notes))
    elif sentence:
        console.print(sentence, markup=False)


def _duration(command: Monitor) -> float:
    if not (math.isfinite(command.duration) and command.duration >= 0):
        raise HardwareError(f"--duration is {command.duration:g} s: give 0 or more.")
    return command.duration or (_ONCE_S if command.once else math.inf)


def _watched(command: Monitor, all_ids: tuple[str, ...]) -> tuple[NetworkUnits, Posture | None]:
    """The units to watch, and the posture they are to agree with, if one is given."""
    if command.skin and command.units:
        raise HardwareError("Both --skin and --units are given: leave one of them out.")
    if command.posture and not command.skin:
        raise HardwareError("--posture needs --skin, the file with the poses of the units.")
    if not command.skin:
        ids = command.units or all_ids
        if not ids:
            raise HardwareError(f"{command.keys} holds no unit: `pretouch skin provision` or `skin keys` adds one.")
        return NetworkUnits.of(ids), None
    model = RobotModel(robot_named(command.arm))
    skin = load_skin(command.skin, model)
    if not command.posture:
        return skin.network, None
    return skin.network, Posture(
        _posture(command.posture, model), ModelCheck(model, skin, no_fixtures(), ModelCheckParams())
    )


def _posture(positions: tuple[float, ...], model: RobotModel) -> FloatArray:
    q = np.array(positions)
    if q.shape != (model.n,) or not np.isfinite(q).all():
        raise HardwareError(
            f"The posture is {','.join(map('{:g}'.format, q))}: give {model.n} joint positions [rad], separated by"
            " commas."
        )
    beyond = np.flatnonzero((q < model.q_min) | (q > model.q_max))
    if len(beyond):
        i = beyond[0]
        raise HardwareError(
            f"The posture has joint {i + 1} at {q[i]:g} rad, outside its range of {model.q_min[i]:.2f} to"
            f" {model.q_max[i]:.2f} rad: give joint positions of this arm."
        )
    return q


def _shown(
    updates: Iterator[MonitorUpdate], receiver: SkinReceiver, recording: SkinRecording | None, quiet: bool
) -> Iterator[MonitorUpdate]:
    """Show, record and yield each update."""
    console, second = Console(highlight=False, soft_wrap=True), 0.0
    live = None if quiet or not console.is_terminal else Live(console=console, auto_refresh=False, transient=True)
    lines = None if quiet or live else _Lines(console)
    with live or nullcontext():
        for update in updates:
            full = update.elapsed >= second
            second += _SECOND_S * full
            if recording:
                recording.add(update.heard, [unit.id for unit in receiver.units])
                if full:
                    recording.health(update)
            if live:
                live.update(view(update, receiver.rejected, _notes(receiver, recording)), refresh=True)
            elif lines and full:
                lines.show(update)
            yield update


class _Lines:
    """Prints a line for each update, and each finding when it appears and when it is over."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._known: dict[tuple[str, str], str] = {}

    def show(self, update: MonitorUpdate) -> None:
        """Say it."""
        self._console.print(line(update), markup=False)
        known = {(f.unit, f.what): f"{f.level}: {f.sentence}" for f in update.findings}
        for sentence in (known[key] for key in known if key not in self._known):
            self._console.print(f"  {sentence}", markup=False)
        for unit, what in (key for key in self._known if key not in known):
            self._console.print(f"  over: {unit}, {what}", markup=False)
        self._known = known


def _notes(receiver: SkinReceiver, recording: SkinRecording | None) -> list[str]:
    notes = [_nothing_received(receiver)]
    if recording:
        notes.append(recording.trouble or f"Recording {recording.place}: {recording.samples} samples.")
    return [note for note in notes if note]


def _nothing_received(receiver: SkinReceiver) -> str:
    """Return where the receiver listens and what may be wrong while nothing has been received, or ''."""
    if any(unit.state != "never heard" for unit in receiver.units):
        return ""
    host, port = receiver.address
    local = f", which only programs on this machine can reach: real units need --host {EVERYWHERE}"
    return f"Nothing was received at {host}:{port}{local if only_here(host) else ''}."


@cache
def only_here(host: str) -> bool:
    """Whether only what runs on this machine can send to an address of it."""
    try:
        found = socket.getaddrinfo(host, None, type=socket.SOCK_DGRAM)[0][4][0]
    except (OSError, UnicodeError):
        return False
    return ip_address(str(found).partition("%")[0]).is_loopback


def _numbers(update: MonitorUpdate, receiver: SkinReceiver, notes: list[str]) -> dict[str, Any]:
    return {
        "elapsed_s": update.elapsed,
        "units": [asdict(unit) for unit in update.units],
        "findings": [asdict(finding) for finding in update.findings],
        "rejected": dict(receiver.rejected),
        "notes": [*notes, *filter(None, [thrown_away(receiver.rejected)])],
    }
