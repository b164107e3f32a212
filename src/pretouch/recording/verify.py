"""A recording, recomputed: whether each of its control steps follows from its inputs."""

import math
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass

from pretouch.controller import Controller, ControllerState
from pretouch.recording.codec import encode_step
from pretouch.recording.difference import TOLERANCE, Part, differing
from pretouch.recording.reader import MISSING_INPUTS, Kept, Recorded
from pretouch.recording.setting import Run
from pretouch.recording.versions import versions

_NO_SNAPSHOT = "no snapshot before"
_NO_INPUTS = "inputs that could not be kept"
_MISSING = "no inputs in the file"
_GONE = "gone missing"


@dataclass(frozen=True)
class Difference:
    """The first thing recomputed otherwise than it was recorded."""

    number: int
    """Of the step, from 0."""
    stamp: float
    """Of the step [s]."""
    field: str
    """Of the step, e.g. `qp.qd[3]`; what the controller remembered before it begins with `state before`."""
    recorded: object
    recomputed: object


@dataclass(frozen=True)
class Verdict:
    """What recomputing a recording showed."""

    steps: int
    """In the recording."""
    checked: int
    """Recomputed and compared."""
    skipped: dict[str, int]
    """Steps that could not be recomputed, by the reason."""
    exact: bool
    """Whether every bit was compared: all was recorded by these versions on a machine like this."""
    differing: int
    """Steps that differ."""
    first: Difference | None
    largest: float
    """Largest difference of a number, in its field's SI unit; infinite if a mode, a text or a shape differs."""
    largest_field: str
    said: str
    """All this as a sentence or two."""

    @property
    def agrees(self) -> bool:
        """Whether there was something to compare, nothing differs, and nothing has gone missing from the file."""
        return self.checked > 0 and self.first is None and not {_MISSING, _GONE} & set(self.skipped)


class _Count:
    """What was found so far."""

    def __init__(self) -> None:
        self.checked = self.differing = 0
        self.skipped: Counter[str] = Counter()
        self.first: Difference | None = None
        self.largest, self.largest_field = 0.0, ""

    def note(self, number: int, stamp: float, parts: list[Part]) -> None:
        """Take in what differs in one step."""
        if not parts:
            return
        self.differing += 1
        worst = max(parts, key=lambda part: part.size)
        if not self.largest_field or worst.size > self.largest:
            self.largest, self.largest_field = worst.size, worst.field
        if self.first is None:
            part = parts[0]
            self.first = Difference(number, stamp, part.field, part.recorded, part.recomputed)


def verify(recorded: Recorded, progress: Callable[[int], None] = lambda done: None) -> Verdict:
    """Recompute each step from the snapshots and inputs, and compare all of it with what was recorded.

    With the versions and on the kind of machine that made it, bit for bit, and the state is carried from snapshot to
    snapshot, where it is compared too. Otherwise within `difference.TOLERANCE`, beginning anew at each snapshot, and
    without the sentences. `progress` is told how many steps are done.
    """
    count = _Count()
    exact = [run.versions == versions() for run in recorded.runs]
    controllers: dict[int, Controller] = {}
    state: ControllerState | None = None
    before: tuple[int, int] | None = None
    for i in range(len(recorded)):
        kept, number = recorded[i], recorded.number(i)
        if before is not None and number > before[1] + 1:
            count.skipped[_GONE] += number - before[1] - 1
        if before != (kept.run, number - 1):
            state = None
        before = kept.run, number
        if kept.run not in controllers:
            controllers = {kept.run: recorded.runs[kept.run].controller()}
        parts: list[Part] = []
        if kept.snapshot is not None:
            if state is not None and exact[kept.run] and not kept.anew:
                parts += differing(kept.snapshot, state, True, "state before")
            state = kept.snapshot
        if state is None or kept.inputs is None:
            count.skipped[_unchecked(recorded, i, kept)] += 1
            state = None
        else:
            step, state = controllers[kept.run].step(state, kept.inputs)
            if not exact[kept.run] or encode_step(number, step, recorded.tangent(i)) != recorded.step_data(i):
                parts += differing(kept.step, step, exact[kept.run])
            count.checked += 1
        count.note(number, kept.step.stamp, parts)
        progress(i + 1)
    return _verdict(recorded, count, all(exact))


def _unchecked(recorded: Recorded, i: int, kept: Kept) -> str:
    """Say what a step has that keeps it from being recomputed."""
    if kept.inputs is not None:
        return _NO_SNAPSHOT
    return _NO_INPUTS if recorded.unreadable(i) != MISSING_INPUTS else _MISSING


def _verdict(recorded: Recorded, count: _Count, exact: bool) -> Verdict:
    first, skipped = count.first, dict(count.skipped)
    how = "bit for bit" if exact else f"within {TOLERANCE:g} of their SI units"
    if first is not None:
        said = (
            f"{count.differing} of {count.checked} steps differ when they are recomputed; the first is step"
            f" {first.number} at {first.stamp:.3f} s: {first.field} was {first.recorded}, recomputed"
            f" {first.recomputed}. {_largest(count)}"
        )
    elif count.checked:
        said = f"{_all(count.checked)} recomputed and {'is' if count.checked == 1 else 'are'} the same {how}."
    else:
        said = "No step could be recomputed."
    if skipped:
        said += (
            " " + "; ".join(f"{n} {'step has' if n == 1 else 'steps have'} {why}" for why, n in skipped.items()) + "."
        )
    if not exact:
        said += f" {_otherwise(recorded.runs)}"
    return Verdict(
        len(recorded), count.checked, skipped, exact, count.differing, first, count.largest, count.largest_field, said
    )


def _all(checked: int) -> str:
    return "The only step was" if checked == 1 else f"All {checked} steps were"


def _largest(count: _Count) -> str:
    if math.isinf(count.largest):
        return f"The largest difference is one of kind, of {count.largest_field}."
    return f"The largest difference is {count.largest:.3g}, of {count.largest_field}."


def _otherwise(runs: tuple[Run, ...]) -> str:
    """Say what differs between where a recording was made and here."""
    here = versions()
    differ = {
        name: (run.versions.get(name, "unknown"), here.get(name, "unknown"))
        for run in runs
        for name in sorted({*run.versions, *here})
        if run.versions.get(name) != here.get(name)
    }
    shown = ", ".join(f"{name} {there}, here {now}" for name, (there, now) in differ.items())
    return f"It was made with {shown}: sums may round otherwise."
