"""What is learnt of a robot's free motion, kept from one run to the next in a file for each robot."""

import os
import re
import time
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from pretouch.contact.residual_model import ResidualModel, kept, residual_init, resumed
from pretouch.contact.rested import rested
from pretouch.contact.sequential_test import SequentialTest
from pretouch.controller import Controller
from pretouch.errors import ParameterError, RobotModelError
from pretouch.loop import Cycle
from pretouch.robot.residual_file import Residual, load_residual, save_residual

_FOLDER = "free-motion"
_UNUSABLE = ".unusable"


@dataclass(frozen=True)
class Home:
    """Where free motion is kept."""

    robot: str
    """What the robot is known by: kind, address, and what it is told to carry."""
    place: Path
    given: bool
    """Whether a person named the file: what cannot be used is then an error, and another robot's is taken."""


def home_of(robot: str, folder: Path) -> Home:
    """Return the file of a robot in the folder of what is remembered."""
    name = re.sub(r"[^A-Za-z0-9.]+", "-", robot).strip("-.")
    return Home(robot, folder / _FOLDER / f"{name}.toml", False)


class FreeMotion:
    """A recorder that remembers what the controller has learnt, and keeps it at the end of a run."""

    begin: ResidualModel | None
    """What the controller is to begin with; None: it knows nothing."""
    found: tuple[str, ...]
    """Sentences on that."""

    def __init__(
        self, home: Home, controller: Controller, anew: bool = False, now: Callable[[], float] = time.time
    ) -> None:
        """Read what is known of the robot. A file that a person named and that cannot be used is a RobotModelError.

        Args:
            home: the file, which may be missing.
            controller: that moves the arm, with the sequential detector.
            anew: whether to begin with nothing whatever the file holds.
            now: tells the time [s since 1970].
        """
        self._home, self._model, self._now = home, controller.model, now
        detector = controller.profile.detect
        if not isinstance(detector, SequentialTest):
            raise ParameterError(f"The profile {controller.profile.name} learns no free motion.")
        self._params, self._period = detector, controller.limits.period
        self._since, self._unusable = now(), False
        self._newest: ResidualModel | None = None
        self.begin = None
        self.found = ("Nothing is known yet of this robot's free motion: at first only firm pushes are felt.",)
        if os.path.exists(home.place):
            self._load()  # also where it begins anew: a file of another kind is not to be written over
        if anew:
            self.begin, self._since = None, now()
            self.found = ("This robot's free motion is learnt anew, whatever was known of it.",)

    def record(self, cycle: Cycle) -> None:
        """Remember what is known after one turn of the loop."""
        state: Any = cycle.after.detector  # of this detector
        self._newest = self._params.learnt(state)

    def keep(self) -> tuple[str, ...]:
        """Write what is known by now, if anything was learnt; return a sentence on it. Nothing is raised."""
        model = self._newest
        if model is None or self._same(model):
            return ()
        place = self._home.place
        try:
            place.parent.mkdir(parents=True, exist_ok=True)
            if self._unusable:
                os.replace(place, _aside(place))
            save_residual(place, self._model, Residual(kept(model), self._home.robot, self._since, self._now()))
        except (OSError, RobotModelError) as error:
            why = str(error) if isinstance(error, RobotModelError) else f"{place}: {error.strerror}."
            return (
                f"What this run learnt of free motion is lost. {why} What was kept before is still there: make the"
                " folder writable, or give another file with --learnt.",
            )
        return (f"Free motion is kept, {self._amount(model)} of it: {place}",)

    def _load(self) -> None:
        home, n = self._home, self._model.n
        try:
            shapes = {name: array.shape for name, array in kept(residual_init(n, self._params)).items()}
            residual = load_residual(home.place, self._model, shapes)
            if residual.robot != home.robot and not home.given:
                raise RobotModelError(f"The file {home.place} is of {residual.robot}, and this is {home.robot}.")
            known = resumed(residual.numbers, self._params)
        except (RobotModelError, ParameterError) as error:
            if home.given:
                raise RobotModelError(f"{home.place} cannot be used as --learnt: {error}") from error
            self._unusable = True
            self.found = (
                f"Nothing is taken as known of this robot's free motion: {error} When this run has learnt some, the"
                f" file is put aside as {_aside(home.place).name}.",
            )
            return
        pause = self._now() - residual.saved
        self.begin = rested(known, pause if pause >= 0.0 else np.inf, self._params)
        self._since = residual.since
        of = "this robot" if residual.robot == home.robot else residual.robot
        self.found = (
            f"Free motion of {of} is known since {_said(residual.since)}, {self._amount(known)} of it, the last"
            f" {_said(residual.saved)}: {home.place}",
        )

    def _same(self, model: ResidualModel) -> bool:
        """Whether nothing was learnt beyond what the run began with."""
        first = residual_init(self._model.n, self._params) if self.begin is None else self.begin
        return np.array_equal(model.seen, first.seen) and np.array_equal(model.weights, first.weights)

    def _amount(self, model: ResidualModel) -> str:
        seconds = float(model.seen.sum()) * self._period
        return f"{seconds:.0f} s" if seconds < 120.0 else f"{seconds / 60.0:.0f} minutes"


def _aside(place: Path) -> Path:
    return place.with_name(place.name + _UNUSABLE)


def _said(instant: float) -> str:
    return f"{datetime.fromtimestamp(instant, UTC):%Y-%m-%d %H:%M} UTC"
