"""Small sweeps for tests, of a function whose indices are known in closed form.

Ishigami and Homma (1990): f = sin x1 + A sin^2 x2 + B x3^4 sin x1, each x uniform from -pi to pi.
"""

from dataclasses import dataclass
from typing import Annotated, cast

import numpy as np
import pytest

from pretouch.checks import Check, Checked
from pretouch.types import FloatArray
from pretouch_lab.run import Row
from pretouch_lab.sweep.design import Sweep, groups, points, sweep_of, trial, values_of
from pretouch_lab.sweep.measures import MEASURES, Measure, Numbers
from pretouch_lab.sweep.parameters import Setting

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
    "ishigami",
    "a function whose indices are known",
    "paper",
    IshigamiScene(),
    {"value": "the function's value"},
    _run,
    (),
)


def register(patch: pytest.MonkeyPatch) -> None:
    """Make the function an experiment, in this process."""
    patch.setitem(MEASURES, ISHIGAMI.name, ISHIGAMI)


def ishigami(samples: int = 8, design: str = "sobol", arms: int = 1) -> Sweep:
    return sweep_of("ishigami", X, {}, design=design, samples=samples, arms=arms)


def played(sweep: Sweep) -> tuple[list[Row], dict[str, FloatArray]]:
    """Return the rows of a sweep's plays, and its numbers by point."""
    design = points(sweep)
    grouped = groups(sweep, design)
    rows = [trial(sweep.measure.name, sweep.profile, *play) for _, play in grouped]
    return rows, values_of(sweep, len(design), zip(grouped, rows, strict=True))
