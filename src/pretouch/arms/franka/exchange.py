"""Shared memory between a program and the process of an arm: commands, feedback, and timing of the line."""

from dataclasses import dataclass, field
from enum import IntEnum

from pretouch.arms.franka.limiter import PERIOD_S
from pretouch.arms.franka.state import JOINTS, FrankaState
from pretouch.loop import Durations, spread_table
from pretouch.units.shared_memory import Mailbox
from pretouch.values import value

_MOST = 65_536
"""Most bytes of feedback, of which a state takes 2000 and the vendor's error names 4000, and of a report, 12 000."""


class ArmRequest(IntEnum):
    """Request of the program to the arm."""

    WAIT = 0
    """Nothing."""
    MOVE = 1
    """Follow the set-points."""
    END = 2
    """Come to rest and end the motion."""
    RECOVER = 3
    """Leave the mode "reflex"."""
    QUIT = 4
    """End the motion, if there is one, and then the process."""


@value
class ArmCommand:
    """Command of the program; the newest one counts."""

    number: int
    """Number of the request; a new number asks again."""
    request: ArmRequest
    stamp: float
    """Instant of the set-point, by `time.monotonic` [s]."""
    qd: list[float]
    """(7,) set-point [rad/s]."""


@value
class Feedback:
    """Report of the process."""

    stamp: float
    """Arrival of the state, by `time.monotonic` [s]."""
    answered: int
    """Number of the last request that was carried out; a motion counts from its first state on."""
    moving: bool
    """True if a motion is running."""
    trouble: str
    """A sentence on what went wrong with that request, or ''."""
    state: FrankaState


@dataclass
class Communication:
    """Timing of the line to the arm in all motions so far."""

    cycles: int = 0
    """States that were answered with a command."""
    lost_states: int = 0
    """States of the arm that never came, or too late."""
    longest_gap: float = 0.0
    """Longest time between two states, by the arm's clock [s]."""
    reseeds: int = 0
    """Number of times that the arm's desired velocity differed from the one sent: commands were lost."""
    success_rate: float = 1.0
    """Smallest share of 100 commands in a row that reached the arm in time, once a hundred were sent."""
    stale: int = 0
    """Number of times that set-points became stale while the arm moved, so that it was brought to rest."""
    answers: Durations = field(default_factory=Durations)
    """Times from a state to the command for it, in this process [s]."""
    in_motion: int = 0
    """States of the motion that runs."""

    def answered(self, since: float, success_rate: float, took: float) -> None:
        """Count a state that came `since` [s] after the one before, and was answered after `took` [s]."""
        self.cycles += 1
        self.in_motion += 1
        self.answers.add(took)
        if self.in_motion > 1:
            self.lost_states += max(round(since / PERIOD_S) - 1, 0)
            self.longest_gap = max(self.longest_gap, since)
        if self.in_motion > 100:
            self.success_rate = min(self.success_rate, success_rate)

    def __str__(self) -> str:
        share = 100 * self.lost_states / max(self.cycles + self.lost_states, 1)
        return (
            f"{self.cycles} states answered, {self.lost_states} lost ({share:.2f} %), longest gap"
            f" {self.longest_gap * 1e3:.0f} ms; commands lost {self.reseeds} times, success rate at least"
            f" {100 * self.success_rate:.0f} %; set-points stale {self.stale} times.\n"
            + spread_table({"answer": self.answers.spread()})
        )


class Mailboxes:
    """Mailboxes in both directions. Passed to a spawned process, they are the same mailboxes there."""

    def __init__(self) -> None:
        self.commands = Mailbox(_MOST, ArmCommand(0, ArmRequest.WAIT, 0.0, [0.0] * JOINTS))
        self.feedback, self.report = Mailbox[Feedback | None](_MOST, None), Mailbox(_MOST, Communication())
