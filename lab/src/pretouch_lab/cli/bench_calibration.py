"""`pretouch bench calibration`: random skins calibrated in simulation, and how far the answers are off."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from pretouch.calibration.motion.limits import PlanParams
from pretouch.cli.options import JsonFile
from pretouch.errors import CalibrationError

if TYPE_CHECKING:  # the help needs the motion's parameters, but nothing that simulates
    from pretouch_lab.studies.calibration.study import Study


@dataclass(frozen=True)
class Calibration:
    """How far units on random skins are found from where they sit, by `pretouch skin calibrate` in simulation."""

    skins: int = 20
    """How many; each has a unit on each link from the second on."""
    find_links: bool = False
    """Do not tell the calibration which links the units sit on."""
    motion: PlanParams = field(default_factory=PlanParams)
    arm: str = "panda"
    """panda, fr3, or the folder of an imported arm."""
    json: JsonFile = None
    seed: int = 0
    """Decides all that is random."""

    def run(self) -> None:
        """Run it, with tables and numbers."""
        bench_calibration(self)


def bench_calibration(command: Calibration) -> None:
    """Calibrate random skins, show how far the answers are off, and write them down."""
    from rich.console import Console

    from pretouch.cli.tables import show
    from pretouch.cli.writing import numbers_to
    from pretouch_lab.studies.calibration.table import by_link

    if command.skins < 1:
        raise CalibrationError(f"The number of skins is {command.skins}: give at least 1.")
    if command.seed < 0:
        raise CalibrationError(f"The seed is {command.seed}: it must be at least 0.")
    with numbers_to(command.json) as write:
        found = study_of(command)
        show(Console(highlight=False), [by_link(found)])
        write({"rows": found.rows, "motion_s": found.motion_s, "compute_s": found.compute_s})


def study_of(command: Calibration) -> "Study":
    """Calibrate random skins, with a bar."""
    from rich.console import Console

    from pretouch.calibration.motion.planner import plan_motion
    from pretouch.robot.description import robot_named
    from pretouch.robot.model import RobotModel
    from pretouch_lab.cli.progress import bar
    from pretouch_lab.studies.calibration.study import study

    model = RobotModel(robot_named(command.arm))
    plan = None if command.motion == PlanParams() else plan_motion(model, command.motion)
    name = "simulations"
    with bar(Console(stderr=True), name, command.skins) as advance:
        return study(
            model, command.skins, command.seed, not command.find_links, plan,
            progress=lambda: advance(1, name),
        )  # fmt: skip
