"""What `pretouch warm-up` does, and other commands at their first start: compile a control step, and keep it."""

import os
from collections.abc import Callable
from multiprocessing import get_context
from multiprocessing.context import SpawnProcess

import numpy as np
from numba.core import event
from rich.console import Console

from pretouch.compiled import FIRST_START, is_large, kept_in
from pretouch.control.path import Circle
from pretouch.controller import Controller
from pretouch.line import move
from pretouch.perception.scene_filter import no_fixtures
from pretouch.profiles import Profile, at_rate, profile
from pretouch.realtime import warm_up
from pretouch.robot.description import panda
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import paper_skin
from pretouch.signals import OF_TERMINAL, kept_from_children
from pretouch.types import RobotState

_PROFILES = ("pretouch", "paper", "paper:approach=none")
_RATE_HZ = 1000.0


def compile_step() -> str:
    """Compile a control step of each kind, with points from outside too, and say where that is kept; '' for nowhere."""
    for name in _PROFILES:
        wanted = profile(name)
        prepare(wanted, console=Console(quiet=True))
        warm_up(*_at_rest(at_rate(wanted, _RATE_HZ)), points=True)
    return kept_in()


def prepare(
    wanted: Profile, meanwhile: Callable[[], object] = lambda: None, first_contact: bool = False,
    console: Console | None = None,
) -> None:  # fmt: skip
    """Compile a step of a profile where that is not kept yet, in two processes, and say so on the standard error.

    Motion takes half of the time and is compiled by another process. What it does not come to, or what cannot be kept,
    is compiled where it is first needed.

    Args:
        wanted: the profile.
        meanwhile: what else the command compiles at its start.
        first_contact: whether another process goes on, beyond the return, with what a first contact comes to.
        console: where it is said, in place of the standard error.
    """
    start = _FirstStart(wanted, console or Console(stderr=True, highlight=False))
    with event.install_listener("numba:compile", start):
        warm_up(*_at_rest(wanted))
        meanwhile()
    if start.begun and start.other and first_contact:
        _begun(compile_contact, wanted)
    start.wait()


class _FirstStart(event.Listener):
    """Says that it is a first start, and lets another process compile motion, when a large function is compiled."""

    def __init__(self, wanted: Profile, console: Console) -> None:
        self._wanted, self._console, self.begun = wanted, console, 0.0
        self.other: SpawnProcess | None = None

    def on_start(self, event: event.Event) -> None:
        """Begin, once."""
        if self.begun or not is_large(event):
            return
        self.begun, FIRST_START.said = self._console.get_time(), True
        both = len(os.sched_getaffinity(0)) > 1 and bool(kept_in())
        self._console.print("Compiling for this processor, once after an installation: one to two minutes ...")
        if both:
            self.other = _begun(compile_motion, self._wanted)

    def on_end(self, event: event.Event) -> None:
        """Nothing: others may follow."""

    def wait(self) -> None:
        """Wait for the other process, and say how long all of it took."""
        if self.other:
            self.other.join()
        if self.begun:
            self._console.print(f"Compiled in {self._console.get_time() - self.begun:.0f} s.")


def _begun(work: Callable[[Profile], None], wanted: Profile) -> SpawnProcess:
    """Begin work in a process that ends with this one, and that a terminal's Ctrl-C does not reach."""
    process = get_context("spawn").Process(target=work, args=(wanted,), daemon=True)
    with kept_from_children(OF_TERMINAL):
        process.start()
    return process


def compile_motion(wanted: Profile) -> None:
    """Compile what of a step comes after contact detection."""
    controller, robot = _at_rest(wanted)
    move(controller.fixed.blocks, controller.init(robot).memory.blocks, controller.blank.copy().blocks)


def compile_contact(wanted: Profile) -> None:
    """Compile what a first contact of a profile comes to."""
    warm_up(*_at_rest(wanted))


def _at_rest(wanted: Profile) -> tuple[Controller, RobotState]:
    """Return a controller of a Panda with the paper's skin, and the state of an arm at rest."""
    model = RobotModel(panda())
    q, rest = model.description.q_ready, np.zeros(model.n)
    robot = RobotState(0.0, q, rest, q, rest, rest, np.zeros(6))
    return Controller(model, paper_skin(model), no_fixtures(), Circle(), wanted), robot
