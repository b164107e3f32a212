"""Small sweeps for tests, of a function whose indices are known in closed form.

Ishigami and Homma (1990): f = sin x1 + A sin^2 x2 + B x3^4 sin x1, each x uniform from -pi to pi.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, cast

import numpy as np
import pytest

from pretouch.checks import Check, Checked
from pretouch_lab.engine import run_tasks
from pretouch_lab.sweep.design import Sweep, sweep_of
from pretouch_lab.sweep.measures import Measure, Numbers
from pretouch_lab.sweep.play import Run, opened
from pretouch_lab.sweep.setting import Setting
from pretouch_lab.sweep.streams import MEASURES

A, B = 7.0, 0.1
PI = "-3.141592653589793:3.141592653589793"
X = {"scene.x1": PI, "scene.x2": PI, "scene.x3": PI}
Coordinate = Annotated[float, Check(low=-3.2, high=3.2)]


@dataclass(frozen=True)
class IshigamiScene(Checked):
    """Where the function is evaluated."""

    x1: Coordinate = 0.0
    x2: Coordinate = 0.0
    x3: Coordinate = 0.0


def value(x1: float, x2: float, x3: float) -> float:
    return float(np.sin(x1) + A * np.sin(x2) ** 2 + B * x3**4 * np.sin(x1))


def _run(setting: Setting, _: None) -> Numbers:
    scene = cast(IshigamiScene, setting.scene)
    return {"value": value(scene.x1, scene.x2, scene.x3)}


ISHIGAMI = Measure(
    "ishigami", "a function whose indices are known", "paper", IshigamiScene(), {"value": "the function's value"},
    _run, lambda _: 0.002, (),
)  # fmt: skip


def register(patch: pytest.MonkeyPatch) -> None:
    """Make the function an experiment, in this process."""
    patch.setitem(MEASURES, ISHIGAMI.name, ISHIGAMI)


def ishigami(samples: int = 8, design: str = "sobol", arms: int = 1) -> Sweep:
    return sweep_of("ishigami", X, {}, design=design, samples=samples, arms=arms)


def opened_ishigami(out: Path, samples: int = 8) -> Run:
    return opened(ishigami(samples), out)


def play(run: Run, out: Path) -> None:
    run_tasks(run.tasks, out, lambda _: None, processes=1)
