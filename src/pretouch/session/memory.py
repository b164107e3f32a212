"""Memory of a robot from one run to the next: its confirmed force sign and its learnt free motion.

What is read is held against bounds by physics; after a pause less of free motion is still known.
"""

import json
import math
import os
import re
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import tomli_w

from pretouch.atomic_write import atomic_write
from pretouch.contact.residual_model import PLAIN, RESTING, ResidualModel, prior_of, residual_init
from pretouch.contact.sequential_test import SequentialTest
from pretouch.controller import Controller
from pretouch.errors import ParameterError, RobotError, RobotModelError
from pretouch.loop import Cycle
from pretouch.params import SequentialParams
from pretouch.robot.model import RobotModel
from pretouch.toml_files import parse_toml

_SIGN_FILE, _FOLDER, _UNUSABLE = "force-sign.json", "free-motion", ".unusable"
_FORMAT = 2
_LASTING = ("weights", "covariance", "spread", "seen", "turning", "scatter", "level")
"""Fields of a model of free motion that are saved."""
_LATEST = 253_402_300_800.0
"""The year 10 000 [s since 1970]."""
_ANEW = "let the arm learn its free motion again"
_NOISIEST = 100.0
"""Noise of the measured joint velocities times the observer's gain [rad/s^2]: a real Panda's is 0.5."""
_DRIFT = 0.25
"""Part of the prior's standard deviations that offset and friction may drift by while nobody looks: an arm cools."""
_COOLING_S = 300.0  # an assumption


@dataclass(frozen=True)
class Identity:
    """A robot and its connection: after a change of any field the push is requested again."""

    kind: str
    """Kind of arm, as `panda`, `fr3`, `ros2`."""
    address: str
    """Network address of the arm."""
    connection: str
    """Library, driver settings and versions that lie between."""

    @property
    def key(self) -> str:
        """Name of its entry."""
        return f"{self.kind} at {self.address}"


def state_folder(environment: Mapping[str, str] = os.environ) -> Path:
    """Return the folder for what is remembered, by the XDG base directory specification."""
    named = environment.get("XDG_STATE_HOME", "")
    base = Path(named) if os.path.isabs(named) else Path.home() / ".local" / "state"
    return base / "pretouch"


class ConfirmedRobots:
    """The file of robots in a folder whose force sign a guided push has confirmed."""

    def __init__(self, folder: Path) -> None:
        self.path = folder / _SIGN_FILE

    def is_confirmed(self, robot: Identity) -> bool:
        """Return True if this robot has been confirmed; a file that cannot be read is a RobotError."""
        return self._read().get(robot.key) == robot.connection

    def add(self, robot: Identity) -> None:
        """Store that a robot is confirmed; RobotError if that cannot be written."""
        entries = self._read() | {robot.key: robot.connection}
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            atomic_write(self.path, json.dumps(entries, indent=1))
        except OSError as error:
            raise RobotError(
                f"The confirmation cannot be saved in {self.path} ({error.strerror}): make that folder writable, or"
                " set XDG_STATE_HOME to another one."
            ) from error

    def _read(self) -> dict[str, str]:
        try:
            return msgspec.json.decode(self.path.read_bytes(), type=dict[str, str])
        except FileNotFoundError:
            return {}
        except OSError as error:
            raise RobotError(f"The file {self.path} cannot be read: {error.strerror}.") from error
        except (msgspec.MsgspecError, ValueError, RecursionError):
            raise RobotError(f"The file {self.path} is damaged: delete it, and repeat the guided pushes.") from None


class _StoredMotion(msgspec.Struct):
    """A file of free motion."""

    format: int
    arm: str
    joints: list[str]
    robot: str
    """Robot that the model was learnt on, as `panda at 172.16.0.2`."""
    saved: float
    """Time of writing [s since 1970, UTC]."""
    array: dict[str, list[Any]]


def save_learnt(path: Path, arm: RobotModel, learnt: ResidualModel, robot: str, saved: float) -> None:
    """Write a file of free motion; one that is there is replaced whole or, with an OSError, not at all."""
    stored = {name: getattr(learnt, name).tolist() for name in _LASTING}
    file = _StoredMotion(_FORMAT, arm.description.name, list(arm.joints), robot, saved, stored)
    atomic_write(path, tomli_w.dumps(msgspec.to_builtins(file)))


def load_learnt(path: Path, arm: RobotModel, p: SequentialParams) -> tuple[ResidualModel, str, float]:
    """Read a file of free motion: model, robot, instant of saving; one that cannot be used is a RobotModelError."""
    try:
        stored = msgspec.convert(parse_toml(path.read_bytes()), _StoredMotion)
        arrays: dict[str, Any] = {name: np.array(array, np.float64) for name, array in stored.array.items()}
    except OSError as error:
        raise RobotModelError(f"The file {path} cannot be read: {error.strerror}: give one that was saved.") from error
    except (ValueError, TypeError, msgspec.MsgspecError) as error:  # not of TOML, not UTF-8, or of something else
        raise RobotModelError(f"The file {path} holds no free motion: {error}: {_ANEW}.") from error
    for key, ours in (("format", _FORMAT), ("arm", arm.description.name), ("joints", list(arm.joints))):
        if getattr(stored, key) != ours:
            raise RobotModelError(f"{path} has {key} = {getattr(stored, key)!r}, but {ours!r} is needed: {_ANEW}.")
    if not 0.0 <= stored.saved < _LATEST:
        raise RobotModelError(f"{path} was saved at the impossible time {stored.saved:g} s: {_ANEW}.")
    fresh = residual_init(arm.n, p)
    for name in _LASTING:
        if name not in arrays or arrays[name].shape != getattr(fresh, name).shape:
            raise RobotModelError(f"{path}: {name} is not of the shape {getattr(fresh, name).shape}: {_ANEW}.")
    lasting: dict[str, Any] = {name: arrays[name] for name in _LASTING}
    learnt = fresh._replace(**lasting)
    try:
        check_learnt(learnt, arm)
    except ParameterError as error:
        raise RobotModelError(f"{path}: {error}") from error
    return learnt, stored.robot, stored.saved


def check_learnt(learnt: ResidualModel, arm: RobotModel) -> None:
    """Refuse, by a ParameterError, a model that no free motion of an arm can have: it would hide every contact.

    Covariances and scatters are symmetric and positive definite, variances and counts not below zero. Offset, friction
    and noise of a joint stay within the torque it can give, the error of a link's mass within that mass, and an unknown
    load within the mass of the arm. None is less certain than by its bound.
    """
    counts, scatter = (learnt.seen, learnt.turning, learnt.level[:, 3:]), learnt.scatter[:, :, : arm.n]
    finite = all(np.isfinite(array).all() for array in (*counts, learnt.level, learnt.scatter))
    if not finite or min(array.min() for array in (learnt.spread, *counts)) < 0.0:
        raise ParameterError("What was learnt has a variance or a count below zero: learn it anew.")
    torque, n = arm.description.tau_max, arm.n
    largest = np.column_stack([*[torque] * PLAIN, np.ones((n, n)), np.full(n, arm.mechanism.links.mass.sum())])
    noisiest = np.stack([np.full(n, _NOISIEST), torque]) ** 2
    variance = np.diagonal(learnt.covariance, axis1=1, axis2=2)
    for name, values, bound in (
        ("weight", np.abs(learnt.weights), largest),
        ("variance", variance, largest**2),
        ("spread", learnt.spread.max(axis=0), noisiest),
    ):
        at = np.unravel_index(int(np.argmax(values / bound)), bound.shape)
        if not values[at] <= bound[at]:
            raise ParameterError(
                f"What was learnt has a {name} of {values[at]:.3g}, beyond the {bound[at]:.3g} that this arm can have:"
                " learn it anew."
            )
    for covariance in (learnt.covariance, scatter):
        symmetric = np.isfinite(covariance).all() and np.allclose(covariance, covariance.swapaxes(-1, -2))
        if not symmetric or np.linalg.eigvalsh(covariance).min() <= 0.0:
            raise ParameterError("What was learnt has a covariance that is none: learn it anew.")


def rested(model: ResidualModel, pause_s: float, p: SequentialParams) -> ResidualModel:
    """Return the model after a pause [s]: the mean as it was, its covariance larger, the noise covariance as it was.

    Within minutes the covariance of offset and friction goes part of the way to the prior. Those of the payload and of
    the friction at rest go all of it, for the arm may have moved and hold something else. The links' masses stay what
    they are.
    """
    n = len(model.weights)
    prior, lost = prior_of(n, p), -math.expm1(-max(pause_s, 0.0) / _COOLING_S)
    share = np.zeros(len(prior))
    share[:PLAIN], share[[RESTING, -1]] = _DRIFT**2 * lost, lost
    left, weights = np.sqrt(1.0 - share), model.weights.copy()
    weights[:, RESTING] *= left[RESTING]
    # scaled from both sides, by which it stays positive definite: of each variance a share is replaced by the prior's
    covariance = model.covariance * (left[:, None] * left) + np.diag(share * prior)
    return model._replace(weights=weights, covariance=covariance)


@dataclass(frozen=True)
class ModelFile:
    """File that free motion is saved in."""

    robot: str
    """Identity of the robot: kind, address, and the payload set in it."""
    path: Path
    named: bool
    """True if a person named the file: what cannot be used is then an error, and another robot's is taken."""


def model_file_of(robot: str, folder: Path) -> ModelFile:
    """Return the file of a robot in the folder of what is remembered."""
    name = re.sub(r"[^A-Za-z0-9.]+", "-", robot).strip("-.")
    return ModelFile(robot, folder / _FOLDER / f"{name}.toml", False)


class FreeMotion:
    """A recorder that remembers what the controller has learnt, and saves it at the end of a run."""

    begin: ResidualModel | None = None
    """Model that the controller starts with; None: nothing is learnt yet."""
    sentence = "This robot's free motion is not known yet: at first only firm pushes are detected."
    """Sentence on the model that was loaded."""

    def __init__(self, file: ModelFile, controller: Controller, now: Callable[[], float] = time.time) -> None:
        """Read the robot's model. A file that a person named and that cannot be used is a RobotModelError.

        Args:
            file: the file, which may be missing.
            controller: that moves the arm, with the sequential detector.
            now: gives the time [s since 1970].
        """
        self._file, self._model, self._now = file, controller.model, now
        detector = controller.profile.detect
        if not isinstance(detector, SequentialTest):
            raise ParameterError(f"The profile {controller.profile.name} learns no free motion.")
        self._params, self._period = detector, controller.limits.period
        self._unusable = False
        self._newest: ResidualModel | None = None
        if os.path.exists(file.path):
            self._load()

    def record(self, cycle: Cycle) -> None:
        """Remember the model after one turn of the loop."""
        self._newest = cycle.after.learnt

    def save(self) -> tuple[str, ...]:
        """Write the model, if anything was learnt; return a sentence on it. Nothing is raised."""
        model, path = self._newest, self._file.path
        first = residual_init(self._model.n, self._params) if self.begin is None else self.begin
        if model is None or (np.array_equal(model.seen, first.seen) and np.array_equal(model.weights, first.weights)):
            return ()
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            if self._unusable:
                os.replace(path, _aside(path))
            save_learnt(path, self._model, model, self._file.robot, self._now())
        except OSError as error:
            return (
                f"The free motion learnt in this run could not be saved. {path}: {error.strerror}. The previous file is"
                " unchanged: make the folder writable, or give another file with --learnt.",
            )
        return (f"Free motion saved ({self._amount(model)}): {path}",)

    def _load(self) -> None:
        file = self._file
        try:
            learnt, robot, saved = load_learnt(file.path, self._model, self._params)
            if robot != file.robot and not file.named:
                raise RobotModelError(f"The file {file.path} belongs to {robot}, but this robot is {file.robot}.")
        except RobotModelError as error:
            if file.named:
                raise RobotModelError(f"{file.path} cannot be used as --learnt: {error}") from error
            self._unusable = True
            self.sentence = (
                f"This robot's free motion starts empty: {error} If this run learns any, the file is renamed to"
                f" {_aside(file.path).name}."
            )
            return
        pause = self._now() - saved
        self.begin = rested(learnt, pause if pause >= 0.0 else np.inf, self._params)
        self.sentence = (
            f"Free motion of {'this robot' if robot == file.robot else robot} is known ({self._amount(learnt)}, saved"
            f" {datetime.fromtimestamp(saved, UTC):%Y-%m-%d %H:%M} UTC): {file.path}"
        )

    def _amount(self, model: ResidualModel) -> str:
        seconds = float(model.seen.sum()) * self._period
        return f"{seconds:.0f} s" if seconds < 120.0 else f"{seconds / 60.0:.0f} minutes"


def _aside(path: Path) -> Path:
    return path.with_name(path.name + _UNUSABLE)
