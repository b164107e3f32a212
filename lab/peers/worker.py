"""Contenders of one environment in a process of its own, which answers requests on its standard input.

    python -m lab.peers.worker MODULE FOLDER

A line asks for one block of one contender and number of points, as JSON; a line answers. Nothing else of a worker runs
meanwhile, and no other worker does. What fails ends it.
"""

import gc
import importlib
import json
import sys
import time
import warnings
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from lab.peers.problem import load

_WARM = 5
"""Uncounted solutions before each block: the process has slept, and its caches are cold."""


class Contenders:
    """Contenders of a module, built at the first request."""

    def __init__(self, module: str, folder: Path) -> None:
        self.module, self.folder = importlib.import_module(f"lab.peers.{module}_peer"), folder
        self.contender = cache(lambda name, points: self.module.CONTENDERS[name](load(folder / f"{points}.npz")))

    def about(self) -> dict[str, Any]:
        """Return versions and contenders."""
        return {"versions": self.module.VERSIONS, "contenders": list(self.module.CONTENDERS)}

    def answers(self, name: str, points: int, file: str) -> None:
        """Solve all snapshots once and write the joint velocities (S, n)."""
        contender = self.contender(name, points)
        np.save(file, np.array([contender.solve(s) for s in range(len(contender.problem.q))]))

    def block(self, name: str, points: int, start: int, budget_s: float) -> list[int]:
        """Return CPU times [ns] of at least one snapshot from `start` on, each at most once, within the budget."""
        contender = self.contender(name, points)
        total, spent, begin = len(contender.problem.q), list[int](), time.process_time()
        for s in range(start, start + _WARM):
            contender.solve(s % total)
            if time.process_time() - begin > budget_s:
                break
        gc.collect()
        gc.freeze()
        gc.disable()
        begin = time.process_time()
        for s in range(start, start + total):
            before = time.process_time_ns()
            contender.solve(s % total)
            spent.append(time.process_time_ns() - before)
            if time.process_time() - begin > budget_s:
                break
        gc.enable()
        gc.unfreeze()
        return spent


def main() -> None:
    """Answer line by line until the input ends."""
    warnings.simplefilter("ignore")
    answer, sys.stdout = sys.stdout, sys.stderr  # what a package prints must not be taken for an answer
    contenders = Contenders(sys.argv[1], Path(sys.argv[2]))
    for line in sys.stdin:
        request = json.loads(line)
        print(json.dumps(getattr(contenders, request.pop("do"))(**request)), file=answer, flush=True)


if __name__ == "__main__":
    main()
