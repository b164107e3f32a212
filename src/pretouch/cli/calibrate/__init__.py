"""`pretouch skin calibrate` without an arm to move: from a recording, or the motion for one's own driver."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pretouch.arms import arm_class
from pretouch.calibration.motion.limits import PlanLimits, PlanParams
from pretouch.calibration.motion.planner import plan_motion
from pretouch.cli.calibrate.recorded import CalibrateRecording, CalibrationFiles, calibrate_recorded
from pretouch.cli.options import OptionalFile, split_arm
from pretouch.cli.writing import check_outputs, numbers_to, unwritable_said
from pretouch.errors import CalibrationError
from pretouch.robot.description import robot_named
from pretouch.robot.model import RobotModel


@dataclass(frozen=True)
class Calibrate:
    """Find the pose of each unit, from its IMU and the joint positions of the moving arm, and write the skin file.

    `pretouch skin calibrate NAME` moves an arm itself: simulated, franka, or one that another distribution adds.
    The exit code is 1 if a unit was refused.
    """

    recorded: CalibrateRecording = field(default_factory=CalibrateRecording)
    motion: PlanParams = field(default_factory=PlanParams)
    plan: OptionalFile = None
    """CSV file to write the motion to, for your own driver (time_s, q1_rad to qn_rad, qd1_rad_s to qdn_rad_s),
    instead of running it."""
    files: CalibrationFiles = field(default_factory=CalibrationFiles)

    @staticmethod
    def of_words(words: Sequence[str]) -> tuple[Any, Sequence[str], str]:
        """Return the command, the other words, and what is in front of them: the first word may name an arm."""
        name, others = split_arm(words)
        if len(others) == len(words):
            return Calibrate, words, "skin calibrate"
        from pretouch.cli.calibrate.live import CalibrateArm  # a help on the other options does not wait for this

        return CalibrateArm[arm_class(name)], others, f"skin calibrate {name}"  # type: ignore[misc]

    def run(self) -> int:
        """Calibrate, and show and write the answer; or write the motion."""
        recording, moved, files = self.recorded.recording, self.motion != PlanParams(), self.files
        if self.plan and recording:
            raise CalibrationError("--recording and --plan are given: choose one of them.")
        if not (self.plan or recording):
            raise CalibrationError(
                "The source of the calibration is missing: give --recording FILE or --plan FILE, or name an arm, as in"
                " `pretouch skin calibrate simulated`."
            )
        if (recording and moved) or (
            self.plan and (self.recorded != CalibrateRecording() or files.skin or files.out or files.json)
        ):
            wrong, mode = ("of the motion", "--recording") if recording else ("of a recording, or --out", "--plan")
            raise CalibrationError(f"Options {wrong} do not go with {mode}: leave them out.")
        if self.plan:
            self._write_motion(self.plan)
            return 0
        files.check([recording, self.recorded.joints])
        with numbers_to(files.json) as write:
            return calibrate_recorded(RobotModel(robot_named(files.arm)), self.recorded, files, write)

    def _write_motion(self, place: Path) -> None:
        check_outputs([("motion", place)], [], self.files.replace)
        model = RobotModel(robot_named(self.files.arm))
        print("The motion is being planned.", flush=True)
        plan = plan_motion(model, self.motion)
        with unwritable_said("file", place):  # first, for nobody may read on what is printed
            plan.save(place)
        print(PlanLimits(model, self.motion).report(plan))
        print(f"Motion: {place}. Keep everybody out of the arm's reach while it runs.", flush=True)
