"""What `pretouch skin calibrate --robot` does: the arm makes the motion, all is recorded, and that is calibrated."""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import partial
from itertools import count
from pathlib import Path
from shlex import join
from typing import TYPE_CHECKING

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeRemainingColumn

from pretouch.calibration.motion.perform import PerformParams
from pretouch.calibration.motion.plan import Plan
from pretouch.calibration.motion.report import report_on
from pretouch.calibration.motion.route import approach
from pretouch.cli.calibrate.motion import planned
from pretouch.cli.calibrate.outputs import Outputs, check_free, same_file
from pretouch.cli.calibrate.recording import Sources, calibrate_recording
from pretouch.cli.calibrate.session import Session
from pretouch.cli.skin_keys import keys_file
from pretouch.cli.skin_simulate import keys_for
from pretouch.cli.writing import check_writable
from pretouch.errors import CalibrationError, HardwareError
from pretouch.hardware.address import EVERYWHERE, HOST
from pretouch.hardware.network_skin import NetworkSkin
from pretouch.recording.skin_recording import SkinRecording
from pretouch.robot.model import RobotModel
from pretouch.robot.named import robot_named
from pretouch.sensing.skin import skin_for
from pretouch.serving.simulated_arm import CATCH_UP_S, SimulatedArm, SimulateOptions
from pretouch.signals import Terminated

if TYPE_CHECKING:
    from pretouch.cli.calibrate.options import Calibrate, MotionOptions

_ROBOTS = ("simulated",)


def calibrate_live(command: "Calibrate", outputs: Outputs) -> int:
    """Calibrate the units of an arm that is moved; return 1 if a unit was refused or the motion ended early, or 0."""
    if command.live.robot not in _ROBOTS:
        raise HardwareError(
            f"--robot {command.live.robot!r} is not supported: choose {' or '.join(_ROBOTS)}, or run the motion of"
            " --plan with your own driver and calibrate from its --recording."
        )
    if not outputs.skin:
        raise CalibrationError("--out is missing: name the skin file to write.")
    if not command.live.units_host:
        raise HardwareError(f"--units-host is empty: give {HOST}, or {EVERYWHERE} for every address of this machine.")
    place = _recording_place(command)
    model, again = RobotModel(robot_named(command.arm)), _again(command, place)
    with _session(command, model) as session:
        ways = _ways(session, model, command.motion)
        if not command.live.yes:
            _ask(sum(way.duration for way in ways))
        print("Waiting for the units.", flush=True)
        session.wait_for_units()
        print(f"All measurements are recorded in {place}. {again}", flush=True)
        stopped = _recorded(session, ways, place, again)
    if stopped:
        return 1
    skin = Path(command.skin) if command.skin else None
    try:
        return calibrate_recording(model, Sources(place, skin=skin), outputs)
    except BaseException:
        with suppress(OSError):  # the terminal may be gone
            print(f"The calibration was not finished. The measurements are in {place}. {again}", flush=True)
        raise


def _recording_place(command: "Calibrate") -> Path:
    """Return the recording to write, which is not there yet."""
    out, others = Path(command.out), [Path(file) for file in (command.out, command.json) if file]
    beside = (out.with_name(f"{out.stem}-calibration-{n}.mcap") for n in count(1))
    free = (one for one in beside if not one.exists() and not any(same_file(file, one) for file in others))
    place = Path(command.live.record or next(free))
    check_free("recording", place, replace=False)
    check_writable("recording", place)
    return place


@contextmanager
def _session(command: "Calibrate", model: RobotModel) -> Iterator[Session]:
    """Hear the units of a simulated arm."""
    skin = skin_for(model, command.skin)
    keys = keys_for(keys_file(command.live.keys), skin)
    host = command.live.units_host
    with NetworkSkin(skin.network, keys, host, command.live.units_port) as source:
        here = HOST if host == EVERYWHERE else host
        options = SimulateOptions(model, skin, keys, here, source.address[1], hand=False, seed=command.seed)
        with SimulatedArm(options, model.description.q_ready, PerformParams().period_s, late=CATCH_UP_S) as arm:
            yield Session(arm, model, source, skin.network.ids)
        if arm.clock.left_out:
            print(f"This machine is too slow by {arm.clock.left_out:.1f} s for the simulation: its data have gaps.")


def _ways(session: Session, model: RobotModel, options: "MotionOptions") -> list[Plan]:
    """Return the motion, after a motion to its start if the arm is elsewhere, and print the space for both."""
    plan, params = planned(model, options)
    print(report_on(model, plan, params), flush=True)
    q = session.posture()
    if np.abs(q - plan.start).max() <= PerformParams().start_tolerance_rad / 2:
        return [plan]
    way = approach(model, q, plan, params)
    room = report_on(model, way, params)
    ranges = ", ".join(f"{axis} {a:.2f} to {b:.2f}" for axis, a, b in zip("xyz", room.low, room.high, strict=True))
    print(f"Before that, moving to its start takes {way.duration:.0f} s and needs the space {ranges} m.", flush=True)
    return [way, plan]


def _ask(duration: float) -> None:
    """Have a person let the arm move for a time [s]; CalibrationError if none does."""
    print("While the arm moves, nobody may be within its reach, and nothing in the space given above.", flush=True)
    try:
        answer = input(f"Let it move for {duration:.0f} s? [y/N] ")
    except EOFError:
        raise CalibrationError("There is no terminal to ask for permission to move the arm: give --yes.") from None
    if answer.strip().lower() not in ("y", "yes"):
        raise CalibrationError("The arm was not moved: answer y to allow it.")


def _recorded(session: Session, ways: list[Plan], place: Path, again: str) -> str | None:
    """Let the arm move, and record all; return why it was stopped, or None."""
    with SkinRecording(place) as recording:
        session.record(recording)
        try:
            stopped = _moved(session, ways)
        except (KeyboardInterrupt, Terminated):
            with suppress(OSError):  # the terminal may be gone
                print(f"The arm was stopped. {recording.close()} {again}", flush=True)
            raise
        except BaseException:
            print(recording.close(), flush=True)
            raise
        kept = recording.close()
    print(f"The motion was ended early. {stopped}\n{kept} {again}" if stopped else kept, flush=True)
    return stopped


def _moved(session: Session, ways: list[Plan]) -> str | None:
    """Let the arm go to the start of the motion and make it; return why it was stopped, or None."""
    columns = TextColumn("{task.description}"), BarColumn(), TimeRemainingColumn()
    with Progress(*columns, console=Console(stderr=True)) as bar:
        for way in ways:
            task = bar.add_task("motion" if way is ways[-1] else "motion to its start", total=way.duration)
            stopped = session.follow(way, partial(_progress, bar, task))
            if stopped:
                return stopped
        session.stand()
    return None


def _progress(bar: Progress, task: TaskID, since: float) -> None:
    bar.update(task, completed=since)


def _again(command: "Calibrate", place: Path) -> str:
    """Say how to calibrate from the recording alone."""
    words = ["pretouch", "skin", "calibrate", "--recording", str(place), "--arm", command.arm, "--out", command.out]
    for option, value in (("--skin", command.skin), ("--json", command.json)):
        words += [option, value] if value else []
    return f"To calibrate from it: {join([*words, *(['--replace'] if command.replace else [])])}"
