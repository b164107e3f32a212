"""A simulated arm that moves on by itself in real time, as a real one does, whoever looks at it."""

import threading
import time
from dataclasses import replace
from types import TracebackType
from typing import NamedTuple, Self

import numpy as np

from pretouch.arms.simulated.arm import SimulatedArm, SimulateOptions
from pretouch.errors import RobotError
from pretouch.sim.scene import SceneSpec
from pretouch.types import FloatArray, RobotState

_PERIOD_S = 0.002
"""Time in which a command reaches the arm, and between two of its states [s]."""
_STUCK_S = 1.0
"""A simulation that has not moved on for so long [s] is not a slow one."""
_LAG_S = 0.03
"""How much older than now a state is for a controller [s]: a machine that is late for a moment makes up for it."""
_START_S = 120.0
"""Longest time it may take to begin [s]: everything may have to be compiled first."""
_PUSH_N, _PUSH_AFTER_S, _PUSH_S = 14.0, 0.5, 1.5
"""What a simulated person does when asked to push the hand."""


class _Newest(NamedTuple):
    """What the simulation has come to: one value, for another thread reads it."""

    state: RobotState
    """Stamped with when it was due."""
    left_out: float
    """Time that was left out before it [s]."""
    instant: float
    """When it was there [s]."""


class ThreadedArm:
    """The port `Arm`. A context manager, for its thread and sockets."""

    def __init__(self, options: SimulateOptions, q: FloatArray, scene: SceneSpec) -> None:
        """Let an arm stand at q (n,) [rad] in a scene. `options.model` must be used by nobody else: one thread each."""
        self.name = f"simulated {options.model.description.name}"
        self._arm = SimulatedArm(options, q, _PERIOD_S, scene)
        self._still = np.zeros(options.model.n)
        self._set_point = self._still
        self._begun, self._over = False, threading.Event()
        self._newest: _Newest | None = None
        self._started, self._failure = threading.Event(), ""
        self._push, self._push_span = np.zeros(3), (np.inf, np.inf)
        plant = self._arm.plant
        self._applied = plant.mj_data.xfrc_applied[options.model.ee, :3]
        plant.before_each_step(self._apply)
        self._thread = threading.Thread(target=self._live, daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        if not self._started.wait(_START_S) or self._failure:
            raise RobotError(f"The simulation did not start: {self._failure or 'it took too long'}.")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._over.set()
        self._thread.join()
        self._arm.__exit__(kind, error, trace)

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
        """Nothing is ever against it."""
        return ()

    def begin(self) -> None:
        """Take commands from here on."""
        self._set_point, self._begun = self._still, True

    def end(self) -> None:
        """Take no more."""
        self._set_point, self._begun = self._still, False

    def report(self) -> str:
        """Say whether the machine was fast enough."""
        late = self._arm.clock.left_out
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
                self._newest = _Newest(state, arm.clock.left_out, time.monotonic())
                self._started.set()
        except Exception as error:
            self._failure = f"{type(error).__name__}: {error}"
            self._started.set()
