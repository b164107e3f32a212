"""What the vendor's two libraries have in common: all but how to connect, and how to run a motion."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, ClassVar, Literal, Self

from pretouch.arms.franka import errors
from pretouch.arms.franka.arm_lock import ArmLock
from pretouch.arms.franka.client import StateCallback
from pretouch.arms.franka.collision import CollisionBehavior
from pretouch.arms.franka.state import FrankaState, franka_state

_RECOVERING = ("reflex", "automatic error recovery")
_STATES_AFTER = 500
"""States, one each millisecond, in which an arm that was told to recover must be seen to have done so."""


class VendorClient:
    """One connection to an arm, for one thread; a context manager. A subclass connects by one of the libraries.

    The libraries hold the interpreter's lock while they wait, so no other thread of the process runs during a motion.
    """

    kind: Literal["panda", "fr3"]
    library: ClassVar[Any]
    failures: ClassVar[tuple[type[Exception], ...]] = (RuntimeError,)
    """What the library raises."""

    def __init__(self, address: str, lock: ArmLock) -> None:
        self._address, self._lock = address, lock
        began = time.monotonic()
        try:
            self._robot: Any = self.library.Robot(address, self.library.RealtimeConfig.kIgnore)
        except Exception as error:
            errors.raise_not_connected(address, self.kind, began, error)

    def read(self) -> FrankaState:
        """Wait for the next state, while no motion runs."""
        with self._translated_errors("send its state"):
            return franka_state(self._robot.read_once())

    def control(self, on_state: StateCallback) -> None:
        """Run a joint velocity motion, asking `on_state` for a command in each millisecond, until it is finished.

        The library's own rate limiter and low-pass filter are off: what `on_state` answers is what the arm gets. An
        exception of `on_state` stops the arm at once, as hard as it can, and is raised here. Raises MotionAborted
        (`errors`) if the arm ended the motion, and another RobotError if it is in no mode to move.
        """
        errors.check_ready(self.read(), self._address)
        raised: list[BaseException] = []

        def answer(raw: Any, since: Any) -> Any:
            try:
                qd, finished = on_state(franka_state(raw), since.to_sec())
            except BaseException as error:
                raised.append(error)
                raise
            command = self.library.JointVelocities(qd.tolist())
            command.motion_finished = finished
            return command

        try:
            self._move(answer)
        except self.failures as error:
            if raised:
                raise raised[0] from None
            errors.raise_aborted(self._address, error)
        finally:
            raised.clear()  # the exception holds this frame, and with it the motion

    def _move(self, answer: Any) -> None:
        """Run the library's loop; `answer` takes its state and duration and returns its command."""
        raise NotImplementedError

    def set_collision_behavior(self, behavior: CollisionBehavior) -> None:
        """Tell the arm from which forces on it reports a contact, and from which it stops."""
        with self._translated_errors("accept the collision behaviour"):
            self._robot.set_collision_behavior(*behavior.in_order())

    def recover(self) -> None:
        """Leave the mode "reflex", as pressing the button in Desk does; a RobotError if no state says that it has.

        The answer may overtake states.
        """
        with self._translated_errors("recover"):
            self._robot.automatic_error_recovery()
        for _ in range(_STATES_AFTER):
            if (state := self.read()).mode not in _RECOVERING:
                return
        errors.raise_not_recovered(state, self._address)

    def close(self) -> None:
        """Let the arm be used by somebody else."""
        self._robot = None
        self._lock.release()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @contextmanager
    def _translated_errors(self, what: str) -> Iterator[None]:
        """Turn what the library raises into a RobotError that says what the arm did not do."""
        try:
            yield
        except self.failures as error:
            errors.raise_refused(self._address, what, error)
