"""What `pretouch skin calibrate` does, by the way it is asked to."""

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from pretouch.cli.arms import arm_model
from pretouch.cli.calibrate.motion import write_motion
from pretouch.cli.calibrate.outputs import Outputs
from pretouch.cli.calibrate.recording import Sources, calibrate_recording

if TYPE_CHECKING:
    from pretouch.cli.calibrate.options import Calibrate, Way


def calibrate_skin(command: "Calibrate", way: "Way") -> int:
    """Calibrate; return 1 if a unit was refused, the motion was not finished, or nobody reads on, or else 0."""
    try:
        code = _calibrated(command, way)
        sys.stdout.flush()
    except BrokenPipeError:
        with open(os.devnull, "w") as nowhere:  # what is still in the buffer goes there
            os.dup2(nowhere.fileno(), sys.stdout.fileno())
        return 1
    return code


def _calibrated(command: "Calibrate", way: "Way") -> int:
    if way == "plan":
        write_motion(command)
        return 0
    outputs = Outputs.of(command)
    if way == "robot":
        from pretouch.cli.calibrate.live import calibrate_live

        return calibrate_live(command, outputs)
    c = command.recorded
    joints, skin = (Path(text) if text else None for text in (c.joints, command.skin))
    return calibrate_recording(arm_model(command.arm), Sources(Path(c.recording), joints, c.topic, skin), outputs)
