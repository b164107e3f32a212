"""Inputs that the commands come back into: trials in the simulation, and arms that follow among many points.

They are the same to the bit on one machine, and nowhere else: they are compared between two checkouts and not stored.
"""

from collections.abc import Callable
from functools import partial
from types import ModuleType

from pretouch.controller import Controller
from pretouch.perception.scene_filter import no_fixtures
from pretouch.profiles import profile
from pretouch_lab.benchmarks.workload import Workload
from pretouch_lab.cell import Cell, Context
from pretouch_lab.paper import dynamic, static
from pretouch_lab.studies import clamp, pinch, vision
from tests.golden.fields import Values, values_of
from tests.golden.streams import model, skin


def trial(experiment: ModuleType, name: str, where: dict[str, str | float], world: str = "") -> dict[int, Values]:
    """Run one trial of an experiment of the package."""
    _, record = experiment.trial(Cell(experiment.NAME, name, where), 3, Context(model(), skin(), world=world))
    return {i: values_of(step) for i, step in enumerate(record.steps)}


def crowd(units: int, name: str, cycles: int) -> dict[int, Values]:
    """Let an arm with many units follow its commands among things that all of them see."""
    work = Workload(model(), units, profile(name), 3)
    found = Controller(model(), work.skin, no_fixtures(), work.path, profile(name))
    state = found.init(work.inputs().robot)
    steps = {}
    for i in range(cycles):
        step, state = found.step(state, work.inputs())
        work.move(step.command)
        steps[i] = values_of(step)
    return steps


def _static(trajectory: str, side: str, mode: str) -> dict[str, str | float]:
    return {"trajectory": trajectory, "side": side, "stiffness_n_per_m": 25_000.0, "restrictions": mode}


def _clamp(held: float) -> dict[str, str | float]:
    return {"held_s": held, "stiffness_n_per_m": 25_000.0, "restrictions": "off"}


def _pinch(place: str) -> dict[str, str | float]:
    return {"place": place, "speed_m_s": 0.2, "restrictions": "off"}


_CAMERA: dict[str, str | float] = {
    "scene": "board", "sensing": "both", "view": next(iter(vision.VIEWS)), "restrictions": "braking",
}  # fmt: skip

CLOSED: dict[str, Callable[[], dict[int, Values]]] = {
    "static/circle/paper": partial(trial, static, "paper", _static("circle", "-y", "off")),
    "static/line/paper-slack": partial(trial, static, "paper", _static("line", "+y", "slack")),
    "static/line/pretouch": partial(trial, static, "pretouch", _static("line", "+y", "braking")),
    "static/circle/flacco-stress": partial(trial, static, "flacco", _static("circle", "+y", "flacco"), "stress"),
    "dynamic/paper": partial(trial, dynamic, "paper", {"restrictions": "slack"}),
    "dynamic/pretouch": partial(trial, dynamic, "pretouch", {"restrictions": "braking"}),
    "clamp/short-push": partial(trial, clamp, "pretouch", _clamp(0.2)),
    "clamp/lasting-push": partial(trial, clamp, "pretouch", _clamp(3.0)),
    "pinch/crook": partial(trial, pinch, "pretouch", _pinch("crook")),
    "pinch/floor": partial(trial, pinch, "pretouch", _pinch("floor")),
    "camera-and-skin": partial(trial, vision, "pretouch", _CAMERA),
    "32-units/paper": partial(crowd, 32, "paper", 400),
    "32-units/pretouch": partial(crowd, 32, "pretouch", 400),
    "1000-points/paper": partial(crowd, 1000, "paper", 200),
    "1000-points/pretouch": partial(crowd, 1000, "pretouch", 200),
}
"""Name -> what runs it. Names stay, and have no spaces."""
