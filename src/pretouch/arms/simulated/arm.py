"""A simulated arm in real time, whose units send to a receiver as real ones do."""

import threading
import time
from dataclasses import replace
from typing import NamedTuple, Self

import numpy as np

from pretouch.errors import RobotError
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.sim.plant import Plant
from pretouch.sim.plant_params import plant_params_of
from pretouch.sim.scene import SceneSpec
from pretouch.types import FloatArray, RobotState
from pretouch.units.fleet import Fleet

_SETTLE_S = 0.2
"""Time the arm stands before its time begins [s]: the observer's transient is over."""
_SLICE_S = 0.002
"""Step of the simulation in real time [s]: the largest delay of a datagram."""
_LATE_S = 0.1
"""Delay up to which a late machine catches up [s]; with more the simulation skips the lost time."""
_PERIOD_S = 0.002
"""Time in which a command reaches an arm that moves on by itself, and between two of its states [s]."""
_STUCK_S = 1.0
"""Time without progress [s] after which the simulation is stuck, not slow."""
_LAG_S = 0.03
"""Age of the state that a controller reads [s]: a machine that is late for a moment makes up for it."""
_START_S = 120.0
"""Longest time it may take to begin [s]: everything may have to be compiled first."""
_PUSH_N, _PUSH_AFTER_S, _PUSH_S = 14.0, 0.5, 1.5
"""Push of a simulated person who is asked to push the hand."""


class SimulatedArm:
    """An arm with units: the ports `Robot` and `Clock`, with ticks of the simulated time.

    Arm and units move on as real time passes, while somebody waits for a tick: one thread.
    """

    def __init__(
        self, model: RobotModel, q: FloatArray, skin: Skin, fleet: Fleet, scene: SceneSpec, period: float
    ) -> None:
        """Place an arm at q (n,) [rad] in a scene, with the units of a skin; the control period is in s."""
        self.fleet, self._slices = fleet, max(1, round(period / _SLICE_S))
        self._slice = period / self._slices
        self._start = self._next = 0.0
        self._plant_start = float("inf")
        self.now = 0.0
        """Real time since the start [s]: the units' time."""
        self.left_out = 0.0
        """Time that the machine was too slow to simulate [s]."""
        self.plant = Plant(model, scene, plant_params_of(model.description), q, fleet.seed)
        fleet.mount(self.plant, skin, self._since)

    def begin(self) -> None:
        """Start the time of arm and units."""
        self.plant.advance(_SETTLE_S)
        self._start, self._plant_start = time.monotonic(), self.plant.time
        self._next = self._start

    def read(self) -> RobotState:
        """Return the newest state, by the simulated time."""
        return self.plant.read()

    def command(self, qd: FloatArray) -> None:
        """Take joint velocities (n,) [rad/s] as the set-point until the next command."""
        self.plant.command(qd)

    def tick(self) -> float:
        """Wait for the next control period and return the simulated time [s]."""
        for _ in range(self._slices):
            self._next += self._slice
            wait = self._next - time.monotonic()
            if wait > 0:
                time.sleep(wait)
            elif wait < -_LATE_S:
                self._next -= wait
                self.left_out -= wait
            self._look()
            self.plant.advance(self._slice)
            self.fleet.step(self._look)
        self.plant.take_log()  # nobody reads it, and it would grow without an end
        return self.plant.time

    def _look(self) -> float:
        self.now = time.monotonic() - self._start
        return self.now

    def monotonic(self, simulated: float) -> float:
        """Return an instant of the simulated time by this machine's monotonic clock [s]."""
        return self._start + self._since(simulated)

    def _since(self, simulated: float) -> float:
        """Real time since the start [s]; earlier instants count as the start.

        It is when the simulation was due to be there, not when a late machine was, so that time flows evenly.
        """
        return max(0.0, simulated - self._plant_start) + self.left_out


class _Newest(NamedTuple):
    """Newest state of the simulation: one value, for another thread reads it."""

    state: RobotState
    """Stamped with when it was due."""
    left_out: float
    """Time that was left out before it [s]."""
    instant: float
    """Time of the state [s]."""


class ThreadedArm:
    """The port `Arm`. A context manager, for its thread."""

    def __init__(self, model: RobotModel, q: FloatArray, skin: Skin, fleet: Fleet, scene: SceneSpec) -> None:
        """Place an arm at q (n,) [rad] in a scene, as `SimulatedArm`. No other thread may use the model."""
        self.name = f"simulated {model.description.name}"
        self._arm = SimulatedArm(model, q, skin, fleet, scene, _PERIOD_S)
        self._still = np.zeros(model.n)
        self._set_point = self._still
        self._begun, self._over = False, threading.Event()
        self._newest: _Newest | None = None
        self._started, self._failure = threading.Event(), ""
        self._push, self._push_span = np.zeros(3), (np.inf, np.inf)
        plant = self._arm.plant
        self._applied = plant.mj_data.xfrc_applied[model.ee, :3]
        plant.before_each_step(self._apply)
        self._thread = threading.Thread(target=self._live, daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        if not self._started.wait(_START_S) or self._failure:
            raise RobotError(f"The simulation did not start: {self._failure or 'it took too long'}.")
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join()

    def read(self) -> RobotState:
        """Return the newest state, stamped with when it was due: at most `_LAG_S` ago, and never after now."""
        newest = self._state()
        now = time.monotonic()  # after the state: this thread may have to wait between the two
        latest = now if now < newest.instant + _STUCK_S else newest.instant
        return replace(newest.state, stamp=min(now, max(newest.state.stamp, latest - _LAG_S)))

    def measured(self) -> RobotState:
        """Return the newest state, stamped with when it was due, however late: by the clock of its units."""
        return self._state().state

    def _state(self) -> _Newest:
        newest = self._newest
        if newest is None or self._failure:
            raise RobotError(f"The simulation has ended: {self._failure or 'it was closed'}.")
        return newest

    def command(self, qd: FloatArray) -> None:
        """Take joint velocities (n,) [rad/s] as the set-point until the next command."""
        if not self._begun:
            raise RobotError("The simulated arm takes no commands yet: begin first.")
        if self._failure:
            raise RobotError(f"The simulation has ended: {self._failure}.")
        self._set_point = np.array(qd, dtype=np.float64)

    def unfit(self) -> tuple[str, ...]:
        """Return no reason: a simulated arm is always fit to move."""
        return ()

    def begin(self) -> None:
        """Accept commands from now on."""
        self._set_point, self._begun = self._still, True

    def end(self) -> None:
        """Accept no more commands."""
        self._set_point, self._begun = self._still, False

    def report(self) -> str:
        """Say whether the machine was fast enough."""
        late = self._arm.left_out
        return f"This machine is too slow by {late:.1f} s for the simulation." if late else ""

    @property
    def left_out(self) -> float:
        """Time that this machine was too slow to simulate by now [s]; of what is not left out yet it may make up."""
        newest = self._newest
        return 0.0 if newest is None else newest.left_out + max(0.0, time.monotonic() - _LAG_S - newest.state.stamp)

    def push(self, axis: tuple[float, float, float]) -> None:
        """Let a simulated person push the hand along an axis of the base, in a moment and for a while."""
        begin = self._arm.plant.time + _PUSH_AFTER_S
        self._push, self._push_span = _PUSH_N * np.array(axis), (begin, begin + _PUSH_S)

    def _apply(self, now: float) -> None:
        begin, end = self._push_span
        self._applied[:] = self._push if begin <= now < end else 0.0

    def _live(self) -> None:
        arm = self._arm
        try:
            arm.begin()
            while not self._over.is_set():
                arm.command(self._set_point)
                arm.tick()
                state = arm.read()
                state = replace(state, stamp=arm.monotonic(state.stamp))
                self._newest = _Newest(state, arm.left_out, time.monotonic())
                self._started.set()
        except Exception as error:
            self._failure = f"{type(error).__name__}: {error}"
            self._started.set()
