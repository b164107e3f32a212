"""A detector given a recorded stream: what it would have taken for contacts."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pretouch.contact.reaction import DecayingVelocity
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.types import NOT_TOUCHED, BoolArray, FloatArray, Touched, TouchReadings, no_obstacles
from pretouch_lab.baselines.detection import Baseline
from pretouch_lab.benchmarks.detection.first_motion import FirstMotion
from pretouch_lab.benchmarks.detection.stream import Stream
from pretouch_lab.replay import DetectorAlone

NOTHING = no_obstacles()
"""What a profile without proximity is shown."""
REST = DecayingVelocity().decay_cycles
"""Control cycles for which an alarm is answered, and no other is looked for."""


Touches = Callable[[int], TouchReadings | None]
"""Gives what the units' touch sensors said in a step, by its number."""


@dataclass(frozen=True)
class Replayed:
    """What a detector made of S steps."""

    stamp: FloatArray
    """(S,) [s]."""
    alarm: BoolArray
    """(S,) whether a contact was found."""
    force: FloatArray
    """(S, 3) force it was taken for [N], NaN where none was found."""
    motion: FloatArray
    """(S, n) joint velocities with which the arm would begin to move in answer to an alarm [rad/s], else NaN."""
    statistic: FloatArray
    """(S,) see `Baseline.statistic`."""
    touched: list[Touched]
    """Where the arm was said to be touched in each of these steps."""

    def onsets(self, value: float | None = None) -> list[int]:
        """Return the steps at which an alarm begins; with another value of the sweep than the detector's, if given."""
        return begun(self.alarm if value is None else self.statistic > value)


def begun(alarm: BoolArray, rest: int = REST) -> list[int]:
    """Steps at which an alarm begins, given those (S,) with one: each is answered for `rest` steps."""
    at, found, i = np.flatnonzero(alarm), [], 0
    while i < len(at):
        found.append(int(at[i]))
        i = int(np.searchsorted(at, at[i] + rest))
    return found


def replay(
    stream: Stream, baseline: Baseline, model: RobotModel, touch: Touches = lambda step: None,
    skin: Skin | None = None,
) -> Replayed:  # fmt: skip
    """Give a detector each step of a stream, from its beginning, and what units said of a touch."""
    params = baseline.profile
    sees = params.perception is not None
    detector, steps = DetectorAlone(params, model, skin), len(stream.count)
    alarm, statistic = np.zeros(steps, np.bool_), np.empty(steps)
    force, touched = np.full((steps, 3), np.nan), [NOT_TOUCHED] * steps
    motion, first = np.full((steps, model.n), np.nan), FirstMotion(model, params, stream.robot["q"][0], REST)
    for i, (robot, obstacles, reacting, watched) in enumerate(stream.steps()):
        near = obstacles if sees else NOTHING
        kin = model.kinematics(robot.q)
        found = detector.step(kin, robot, near, reacting, sees and watched, touch(i))
        touched[i] = found.touched
        statistic[i] = baseline.statistic(found, detector.window.newest, robot.wrench)
        if found.contact is not None:
            alarm[i], force[i] = True, found.contact.force
        begins = first.step(kin, robot, found, near)
        if begins is not None:
            motion[i] = begins
    return Replayed(stream.stamp, alarm, force, motion, statistic, touched)
