"""What `pretouch skin calibrate --simulate` does: random skins calibrated in simulation."""

from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from pretouch.calibration.motion.planner import plan_motion
from pretouch.cli.arms import arm_model
from pretouch.cli.calibrate.motion import plan_params
from pretouch.cli.calibrate.options import Calibrate, MotionOptions
from pretouch.cli.tables import show
from pretouch.cli.writing import check_writable, unwritable_said
from pretouch.errors import CalibrationError
from pretouch.experiments.calibration.study import study
from pretouch.experiments.calibration.table import tables
from pretouch.whole_file import write_json


def study_skins(command: Calibrate) -> None:
    """Calibrate random skins, show how far the answers are off, and write them down."""
    asked, json_file = command.study, Path(command.json) if command.json else None
    if asked.skins < 1:
        raise CalibrationError(f"The number of skins is {asked.skins}: give at least 1.")
    if command.seed < 0:
        raise CalibrationError(f"The seed is {command.seed}: it must be at least 0.")
    if json_file:
        check_writable("file", json_file)
    model = arm_model(command.arm)
    plan = None if command.motion == MotionOptions() else plan_motion(model, plan_params(command.motion))
    columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn()
    with Progress(*columns, TimeElapsedColumn(), TimeRemainingColumn(), console=Console(stderr=True)) as bar:
        task = bar.add_task("simulations", total=asked.skins * (1 + asked.compared))
        found = study(
            model, asked.skins, command.seed, asked.compared, not asked.find_links, plan,
            progress=lambda done, _total: bar.update(task, completed=done),
        )  # fmt: skip
    console = Console(highlight=False)
    show(console, tables(found))
    if json_file:
        with unwritable_said("file", json_file):
            write_json(found.as_json(), json_file)
        console.print(f"Numbers: {json_file}", soft_wrap=True, markup=False)
