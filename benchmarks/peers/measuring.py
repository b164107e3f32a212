"""Workers, and the order in which they are asked: round robin in short blocks, so that drift hits all alike."""

import json
import statistics
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks.peers.environments import ROOT, single_threaded

REFERENCE = "ours, rows"
TOLERANCE = 1e-6
"""Largest difference of two answers to the same problem [rad/s]."""
_FOR_P999 = 1000
"""Samples below which no p99.9 is given."""


@dataclass(frozen=True)
class Plan:
    """What is measured."""

    points: tuple[int, ...]
    snapshots: int
    rounds: int
    block: int
    """Largest number of snapshots in a block."""
    budget: float
    """CPU time of a block beyond which it ends [s]."""


@dataclass
class Result:
    """One contender with one number of points."""

    contender: str
    points: int
    blocks: list[list[int]] = field(default_factory=list)
    """CPU times of each round [ns]."""
    unsolved: int = 0
    """Counted solves without an answer."""
    difference: float | None = None
    """Largest difference from our answer over all snapshots [rad/s]; None where the problem is another one."""

    def summary(self, reference: "Result") -> dict[str, Any]:
        """Figures of the table; `ratio` is the median over the rounds of the ratio of a round's medians."""
        every = np.concatenate(self.blocks) / 1e3
        pairs = zip(self.blocks, reference.blocks, strict=True)
        return {
            "contender": self.contender, "points": self.points, "samples": len(every),
            "median_us": float(np.median(every)), "max_us": float(every.max()),
            "p999_us": float(np.percentile(every, 99.9)) if len(every) >= _FOR_P999 else None,
            "ratio": statistics.median(statistics.median(a) / statistics.median(b) for a, b in pairs),
            "unsolved": self.unsolved, "difference_rad_s": self.difference,
        }  # fmt: skip


class Worker:
    """A process with the contenders of one environment."""

    def __init__(self, python: str, module: str, folder: Path) -> None:
        command = [python, "-m", "benchmarks.peers.worker", module, str(folder)]
        self.process = subprocess.Popen(  # noqa: S603, our own arguments
            command, cwd=ROOT, env=single_threaded(), stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        self.module = module

    def ask(self, do: str, **arguments: object) -> dict[str, Any]:
        """Send a request and wait for its answer."""
        try:
            self.process.stdin.write(json.dumps({"do": do, **arguments}) + "\n")
            self.process.stdin.flush()
            line = self.process.stdout.readline()
        except BrokenPipeError:
            line = ""
        if not line:
            raise SystemExit(f"The process of {self.module} ended: its message stands above.")
        answer: dict[str, Any] = json.loads(line)
        return answer


@contextmanager
def workers(pythons: dict[str, str], folder: Path) -> Iterator[list[Worker]]:
    """Start a worker for each module with its interpreter; end them all in the end."""
    started: list[Worker] = []
    try:
        for module, python in pythons.items():
            started.append(Worker(python, module, folder))
        yield started
    finally:
        for worker in started:
            worker.process.terminate()
            worker.process.wait()


def compare(plan: Plan, asked: dict[str, Worker], folder: Path) -> dict[tuple[str, int], Result]:
    """Check first that equal problems get equal answers, then measure."""
    results = {(name, k): Result(name, k) for k in plan.points for name in asked}
    for k in plan.points:
        answers = {name: _answers(asked[name], name, k, folder) for name in asked if name.endswith("rows")}
        ours = answers.pop(REFERENCE)
        for name, found in answers.items():
            results[name, k].difference = float(np.abs(found - ours).max())
    for turn in range(plan.rounds):
        names = list(asked) if turn % 2 == 0 else list(asked)[::-1]
        for k in plan.points:
            for name in names:
                start = turn * plan.snapshots // plan.rounds
                block = asked[name].ask(
                    "block", contender=name, points=k, start=start, count=plan.block, budget=plan.budget
                )
                results[name, k].blocks.append(block["ns"])
                results[name, k].unsolved += block["unsolved"]
        print(f"round {turn + 1} of {plan.rounds}", file=sys.stderr, end="\r", flush=True)
    return results


def _answers(worker: Worker, name: str, points: int, folder: Path) -> Any:
    file = folder / "answers.npy"
    worker.ask("answers", contender=name, points=points, file=str(file))
    return np.load(file)


def disagreements(results: dict[tuple[str, int], Result]) -> list[str]:
    """Say where an answer differs from ours by more than the tolerance, or is missing (NaN)."""
    return [
        f"{r.contender} at {r.points} points differs by {r.difference:.1e} rad/s (tolerance {TOLERANCE:g})"
        for r in results.values()
        if r.difference is not None and not r.difference <= TOLERANCE
    ]
