"""`pretouch skin calibrate ARM`: the arm makes the motion, which is recorded and used for the calibration."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path
from shlex import join
from typing import Generic

import numpy as np

from pretouch.arms import ArmSetup, OpenedArm
from pretouch.calibration.motion.follow import START_RAD, plan_controller
from pretouch.calibration.motion.limits import PlanLimits, PlanParams
from pretouch.calibration.motion.plan import Plan
from pretouch.calibration.motion.planner import approach, plan_motion
from pretouch.cli.calibrate.recorded import CalibrateRecording, CalibrationFiles, calibrate_recorded
from pretouch.cli.options import A, OptionalFile, UnitOptions
from pretouch.cli.run.setup import heard_units
from pretouch.cli.writing import numbers_to
from pretouch.errors import CalibrationError, HardwareError, RecordingError, RobotError
from pretouch.loop import Cycle, MonotonicClock
from pretouch.ports import Arm
from pretouch.profiles import PROFILES
from pretouch.robot.description import robot_named
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import skin_for
from pretouch.session.run import Ending, go
from pretouch.session.terminal import require_yes
from pretouch.types import RobotState
from pretouch.units.skin import NetworkSkin
from pretouch.units.skin_recording import SkinRecording
from pretouch.units.watch import UnitWatch

_LOOK_S = 0.1
"""Time between two looks at the units before the motion [s]."""
_AFTER_S = 0.5
"""Time after a motion until all of its measurements have arrived [s]."""


@dataclass(frozen=True)
class CalibrateArm(Generic[A]):
    """Move an arm along the calibration motion, find the pose of each unit, and write the skin file.

    Nothing sees a person meanwhile. The exit code is 1 if a unit was refused or the motion ended early.
    """

    connection: A
    units: UnitOptions = field(default_factory=UnitOptions)
    motion: PlanParams = field(default_factory=PlanParams)
    files: CalibrationFiles = field(default_factory=CalibrationFiles)
    record: OptionalFile = None
    """Recording to write; by default a new one beside the skin file."""
    yes: bool = False
    """Do not ask before the arm moves."""

    def run(self) -> int:
        """Move the arm, calibrate, and show and write the answer."""
        out = self.files.out
        if not out:
            raise CalibrationError("--out is missing: name the skin file to write.")
        if not (self.units.keys or self.connection.brings_units):
            raise HardwareError("The arm brings no sensor units: give the file of their keys with --keys.")
        beside = (out.with_name(f"{out.stem}-calibration-{n}.mcap") for n in count(1))
        place = self.record or next(one for one in beside if not one.exists())
        self.files.check([self.units.keys], place)
        model = RobotModel(self.connection.described(robot_named(self.files.arm)))
        code = None
        with numbers_to(self.files.json) as write:
            try:
                if not self._moved(model, place):
                    code = calibrate_recorded(model, CalibrateRecording(place), self.files, write)
            finally:
                if code is None and place.exists():
                    with suppress(OSError):  # the terminal may be gone
                        print(f"The measurements are in {place}. {self._again(place)}", flush=True)
        return 1 if code is None else code

    def _again(self, place: Path) -> str:
        """Say how to calibrate from the recording alone."""
        files = {"recording": place} | vars(self.files)
        options = ((f"--{name}", value) for name, value in files.items() if value)
        words = [part for option, value in options for part in ([option] if value is True else [option, str(value)])]
        return f"To calibrate from it: pretouch skin calibrate {join(words)}"

    def _moved(self, model: RobotModel, place: Path) -> bool:
        """Move the arm along the motion, and record it; return whether it ended early."""
        skin = skin_for(model, self.files.skin, paper=True)
        setup = ArmSetup(
            name=self.files.arm,
            model=model,
            skin=skin,
            units=not self.units.keys,
            profile=PROFILES["blind"],
            start=lambda: model.description.q_ready,
            floor=self.motion.floor_m,
            priority=None,
            yes=self.yes,
        )
        self.connection.check(setup)
        with self.connection.open(setup) as opened, heard_units(self.units, skin, opened) as units:
            if not isinstance(units, NetworkSkin):
                raise HardwareError(
                    "The units' IMUs are heard over the network: give the file of their keys with --keys."
                )
            plans = _plans(opened.arm, model, self.motion)
            if not self.yes:
                print("While the arm moves, nobody may be within its reach, and nothing in the space given above.")
                question = f"Let it move for {sum(plan.duration for plan in plans):.0f} s?"
                require_yes(question, "The arm was not moved")
            if against := opened.arm.unfit():
                raise RobotError(" ".join(against))
            print("Waiting for the units.", flush=True)
            UnitWatch(units, _LOOK_S).wait(MonotonicClock(0.01))
            print(f"All measurements are recorded in {place}. {self._again(place)}", flush=True)
            with SkinRecording(place) as recording:
                measurements = Measurements(recording, units, skin.network.ids, model.joints, opened.measured)
                early = _move(opened, model, plans, measurements)
            if report := opened.arm.report():
                print(report, flush=True)
        return early


def _plans(arm: Arm, model: RobotModel, params: PlanParams) -> list[Plan]:
    """Return the motion, after a motion to its start if the arm is elsewhere, and print the space for both."""
    print("The motion is being planned.", flush=True)
    plan, limits, q = plan_motion(model, params), PlanLimits(model, params), np.array(arm.read().q)
    print(limits.report(plan), flush=True)
    if np.abs(q - plan.start).max() <= START_RAD / 2:
        return [plan]
    way = approach(model, q, plan.start, params)
    room = limits.room(way)
    print(f"Before that, moving to its start takes {way.duration:.0f} s and needs the space {room} m.", flush=True)
    return [way, plan]


class Measurements:
    """Recorder of units and joints while an arm moves; a `loop.Recorder`."""

    def __init__(
        self,
        recording: SkinRecording,
        units: NetworkSkin,
        ids: tuple[str, ...],
        joints: tuple[str, ...],
        measured: Callable[[], RobotState] | None = None,
    ) -> None:
        """Take where to record, what hears the units of these ids, the joints' names, and `OpenedArm.measured`."""
        self.recording, self._units, self._ids, self._joints = recording, units, ids, joints
        self._measured, self._newest = measured, -np.inf
        units.take_samples()  # of before

    def record(self, cycle: Cycle) -> None:
        """Record what is new; a receiver that has ended, and a disk that is full, are an error."""
        self.take()
        state = self._measured() if self._measured else cycle.inputs.robot
        if state.stamp > self._newest:
            self._newest = state.stamp
            q, qd = (np.array(values)[None] for values in (state.q, state.qd))
            self.recording.joints(np.array([state.stamp]), q, qd, self._joints)
        if self.recording.trouble:
            raise RecordingError(self.recording.trouble)

    def take(self) -> None:
        """Record what the units have measured."""
        if not self._units.alive:
            raise HardwareError("The receiver of the units has ended: see what it printed.")
        self.recording.add(self._units.take_samples(), self._ids)


def _move(opened: OpenedArm, model: RobotModel, plans: list[Plan], measurements: Measurements) -> bool:
    """Move the arm along plans, and wait until all measurements have arrived; return whether it ended early."""
    controller, ending = plan_controller(model, np.array(opened.arm.read().q)), Ending()
    try:
        for plan in plans:
            print(f"The arm moves for {plan.duration:.0f} s.", flush=True)
            go(opened.arm, controller, plan, ending, measurements, opened.left_out)
            if ending.early:
                return True
        clock = MonotonicClock(controller.limits.period)
        begin = clock.tick()
        while clock.tick() - begin < _AFTER_S:
            measurements.take()
    finally:
        sentences = (*ending.sentences(), measurements.recording.close())
        with suppress(OSError):  # the terminal may be gone
            print("\n".join(sentences), flush=True)
    return False
