"""How an arm is served."""

from dataclasses import dataclass
from typing import Annotated

from pretouch.checks import Check, Checked, NonNegative, Positive
from pretouch.errors import ParameterError
from pretouch_fci.wire import PORT


@dataclass(frozen=True)
class Drop:
    """Commands that are lost on purpose: the first `lost` of every `of`."""

    lost: int
    of: int

    def takes(self, number: int) -> bool:
        """Whether the command of a millisecond of the motion, from 0 on, is lost."""
        return number % self.of < self.lost


def drop_of(text: str) -> Drop:
    """Read N/M."""
    lost, slash, of = text.partition("/")
    if not (slash and lost.isdecimal() and of.isdecimal() and 0 < int(lost) < int(of)):
        raise ParameterError(f"--drop is {text!r}: give two numbers, such as 3/50 for 3 of 50 commands.")
    return Drop(int(lost), int(of))


@dataclass(frozen=True)
class ServeOptions(Checked):
    """Where to serve, and at which pace."""

    host: str = "127.0.0.1"
    """Address to serve at."""
    port: Annotated[int, Check(low=0, high=0xFFFF)] = PORT
    """TCP port; the vendor's clients know no other than the default. 0 lets the system choose one."""
    lockstep: bool = False
    """Whether the next state follows the command for the last one, and not the clock."""
    patience_s: Positive = 60.0
    """In lockstep, a command that has not arrived after this time is lost [s]."""
    grace_s: NonNegative = 0.01
    """In real time, how much longer than its millisecond a command of a motion is waited for, while time stands [s]. A
    robot waits for none; but on a machine shared with its client each would be late now and then."""
    drop: Drop | None = None
    """Commands to lose."""
    once: bool = False
    """Whether to end when the first client that was served has gone."""
