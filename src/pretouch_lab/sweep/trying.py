"""A function whose indices are known, in place of an experiment: to try a sweep, a cluster, or the indices themselves.

Ishigami and Homma (1990): f = sin x1 + A sin^2 x2 + B x3^4 sin x1, each x uniform from -pi to pi.
"""

import time
from dataclasses import dataclass
from typing import Annotated, cast

import numpy as np

from pretouch.checks import Check, Checked, NonNegative
from pretouch_lab.sweep.measures import Measure, Numbers
from pretouch_lab.sweep.setting import Setting

A, B = 7.0, 0.1
X = Annotated[float, Check(low=-3.2, high=3.2)]


@dataclass(frozen=True)
class IshigamiScene(Checked):
    """Where the function is evaluated."""

    x1: X = 0.0
    x2: X = 0.0
    x3: X = 0.0
    pause_s: NonNegative = 0.0
    """How long a cell takes at least [s]."""


def ishigami(x1: float, x2: float, x3: float) -> float:
    """Evaluate the function."""
    return float(np.sin(x1) + A * np.sin(x2) ** 2 + B * x3**4 * np.sin(x1))


def _run(setting: Setting, _: None) -> Numbers:
    scene = cast(IshigamiScene, setting.scene)
    if scene.pause_s > 0:
        time.sleep(scene.pause_s)
    return {"value": ishigami(scene.x1, scene.x2, scene.x3)}


ISHIGAMI = Measure(
    "ishigami", "a function whose indices are known, to try a sweep or a cluster", "paper", IshigamiScene(),
    {"value": "the function's value"}, _run, lambda s: 0.002 + cast(IshigamiScene, s.scene).pause_s,
    (),
)  # fmt: skip
