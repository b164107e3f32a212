"""A trained policy: a small network whose numbers are a file, to be run by NumPy alone."""

import zipfile
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from pretouch.atomic_write import atomic_replacement
from pretouch.errors import ExperimentError
from pretouch.types import FloatArray
from pretouch_lab.learning.observation import Observation

_CLIP = 10.0
"""Standard deviations from the mean beyond which an observation counts as that far."""


@dataclass(frozen=True)
class Policy:
    """Layers of tanh, and a last one without, over observations less their mean by their deviation."""

    about: str
    """Profile it was trained with, action, skin, steps."""
    mean: FloatArray
    """(D,) of the parts of an observation, one after the other."""
    deviation: FloatArray
    """(D,)"""
    layers: tuple[tuple[FloatArray, FloatArray], ...]
    """Weights (out, in) and biases (out,)."""
    curve: FloatArray
    """(U, 2) steps and mean return of the episodes before, while it was trained."""

    def act(self, observation: Observation) -> FloatArray:
        """Return the action, between -1 and 1, that it takes for best."""
        flat = np.concatenate([observation[name] for name in sorted(observation)])  # as Gymnasium flattens them
        x = np.clip((flat - self.mean) / self.deviation, -_CLIP, _CLIP)
        for weight, bias in self.layers[:-1]:
            x = np.tanh(weight @ x + bias)
        weight, bias = self.layers[-1]
        return np.clip(weight @ x + bias, -1.0, 1.0).astype(np.float32)

    def save(self, file: Path) -> None:
        """Write it whole."""
        layers = enumerate(self.layers)
        numbers: dict[str, Any] = {f"{kind}{i}": each[n] for i, each in layers for n, kind in enumerate("wb")}
        with atomic_replacement(file) as place, place.open("wb") as out:
            given: dict[str, Any] = {"about": self.about, "mean": self.mean, "deviation": self.deviation}
            np.savez(out, **given, curve=self.curve, **numbers)


def load_policy(file: Path) -> Policy:
    """Read a policy; nothing in the file is run. What is no policy is an ExperimentError."""
    try:
        with file.open("rb") as source, np.load(source, allow_pickle=False) as held:
            of = {name: held[name] for name in held.files}
        layers = tuple((of[f"w{i}"], of[f"b{i}"]) for i in range((len(of) - 4) // 2))
        policy = Policy(str(of["about"]), of["mean"], of["deviation"], layers, of["curve"])
        widths = [len(policy.mean), *(len(bias) for _, bias in layers)]
        fits = all(w.shape == (b, a) for (w, _), (a, b) in zip(layers, pairwise(widths), strict=True))
    except (OSError, ValueError, KeyError, TypeError, zipfile.BadZipFile) as error:
        raise ExperimentError(f"{file} holds no policy ({error}): give one that `pretouch learn` wrote.") from error
    if not layers or not fits or policy.deviation.shape != policy.mean.shape:
        raise ExperimentError(f"The layers in {file} do not fit each other: give one that `pretouch learn` wrote.")
    return policy
