"""The command `pretouch warm-up`, and the first start of others: compile a control step, and cache it."""

import gc
import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from multiprocessing import get_context
from multiprocessing.context import SpawnProcess
from pathlib import Path

import numpy as np
from rich.console import Console

from pretouch.compiled import FIRST_START
from pretouch.contact.detector import Sample
from pretouch.contact.window import Window
from pretouch.control.path import Circle
from pretouch.controller import Controller
from pretouch.line import line, move, see
from pretouch.page.room import LiveSettings, Room, live_path
from pretouch.perception.scene_filter import no_fixtures
from pretouch.profiles import Profile, profile
from pretouch.realtime import warm_up
from pretouch.robot.description import panda
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import paper_skin
from pretouch.signals import kept_from_children
from pretouch.types import Obstacles, RobotState

_PUSH_NM = 30.0
"""At each joint: a contact for any detector that goes by torques."""


@dataclass(frozen=True)
class WarmUp:
    """Compile a control step, once after an installation: later commands then start within a second."""

    def run(self) -> None:
        """Compile, and print where it is cached. All profiles have the same compiled functions."""
        prepare(profile("pretouch"))
        place = kept_in()
        print(f"Compiled, and cached in {place}." if place else "Compiled, but not cached: HOME is not writable.")


def kept_in() -> str:
    """Return the folder that compiled functions are kept in, or '' where there is none."""
    stats = getattr(line, "stats", None)
    return str(Path(stats.cache_path).parent) if stats and stats.cache_path else ""


def prepare(chosen: Profile) -> None:
    """Compile a step of a profile, and a simulated arm, where that is not kept yet, in two processes; say so on stderr.

    What the other process does not come to, or what cannot be kept, is compiled where it is first needed.
    """
    output, since, others = Console(stderr=True, highlight=False), list[float](), list[SpawnProcess]()

    def beside(target: Callable[[], None]) -> None:
        if (os.cpu_count() or 1) > 1 and kept_in():
            others.append(get_context("spawn").Process(target=target, daemon=True))  # ends with this one
            with kept_from_children():
                others[-1].start()

    def begin(sentence: str) -> None:
        output.print(sentence)
        since.append(output.get_time())
        beside(compile_stages)

    FIRST_START.say = begin  # type: ignore[method-assign]
    gc.disable()  # the collector looks through all that a compiler makes, for an eighth of the time
    try:
        controller, robot = _at_rest(chosen)
        _detect(controller, robot)
        for other in others:  # its part is then taken from where it is kept
            other.join()
        if others:
            beside(compile_simulation)
        warm_up(controller, robot, points=True)
        for other in others:
            other.join()
    finally:
        gc.enable()
        del FIRST_START.say
    if since:
        output.print(f"Compiled in {output.get_time() - since[0]:.0f} s.")


def _detect(controller: Controller, robot: RobotState) -> None:
    """Tell free motion and a contact, and where it is."""
    state, near = controller.init(robot), controller.blank.part("scene.near", Obstacles)
    kin, memory = controller.model.kinematics(robot.q), controller.whole_detector(state)
    for push in (0.0, _PUSH_NM):
        report = replace(robot, tau_ext=np.full(len(robot.q), push))
        sample = Sample(0.0, kin, report, state.memory.part("window", Window), True, near)
        _, memory = controller.profile.detect.step(memory, controller.body, sample)


def compile_stages() -> None:
    """Compile what is seen and how the arm moves, as much as the detector is, in a process of its own."""
    FIRST_START.logged = True  # by the process that waits, at the same terminal
    gc.disable()
    controller, robot = _at_rest(profile("pretouch"))
    blocks = controller.fixed.blocks, controller.init(robot).memory.blocks, controller.blank.copy().blocks
    see(*blocks, controller.beside)
    move(*blocks)


def compile_simulation() -> None:
    """Compile what simulates an arm and its units, in a process of its own."""
    settings, model = LiveSettings(profile=profile("pretouch")), RobotModel(panda())
    Room(settings, live_path(settings), model, paper_skin(model)).tick()


def _at_rest(chosen: Profile) -> tuple[Controller, RobotState]:
    """Return a controller of a Panda with the paper's skin, and the state of an arm at rest."""
    model = RobotModel(panda())
    q, rest = model.description.q_ready, np.zeros(model.n)
    robot = RobotState(0.0, q, rest, q, rest, rest, np.zeros(6))
    return Controller(model, paper_skin(model), no_fixtures(), Circle(), chosen), robot
