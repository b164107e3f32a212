"""What `pretouch skin calibrate --plan` does: the motion for one's own driver."""

from pathlib import Path
from typing import TYPE_CHECKING

from pretouch.calibration.motion.limits import PlanParams
from pretouch.calibration.motion.plan import Plan
from pretouch.calibration.motion.planner import plan_motion
from pretouch.cli.writing import check_free, check_writable, unwritable_said
from pretouch.robot.description import robot_named
from pretouch.robot.model import RobotModel

if TYPE_CHECKING:
    from pretouch.cli.calibrate.options import Calibrate, MotionOptions


def plan_params(options: "MotionOptions") -> PlanParams:
    """Return what is asked of the motion."""
    return PlanParams(
        duration_s=options.duration, variant=options.variant, reach_rad=options.reach, speed_m_s=options.speed,
        clearance_m=options.clearance, floor_m=options.floor,
    )  # fmt: skip


def planned(model: RobotModel, options: "MotionOptions") -> tuple[Plan, PlanParams]:
    """Plan the motion, and say so, for it takes some seconds."""
    params = plan_params(options)
    print("The motion is being planned.", flush=True)
    return plan_motion(model, params), params


def write_motion(command: "Calibrate", place: Path) -> None:
    """Plan the motion, write it as CSV, and print the time and the room it takes."""
    check_free("motion", place, command.replace)
    check_writable("file", place)
    model = RobotModel(robot_named(command.arm))
    plan, params = planned(model, command.motion)
    with unwritable_said("file", place):  # first, for nobody may read on what is printed
        plan.save(place)
    print(report_on(model, plan, params))
    print(f"Motion: {place}. Keep everybody out of the arm's reach while it runs.", flush=True)
