"""Small sweeps for tests."""

from pathlib import Path

from pretouch_lab.sweep.definition import Sweep, sweep_of
from pretouch_lab.sweep.run import Run, opened

PI = "-3.141592653589793:3.141592653589793"
X = {"scene.x1": PI, "scene.x2": PI, "scene.x3": PI}


def ishigami(samples: int = 8, pause_s: str = "0", design: str = "sobol", arms: int = 1) -> Sweep:
    return sweep_of("ishigami", X, fix={"scene.pause_s": pause_s}, design=design, samples=samples, arms=arms)


def opened_ishigami(out: Path, samples: int = 8, pause_s: str = "0") -> Run:
    return opened(ishigami(samples, pause_s), out)


def files(run: Run) -> list[Path]:
    return sorted((run.folder / "cells").glob("*.json"))


def ignore(_cost: float) -> None:
    pass
