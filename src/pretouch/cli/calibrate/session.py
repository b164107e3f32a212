"""An arm that makes a motion while its units are heard: all that is measured is recorded."""

from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np

from pretouch.calibration.motion.perform import perform
from pretouch.calibration.motion.plan import Plan
from pretouch.cli.skin_record import record_samples
from pretouch.errors import HardwareError, RecordingError
from pretouch.hardware.network_skin import NetworkSkin
from pretouch.ports import Clock, Robot
from pretouch.recording.skin_recording import SkinRecording
from pretouch.robot.model import RobotModel
from pretouch.session.units import wait_until_live
from pretouch.signals import noted_in_motion
from pretouch.types import FloatArray

_STEADY_S, _PATIENCE_S = 3.0, 20.0
"""Units that were heard for so long have clocks that are known; for so long they are waited for [s]."""
_AFTER_S = 0.5
"""What was measured up to the end of a motion has arrived then [s]."""


class Rig(Robot, Clock, Protocol):
    """An arm with its clock."""

    def begin(self) -> None:
        """Let its time begin."""
        ...

    def monotonic(self, instant: float) -> float:
        """Return an instant of its clock by this machine's monotonic clock [s]."""
        ...


class Interrupted(Exception):
    """A signal came while the arm moved."""


class Session:
    """An arm and its units."""

    def __init__(self, rig: Rig, model: RobotModel, source: NetworkSkin, ids: Sequence[str]) -> None:
        """Take an arm, its model, and what hears the units of these ids."""
        self._rig, self._model, self._source, self._ids = rig, model, source, ids
        self._recording: SkinRecording | None = None
        self._newest = -np.inf

    def wait_for_units(self) -> None:
        """Wait until all units are heard without a break; those that are not are a HardwareError that names them."""
        self._rig.begin()
        wait_until_live(self._source, self._rig, lambda _: self._keep(), _PATIENCE_S, _STEADY_S)

    def posture(self) -> FloatArray:
        """Return where the arm's joints are (n,) [rad]."""
        return np.array(self._rig.read().q)

    def record(self, recording: SkinRecording) -> None:
        """Record from here on."""
        self._recording = recording

    def follow(self, plan: Plan, progress: Callable[[float], None]) -> str | None:
        """Let the arm follow a plan, and tell `progress` how far it is [s]; return why it was stopped, or None.

        A signal that ends the command brings the arm to rest first, whatever other signals come meanwhile.
        """
        begin = self._rig.read().stamp

        def on_tick(tick: float) -> None:
            self._keep()
            progress(tick - begin)
            if came:
                raise Interrupted

        with noted_in_motion() as came:
            return perform(self._rig, self._rig, self._model, plan, on_tick=on_tick).stopped

    def stand(self) -> None:
        """Let the arm stand until all that was measured has arrived."""
        begin = self._rig.tick()
        while self._rig.tick() - begin < _AFTER_S:
            self._keep()

    def _keep(self) -> None:
        """Record what is new."""
        if not self._source.alive:
            raise HardwareError("The receiver of the units has ended: see what it printed.")
        heard = self._source.take_samples()
        if self._recording is None:
            return
        record_samples(self._recording, heard, self._ids)
        state = self._rig.read()
        stamp = self._rig.monotonic(state.stamp)
        if stamp > self._newest:
            self._newest = stamp
            q, qd = (np.array(values)[None] for values in (state.q, state.qd))
            self._recording.joints(np.array([stamp]), q, qd, self._model.joints)
        if self._recording.trouble:
            raise RecordingError(self._recording.trouble)
