"""A recording, recomputed: whether each of its control steps follows from its inputs."""

import math
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import Any

import numpy as np

from pretouch.control.path import Path
from pretouch.controller import Controller, ControllerState
from pretouch.recording.reader import MISSING_INPUTS, Recorded
from pretouch.recording.ros import encode, hints_of, is_record
from pretouch.recording.run import Run, versions
from pretouch.records import Flat

TOLERANCE = 1e-6
"""Largest difference of a number, in its SI unit, that other versions or another machine may make. Of numbers beyond 1
in size it is that part of them."""

_SENTENCES = frozenset({"reason", "detail", "status"})
"""Texts with numbers in them, which rounding may change, and words, which versions may: compared only exactly."""


@dataclass(frozen=True)
class Difference:
    """One number or text that was recomputed otherwise than it was recorded."""

    field: str
    """Name of the field, e.g. `qp.qd[3]`; the controller's state before a step begins with `state before`."""
    recorded: Any
    recomputed: Any
    size: float
    """Size in the field's unit; infinite for a value that is no number, or a number on one side only."""
    number: int = -1
    """Number of the step, from 0."""
    stamp: float = math.nan
    """Stamp of the step [s]."""


def differing(recorded: Any, recomputed: Any, exact: bool, field: str = "") -> Iterator[Difference]:
    """Yield each part of a value that differs: in any bit if `exact`, else by more than `TOLERANCE`.

    NaN is the same as NaN.
    """
    a, b = recorded, recomputed
    if type(a) is not type(b) and not (isinstance(a, float | int) and isinstance(b, float | int)):
        yield Difference(field, a, b, math.inf)
    elif is_record(type(a)):
        kind: type = type(a)
        for name, _ in hints_of(kind):
            if exact or name not in _SENTENCES:
                where = f"{field}.{name}" if field else name
                yield from differing(getattr(a, name), getattr(b, name), exact, where)
    elif isinstance(a, Flat):
        for path in b.places:
            yield from differing(Flat(a.blocks, b.places).get(path), b.get(path), exact, f"{field}.{path}")
    elif isinstance(a, tuple) and len(a) == len(b):
        for i, (one, other) in enumerate(zip(a, b, strict=True)):
            yield from differing(one, other, exact, f"{field}[{i}]")
    elif isinstance(a, float | np.ndarray):
        yield from _in_arrays(np.asarray(a), np.asarray(b), exact, field)
    elif a != b:
        yield Difference(field, a.value if isinstance(a, Enum) else a, b.value if isinstance(b, Enum) else b, math.inf)


def _in_arrays(a: Any, b: Any, exact: bool, field: str) -> Iterator[Difference]:
    """Compare arrays element by element."""
    if a.shape != b.shape:
        yield Difference(field, f"shape {a.shape}", f"shape {b.shape}", math.inf)
        return
    if a.dtype != np.float64:
        differ = np.asarray(a != b)
        size = np.where(differ, math.inf, 0.0)
    else:
        with np.errstate(invalid="ignore", over="ignore"):
            size = np.abs(a - b)
        differ = (a != b) | (np.signbit(a) != np.signbit(b)) if exact else size > TOLERANCE * np.maximum(1.0, np.abs(a))
        neither = np.isnan(a) & np.isnan(b)
        one_only = (np.isfinite(a) != np.isfinite(b)) | (~np.isfinite(a) & (a != b))
        differ, size = (differ | one_only) & ~neither, np.where(one_only, math.inf, size)
    for place in np.argwhere(differ):
        at = tuple(place.tolist())
        where = f"{field}[{', '.join(map(str, at))}]" if at else field
        yield Difference(where, a[at].item(), b[at].item(), float(size[at]))


_NO_SNAPSHOT = "no snapshot before"
_NO_INPUTS = "inputs that could not be kept"
_MISSING = "no inputs in the file"
_GONE = "gone missing"


@dataclass
class Verdict:
    """Result of recomputing a recording."""

    steps: int
    """Number of steps in the recording."""
    elsewhere: str
    """Sentence on a recording by other versions or another machine: bits need not be equal; '' otherwise."""
    checked: int = 0
    """Recomputed and compared."""
    skipped: Counter[str] = field(default_factory=Counter)
    """Steps that could not be recomputed, by the reason."""
    differing: int = 0
    """Steps that differ."""
    first: Difference | None = None
    largest: float = 0.0
    """Largest difference of a number, in its field's SI unit; infinite if a mode, a text or a shape differs."""
    largest_field: str = ""

    def note(self, number: int, stamp: float, parts: list[Difference]) -> None:
        """Take in what differs in one step."""
        if not parts:
            return
        self.differing += 1
        worst = max(parts, key=lambda part: part.size)
        if not self.largest_field or worst.size > self.largest:
            self.largest, self.largest_field = worst.size, worst.field
        if self.first is None:
            self.first = replace(parts[0], number=number, stamp=stamp)

    @property
    def exact(self) -> bool:
        """True if every bit was compared."""
        return not self.elsewhere

    @property
    def agrees(self) -> bool:
        """True if there was something to compare, nothing differs, and the file lacks nothing."""
        return self.checked > 0 and self.first is None and not {_MISSING, _GONE} & set(self.skipped)

    @property
    def sentence(self) -> str:
        """All this as a sentence or two."""
        if self.first is not None:
            size = "one of kind" if math.isinf(self.largest) else f"{self.largest:.3g}"
            result = (
                f"{self.differing} of {self.checked} steps differ when they are recomputed; the first is step"
                f" {self.first.number} at {self.first.stamp:.3f} s: {self.first.field} was {self.first.recorded},"
                f" recomputed {self.first.recomputed}. The largest difference is {size}, of"
                f" {self.largest_field}."
            )
        elif self.checked:
            how = "bit for bit" if self.exact else f"within {TOLERANCE:g} of their SI units"
            one, more = "The only step was recomputed and is", f"All {self.checked} steps were recomputed and are"
            result = f"{one if self.checked == 1 else more} the same {how}."
        else:
            result = "No step could be recomputed."
        skipped = "; ".join(f"{n} {'step has' if n == 1 else 'steps have'} {why}" for why, n in self.skipped.items())
        return " ".join(filter(None, (result, f"{skipped}." if skipped else "", self.elsewhere)))


def verify(
    recorded: Recorded, progress: Callable[[int], None] = lambda done: None, path: Path | None = None
) -> Verdict:
    """Recompute each step from the snapshots and inputs, and compare all of it with what was recorded.

    With the versions and on the kind of machine that made it, bit for bit, and the state is carried from snapshot to
    snapshot, where it is compared too. Otherwise within `TOLERANCE`, beginning anew at each snapshot, and
    without the sentences. `progress` gets how many steps are done; `path` stands for one of your own class.
    """
    verdict = Verdict(len(recorded), _elsewhere(recorded.runs))
    exact = [run.versions == versions() for run in recorded.runs]
    controllers: dict[int, Controller] = {}
    state: ControllerState | None = None
    before: tuple[int, int] | None = None
    for i in range(len(recorded)):
        cycle = recorded[i]
        number = cycle.number
        if before is not None and number > before[1] + 1:
            verdict.skipped[_GONE] += number - before[1] - 1
        if before != (cycle.run, number - 1):
            state = None
        before = cycle.run, number
        if cycle.run not in controllers:
            controllers = {cycle.run: recorded.runs[cycle.run].controller(path)}
        parts: list[Difference] = []
        if cycle.snapshot is not None:
            if state is not None and exact[cycle.run] and not cycle.anew:
                parts += differing(cycle.snapshot, state, True, "state before")
            state = cycle.snapshot
        if state is None or cycle.inputs is None:
            missing = _MISSING if cycle.unreadable == MISSING_INPUTS else _NO_INPUTS
            verdict.skipped[_NO_SNAPSHOT if cycle.inputs is not None else missing] += 1
            state = None
        else:
            step, state = controllers[cycle.run].step(state, cycle.inputs)
            if not exact[cycle.run] or encode(step, number) != recorded.step_data(i):
                parts += differing(cycle.step, step, exact[cycle.run])
            verdict.checked += 1
        verdict.note(number, cycle.step.stamp, parts)
        progress(i + 1)
    return verdict


def _elsewhere(runs: tuple[Run, ...]) -> str:
    """Say what differs between where a recording was made and here, or ''."""
    here = versions()
    differ = {
        name: (run.versions.get(name, "unknown"), here.get(name, "unknown"))
        for run in runs
        for name in sorted({*run.versions, *here})
        if run.versions.get(name) != here.get(name)
    }
    listed = ", ".join(f"{name} {there}, here {now}" for name, (there, now) in differ.items())
    return f"It was made with {listed}: sums may round otherwise." if differ else ""
