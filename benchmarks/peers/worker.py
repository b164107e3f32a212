"""One environment's contenders, in a process of its own: solves what it is told to over its standard input.

    python -m benchmarks.peers.worker MODULE FOLDER

A line asks for one block of one contender and number of points, as JSON; a line answers. Nothing else of a worker runs
meanwhile, and no other worker does.
"""

import gc
import importlib
import json
import sys
import time
import warnings
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from benchmarks.peers.problem import Problem, load

_WARM = 5
"""Solves before each block that are not counted: the process has slept, its caches are cold."""


class Worker:
    """The contenders of a module, made when they are first asked for."""

    def __init__(self, module: ModuleType, folder: Path) -> None:
        self.module, self.folder = module, folder
        self.problem = cache(self._problem)
        self.contender = cache(self._contender)

    def _problem(self, points: int) -> Problem:
        return load(self.folder / f"{points}.npz")

    def _contender(self, name: str, points: int) -> Any:
        return self.module.CONTENDERS[name](self.problem(points))

    def answers(self, contender: str, points: int, file: str) -> dict[str, Any]:
        """Solve all snapshots once and write the joint velocities (S, n), NaN where there is no answer."""
        made, problem = self.contender(contender, points), self.problem(points)
        found = np.full_like(problem.q, np.nan)
        for s in range(len(found)):
            answer = _solved(made, s)
            found[s] = np.nan if answer is None else answer
        np.save(file, found)
        return {"unsolved": int(np.isnan(found[:, 0]).sum())}

    def block(self, contender: str, points: int, start: int, count: int, budget: float) -> dict[str, Any]:
        """CPU times [ns] of up to `count` snapshots from `start` on, ended by the budget [s] but never empty."""
        made, total = self.contender(contender, points), len(self.problem(points).q)
        begun = time.process_time()
        for s in range(start, start + _WARM):
            _solved(made, s % total)
            if time.process_time() - begun > budget:
                break
        gc.collect()
        gc.freeze()
        gc.disable()
        begun, spent, unsolved = time.process_time(), [], 0
        for s in range(start, start + count):
            before = time.process_time_ns()
            found = _solved(made, s % total)
            spent.append(time.process_time_ns() - before)
            unsolved += found is None
            if time.process_time() - begun > budget:
                break
        gc.enable()
        gc.unfreeze()
        return {"ns": spent, "unsolved": unsolved}

    def about(self) -> dict[str, Any]:
        """Versions and contenders."""
        return {"versions": self.module.VERSIONS, "contenders": list(self.module.CONTENDERS)}


def _solved(contender: Any, s: int) -> Any:
    try:
        return contender.solve(s)
    except Exception as error:
        # RuntimeError is what our contenders raise without an answer; mink and pink have exceptions of their own
        if isinstance(error, RuntimeError) or type(error).__name__ == "NoSolutionFound":
            return None
        raise


def main() -> None:
    """Answer line by line until the input ends."""
    warnings.simplefilter("ignore")
    answer, sys.stdout = sys.stdout, sys.stderr  # what a package prints must not be taken for an answer
    worker = Worker(importlib.import_module(f"benchmarks.peers.{sys.argv[1]}"), Path(sys.argv[2]))
    for line in sys.stdin:
        request = json.loads(line)
        print(json.dumps(getattr(worker, request.pop("do"))(**request)), file=answer, flush=True)


if __name__ == "__main__":
    main()
