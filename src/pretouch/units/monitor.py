"""A skin watched: what comes from a receiver, judged a few times a second."""

import math
import time
from collections.abc import Iterator
from dataclasses import dataclass

from pretouch.types import FloatArray
from pretouch.units.findings import Finding, findings
from pretouch.units.health import HealthParams, Lateness, UnitHealth, UnitWindow
from pretouch.units.model_check import ModelCheck
from pretouch.units.receiver import SkinReceiver
from pretouch.units.traffic import Received

UPDATE_PERIOD_S = 0.25
"""Time between two judgements [s]: as often as a person can read."""
_WAIT_S = 0.02
"""Time for which the socket is waited for at once [s]."""
_COMPARE_S = 0.04
"""Time between two comparisons with the model [s]: every other reading at 50 Hz."""


@dataclass(frozen=True)
class MonitorUpdate:
    """What was received since the previous update, and the health of the units."""

    time: float
    """Instant, by the receiver's clock [s]."""
    elapsed: float
    """Since watching began [s]."""
    heard: list[Received]
    units: tuple[UnitHealth, ...]
    findings: tuple[Finding, ...]
    last: bool
    """Whether the duration is over."""


@dataclass(frozen=True)
class Posture:
    """An arm that stands still while its units are watched, and the model they are to agree with."""

    q: FloatArray
    """(n,) joint positions [rad]."""
    check: ModelCheck


def watch(
    receiver: SkinReceiver, params: HealthParams, duration: float = math.inf, posture: Posture | None = None
) -> Iterator[MonitorUpdate]:
    """Yield an update every `UPDATE_PERIOD_S` for a duration [s], by the monotonic clock; the last one is marked."""
    windows = [UnitWindow(unit.id, params.window_s) for unit in receiver.units]
    lateness = Lateness(UPDATE_PERIOD_S, params.window_s)
    begun = due = compare_due = time.monotonic()
    over = False
    while not over:
        due = min(due + UPDATE_PERIOD_S, begun + duration)
        while (left := due - time.monotonic()) > 0:
            receiver.receive(min(left, _WAIT_S))
            if posture is not None and time.monotonic() >= compare_due:
                compare_due = time.monotonic() + _COMPARE_S
                posture.check.take(posture.q, receiver.readings())
        receiver.receive()
        now = time.monotonic()
        lateness.look(now)
        over = now >= begun + duration
        heard = receiver.take_samples()
        receiver.take_imu()
        health = tuple(_taken(window, receiver, k, now, heard) for k, window in enumerate(windows))
        found = findings(health, params, lateness.total)
        if posture is not None:
            found += posture.check.findings()
        yield MonitorUpdate(now, now - begun, heard, health, found, over)
        due = max(due, time.monotonic() - UPDATE_PERIOD_S)


def _taken(window: UnitWindow, receiver: SkinReceiver, k: int, now: float, heard: list[Received]) -> UnitHealth:
    """Return the health of unit k after what was heard."""
    window.take(now, [one for one in heard if one.unit == k], receiver.units[k])
    health = window.health(now, receiver.units[k])
    receiver.receive()  # what arrives meanwhile must not look late
    return health
