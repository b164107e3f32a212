"""How well the process kept up with the arm."""

from dataclasses import dataclass

from pretouch.arms.franka.limiter import PERIOD_S
from pretouch.loop import Durations, Spread

_NONE = Spread(0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class CommunicationReport:
    """What was seen of the line to the arm, in all motions so far."""

    cycles: int = 0
    """States that were answered with a command."""
    lost_states: int = 0
    """States of the arm that never came, or too late."""
    longest_gap: float = 0.0
    """Longest time between two states, by the arm's clock [s]."""
    reseeds: int = 0
    """How often the arm's desired velocity was not what it had been told: commands were lost."""
    success_rate: float = 1.0
    """Smallest share of 100 commands in a row that reached the arm in time, once a hundred were sent."""
    stale: int = 0
    """How often the set-points went stale while the arm moved, so that it was brought to rest."""
    answer: Spread = _NONE
    """Time from a state to the command for it, in this process [s]."""

    def __str__(self) -> str:
        share = 100 * self.lost_states / max(self.cycles + self.lost_states, 1)
        a = self.answer
        return "\n".join((
            f"{self.cycles} states answered, {self.lost_states} lost ({share:.2f} %), longest gap"
            f" {self.longest_gap * 1e3:.0f} ms; commands lost {self.reseeds} times, success rate at least"
            f" {100 * self.success_rate:.0f} %; set-points stale {self.stale} times.",
            f"{'[us]':14}{'median':>10}{'99 %':>10}{'99.9 %':>10}{'largest':>10}",
            f"{'answer':14}" + "".join(f"{1e6 * t:10.0f}" for t in (a.median, a.p99, a.p999, a.max)),
        ))  # fmt: skip


class Communication:
    """Counts what a `CommunicationReport` tells."""

    def __init__(self) -> None:
        self.stale = self.reseeds = self._cycles = self._lost = self._in_motion = 0
        self._gap, self._rate = 0.0, 1.0
        self._answers = Durations()

    def begin(self) -> None:
        """Begin another motion."""
        self._in_motion = 0

    def answered(self, since: float, success_rate: float, took: float) -> None:
        """Count a state that came `since` [s] after the one before, and was answered after `took` [s]."""
        self._cycles += 1
        self._in_motion += 1
        self._answers.add(took)
        if self._in_motion > 1:
            self._lost += max(round(since / PERIOD_S) - 1, 0)
            self._gap = max(self._gap, since)
        if self._in_motion > 100:
            self._rate = min(self._rate, success_rate)

    def report(self) -> CommunicationReport:
        """Return what was counted."""
        return CommunicationReport(
            self._cycles, self._lost, self._gap, self.reseeds, self._rate, self.stale, self._answers.spread()
        )
