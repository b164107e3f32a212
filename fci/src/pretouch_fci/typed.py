"""Input of a person or a program in the terminal while an arm is served: pushes, and the arm's buttons."""

import os
import select
from collections.abc import Callable
from functools import partial
from typing import TextIO

from pretouch.errors import ParameterError
from pretouch_fci.arm import ServedArm
from pretouch_fci.pushes import typed_push

say = partial(print, flush=True)
_BUTTONS: dict[str, Callable[[ServedArm], None]] = {
    "stop": ServedArm.press_stop,
    "release": lambda arm: arm.press_stop(False),
    "guide": ServedArm.press_guiding,
    "let go": lambda arm: arm.press_guiding(False),
}
"""Words for the user stop and the buttons at the flange."""
HELP = (
    "Type +x, -x, +y, -y, +z or -z and Enter to push the hand, or a force such as 0,15,0 [N]; stop presses the user"
    " stop, release releases it; guide presses the buttons at the flange, let go releases them; time tells the arm's"
    " time."
)


class TypedPushes:
    """Pushes that a person at the terminal types, one a line, or a program writes."""

    def __init__(self, arm: ServedArm, source: TextIO, program: bool = False, lockstep: bool = False) -> None:
        """Take the arm that is pushed, and what is typed at: a terminal, or a pipe of a `program`, which ends it.

        In `lockstep` nothing is done while somebody leads the arm, whose time passes at the machine's own speed.
        """
        self._arm, self._text, self._program, self._lockstep = arm, b"", program, lockstep
        self._lines: list[str] = []
        self._descriptor = source.fileno() if program or source.isatty() else -1

    @property
    def possible(self) -> bool:
        """True if there is an input to listen to."""
        return self._descriptor >= 0

    def take(self) -> bool:
        """Have what was typed come; True once the program that typed has gone."""
        if self.possible and not self._lines and select.select([self._descriptor], [], [], 0)[0]:
            self._read()
        while self._lines and self._ready:
            self._do(self._lines.pop(0).strip())
        return self._program and not self.possible and not self._lines

    def _read(self) -> None:
        """Take in lines; what stands behind the last end is one at the end of all."""
        read = os.read(self._descriptor, 4096)
        *lines, self._text = (self._text + (read or b"\n")).split(b"\n")
        self._lines = [line.decode(errors="replace") for line in lines if line.strip()]
        if not read:
            self._descriptor = -1

    @property
    def _ready(self) -> bool:
        # while the arm still swings after a motion, its time would depend on when the line arrived
        return self._arm.moving or self._arm.settled or (self._arm.led and not self._lockstep)

    def _do(self, line: str) -> None:
        now = self._arm.pushes.now
        if line in _BUTTONS:
            _BUTTONS[line](self._arm)
        elif line == "time":
            say(f"The arm's time is {now:.3f} s.")
        else:
            try:
                self._arm.pushes.add(typed_push(line, now))
            except ParameterError as error:
                say(str(error))
