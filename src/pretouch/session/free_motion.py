"""What is learnt of a robot's free motion, kept from one run to the next in a file for each robot.

What is read is held against bounds by physics; after a pause less of it is still known.
"""

import math
import os
import re
import time
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from pretouch.contact.residual_model import PLAIN, ResidualModel, prior_of, residual_init
from pretouch.contact.sequential_test import SequentialTest
from pretouch.controller import Controller
from pretouch.errors import ParameterError, RobotModelError
from pretouch.loop import Cycle
from pretouch.params import SequentialParams
from pretouch.robot.model import RobotModel
from pretouch.session.residual_file import Residual, load_residual, save_residual
from pretouch.types import FloatArray

_LASTING = ("weights", "covariance", "spread", "seen")
"""What is kept from one session to the next."""


def kept(model: ResidualModel) -> dict[str, FloatArray]:
    """Return what is to be kept of a model, by name."""
    return {name: getattr(model, name) for name in _LASTING}


def resumed(numbers: dict[str, FloatArray], p: SequentialParams) -> ResidualModel:
    """Return a model with what was kept of an earlier one; one that could not be is a ParameterError.

    The covariances must be symmetric and positive definite, the variances and counts not below zero.
    """
    n = len(numbers["weights"])
    fresh = residual_init(n, p)
    for name in _LASTING:
        if numbers[name].shape != getattr(fresh, name).shape or not np.isfinite(numbers[name]).all():
            raise ParameterError(f"What was learnt has {name} of the shape {numbers[name].shape}: learn it anew.")
    turned = numbers["covariance"].swapaxes(1, 2)
    if not np.array_equal(numbers["covariance"], turned) or np.linalg.eigvalsh(turned).min() <= 0.0:
        raise ParameterError("What was learnt has a covariance that is none: learn it anew.")
    if numbers["spread"].min() < 0.0 or numbers["seen"].min() < 0.0:
        raise ParameterError("What was learnt has a variance or a count below zero: learn it anew.")
    weights, covariance, spread, seen = (numbers[name].copy() for name in _LASTING)
    return fresh._replace(weights=weights, covariance=covariance, spread=spread, seen=seen)


_NOISIEST = 100.0
"""Noise of the measured joint velocities times the observer's gain [rad/s^2]: a real Panda's is 0.5."""


def check_learnt(learnt: ResidualModel, model: RobotModel) -> None:
    """Refuse, by a ParameterError, what no free motion of an arm can be: believed, it would hide every contact.

    Offset, friction and noise of a joint stay within the torque it can give, the error of a link's mass within that
    mass, and an unknown load within the mass of the arm. None is less certain than by its bound.
    """
    torque, n = model.description.tau_max, model.n
    largest = np.column_stack([*[torque] * PLAIN, np.ones((n, n)), np.full(n, model.mechanism.links.mass.sum())])
    noisiest = np.stack([np.full(n, _NOISIEST), torque]) ** 2
    known = np.diagonal(learnt.covariance, axis1=1, axis2=2)
    for name, found, bound in (
        ("weight", np.abs(learnt.weights), largest), ("variance", known, largest**2),
        ("spread", learnt.spread.max(axis=0), noisiest),
    ):  # fmt: skip
        at = np.unravel_index(int(np.argmax(found / bound)), bound.shape)
        if not found[at] <= bound[at]:
            raise ParameterError(
                f"What was learnt has a {name} of {found[at]:.3g}, beyond the {bound[at]:.3g} that this arm can have:"
                " learn it anew."
            )


_DRIFT = 0.25
"""Part of the prior's standard deviations that offset and friction may drift by while nobody looks: an arm cools."""
_COOLING_S = 300.0  # an assumption


def rested(model: ResidualModel, pause_s: float, p: SequentialParams) -> ResidualModel:
    """Return the model after a pause [s]: the mean as it was, its covariance larger, the noise covariance as it was.

    Within minutes the covariance of offset and friction goes part of the way to the prior, and that of the payload all
    of it, for what the arm holds may be another. The links' masses stay what they are.
    """
    n = len(model.weights)
    prior, gone = prior_of(n, p), -math.expm1(-max(pause_s, 0.0) / _COOLING_S)
    share = np.zeros(len(prior))
    share[:PLAIN], share[-1] = _DRIFT**2 * gone, gone
    left = np.sqrt(1.0 - share)
    # scaled from both sides, by which it stays positive definite: of each variance a share is replaced by the prior's
    covariance = model.covariance * (left[:, None] * left) + np.diag(share * prior)
    return model._replace(covariance=covariance)


_FOLDER = "free-motion"
_UNUSABLE = ".unusable"


@dataclass(frozen=True)
class ModelFile:
    """Where free motion is kept."""

    robot: str
    """What the robot is known by: kind, address, and the payload set in it."""
    path: Path
    given: bool
    """Whether a person named the file: what cannot be used is then an error, and another robot's is taken."""


def model_file_of(robot: str, folder: Path) -> ModelFile:
    """Return the file of a robot in the folder of what is remembered."""
    name = re.sub(r"[^A-Za-z0-9.]+", "-", robot).strip("-.")
    return ModelFile(robot, folder / _FOLDER / f"{name}.toml", False)


class FreeMotion:
    """A recorder that remembers what the controller has learnt, and keeps it at the end of a run."""

    begin: ResidualModel | None
    """What the controller is to begin with; None: it knows nothing."""
    found: tuple[str, ...]
    """Sentences on that."""

    def __init__(
        self, file: ModelFile, controller: Controller, relearn: bool = False, now: Callable[[], float] = time.time
    ) -> None:
        """Read what is known of the robot. A file that a person named and that cannot be used is a RobotModelError.

        Args:
            file: the file, which may be missing.
            controller: that moves the arm, with the sequential detector.
            relearn: whether to begin with nothing whatever the file holds.
            now: tells the time [s since 1970].
        """
        self._file, self._model, self._now = file, controller.model, now
        detector = controller.profile.detect
        if not isinstance(detector, SequentialTest):
            raise ParameterError(f"The profile {controller.profile.name} learns no free motion.")
        self._params, self._period = detector, controller.limits.period
        self._since, self._unusable = now(), False
        self._newest: ResidualModel | None = None
        self.begin = None
        self.found = ("This robot's free motion is not known yet: at first only firm pushes are detected.",)
        if os.path.exists(file.path):
            self._load()  # also where it begins anew: a file of another kind is not to be written over
        if relearn:
            self.begin, self._since = None, now()
            self.found = ("This robot's free motion is learnt again from the beginning.",)

    def record(self, cycle: Cycle) -> None:
        """Remember what is known after one turn of the loop."""
        self._newest = cycle.after.learnt

    def keep(self) -> tuple[str, ...]:
        """Write what is known by now, if anything was learnt; return a sentence on it. Nothing is raised."""
        model = self._newest
        if model is None or self._same(model):
            return ()
        path = self._file.path
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            if self._unusable:
                os.replace(path, _aside(path))
            save_residual(path, self._model, Residual(kept(model), self._file.robot, self._since, self._now()))
        except (OSError, RobotModelError) as error:
            why = str(error) if isinstance(error, RobotModelError) else f"{path}: {error.strerror}."
            return (
                f"The free motion learnt in this run could not be saved. {why} The previous file is unchanged: make"
                " the folder writable, or give another file with --learnt.",
            )
        return (f"Free motion saved ({self._amount(model)}): {path}",)

    def _load(self) -> None:
        file, n = self._file, self._model.n
        try:
            shapes = {name: array.shape for name, array in kept(residual_init(n, self._params)).items()}
            residual = load_residual(file.path, self._model, shapes)
            if residual.robot != file.robot and not file.given:
                raise RobotModelError(
                    f"The file {file.path} belongs to {residual.robot}, but this robot is {file.robot}."
                )
            known = resumed(residual.numbers, self._params)
            check_learnt(known, self._model)
        except (RobotModelError, ParameterError) as error:
            if file.given:
                raise RobotModelError(f"{file.path} cannot be used as --learnt: {error}") from error
            self._unusable = True
            self.found = (
                f"This robot's free motion starts empty: {error} If this run learns any, the file is renamed to"
                f" {_aside(file.path).name}.",
            )
            return
        pause = self._now() - residual.saved
        self.begin = rested(known, pause if pause >= 0.0 else np.inf, self._params)
        self._since = residual.since
        of = "this robot" if residual.robot == file.robot else residual.robot
        self.found = (
            f"Free motion of {of} is known since {_said(residual.since)} ({self._amount(known)}, last saved"
            f" {_said(residual.saved)}): {file.path}",
        )

    def _same(self, model: ResidualModel) -> bool:
        """Whether nothing was learnt beyond what the run began with."""
        first = residual_init(self._model.n, self._params) if self.begin is None else self.begin
        return np.array_equal(model.seen, first.seen) and np.array_equal(model.weights, first.weights)

    def _amount(self, model: ResidualModel) -> str:
        seconds = float(model.seen.sum()) * self._period
        return f"{seconds:.0f} s" if seconds < 120.0 else f"{seconds / 60.0:.0f} minutes"


def _aside(path: Path) -> Path:
    return path.with_name(path.name + _UNUSABLE)


def _said(instant: float) -> str:
    return f"{datetime.fromtimestamp(instant, UTC):%Y-%m-%d %H:%M} UTC"
