"""Small sweeps for tests, of a function whose indices are known in closed form.

Ishigami and Homma (1990): f = sin x1 + A sin^2 x2 + B x3^4 sin x1, each x uniform from -pi to pi.
"""

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, cast

import numpy as np
import pytest

from pretouch.checks import Check, Checked, NonNegative
from pretouch_lab.sweep import cluster
from pretouch_lab.sweep import run as here
from pretouch_lab.sweep import work as jobs
from pretouch_lab.sweep.definition import Asked, Sweep, sweep_of
from pretouch_lab.sweep.measures import Measure, Numbers
from pretouch_lab.sweep.registry import MEASURES
from pretouch_lab.sweep.run import Run, opened
from pretouch_lab.sweep.setting import Setting

A, B = 7.0, 0.1
PI = "-3.141592653589793:3.141592653589793"
X = {"scene.x1": PI, "scene.x2": PI, "scene.x3": PI}
Coordinate = Annotated[float, Check(low=-3.2, high=3.2)]


@dataclass(frozen=True)
class IshigamiScene(Checked):
    """Where the function is evaluated, and how long that takes at least [s]."""

    x1: Coordinate = 0.0
    x2: Coordinate = 0.0
    x3: Coordinate = 0.0
    pause_s: NonNegative = 0.0


def value(x1: float, x2: float, x3: float) -> float:
    return float(np.sin(x1) + A * np.sin(x2) ** 2 + B * x3**4 * np.sin(x1))


def _run(setting: Setting, _: None) -> Numbers:
    scene = cast(IshigamiScene, setting.scene)
    if scene.pause_s > 0:
        time.sleep(scene.pause_s)
    return {"value": value(scene.x1, scene.x2, scene.x3)}


ISHIGAMI = Measure(
    "ishigami", "a function whose indices are known", "paper", IshigamiScene(), {"value": "the function's value"},
    _run, lambda s: 0.002 + cast(IshigamiScene, s.scene).pause_s, (),
)  # fmt: skip


def register(patch: pytest.MonkeyPatch) -> None:
    """Make the function an experiment, here and in workers."""
    patch.setitem(MEASURES, ISHIGAMI.name, ISHIGAMI)
    for engine in (here, cluster):
        patch.setattr(engine, "work", work)


def work(text: str) -> str:
    """Play a job in a worker, which starts without the experiments of tests."""
    MEASURES.setdefault(ISHIGAMI.name, ISHIGAMI)
    return jobs.work(text)


def ishigami(samples: int = 8, pause_s: str = "0", design: str = "sobol", arms: int = 1) -> Sweep:
    return sweep_of(Asked("ishigami", X, fix={"scene.pause_s": pause_s}, design=design, samples=samples, arms=arms))


def opened_ishigami(out: Path, samples: int = 8, pause_s: str = "0") -> Run:
    return opened(ishigami(samples, pause_s), out)


def files(run: Run) -> list[Path]:
    return sorted((run.folder / "cells").glob("*.json"))


def ignore(_cost: float) -> None:
    pass
