"""Detectors on the steps of a stream: with the reactions to alarms, or alarms alone in one compiled pass."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pretouch.compiled import entry, kernel
from pretouch.contact.moving_thresholds import MovingThresholds, compare
from pretouch.contact.reaction import DecayingVelocity, reaction_velocity
from pretouch.contact.residual_model import SequentialNumbers, SequentialState, sequential_init, sequential_numbers
from pretouch.contact.scatter import LENGTHS
from pretouch.contact.sequential import Moment, force_map_into
from pretouch.contact.sequential_step import SampleTest, assess_sample
from pretouch.contact.sequential_test import SequentialTest
from pretouch.contact.touch_cue import no_cues
from pretouch.contact.window import Window, add_sample, window_init
from pretouch.params import TaskParams, ThresholdParams, WindowParams
from pretouch.records import zeros
from pretouch.robot.kinematics import Hinges, Kinematics, Mechanism, place
from pretouch.robot.model import RobotModel
from pretouch.types import BoolArray, FloatArray, IntArray, Obstacles, RobotState, some_of
from pretouch_lab.baselines.fixed_bounds import FixedBounds
from pretouch_lab.bench.contenders import Contender
from pretouch_lab.bench.streams import Stream
from pretouch_lab.replay import DetectorAlone, FirstMotion

REST = DecayingVelocity().decay_cycles
"""Control cycles of the reaction to an alarm; no other alarm counts in them."""
PERIOD_S = TaskParams().control_period_s


@dataclass(frozen=True)
class Replayed:
    """Alarms and reactions of a detector in S steps."""

    stamp: FloatArray
    """(S,) [s]."""
    alarm: BoolArray
    """(S,) true where a contact was detected."""
    force: FloatArray
    """(S, 3) force of the detected contact [N], else NaN."""
    motion: FloatArray
    """(S, n) first joint velocities of the reaction to an alarm [rad/s], else NaN."""
    statistic: FloatArray
    """(S,) see `Contender.statistic`."""

    def onsets(self, value: float | None = None) -> list[int]:
        """Return the steps at which an alarm begins, with the detector's parameter or a value of the sweep."""
        return begun(self.alarm if value is None else self.statistic > value)


def begun(alarm: BoolArray, rest: int = REST) -> list[int]:
    """Return the steps at which an alarm begins, from flags (S,); each alarm has a reaction of `rest` steps."""
    at, onsets, i = np.flatnonzero(alarm), [], 0
    while i < len(at):
        onsets.append(int(at[i]))
        i = int(np.searchsorted(at, at[i] + rest))
    return onsets


@dataclass(frozen=True)
class Steps:
    """The steps of a stream, computed once for all detectors."""

    stream: Stream
    model: RobotModel

    @cached_property
    def each(self) -> list[tuple[RobotState, Obstacles, bool, bool, Kinematics]]:
        """Inputs of each step: robot, obstacles, flags for a reaction and for a watching skin, and posture."""
        return [(*step, self.model.kinematics(step[0].q)) for step in self.stream.steps()]

    def replay(self, contender: Contender) -> Replayed:
        """Replay all steps of an arm that never reacts to a detector, and compute the reactions to its alarms."""
        params, model, react = contender.profile, self.model, contender.profile.react
        if isinstance(react, DecayingVelocity):
            replayed = alarms_of(self, contender)
            for at in replayed.onsets():
                # eq. 12 by the least joint velocities, as in eq. 2 far from limits and singularities
                least = np.linalg.pinv(model.ee_jacobian(self.each[at][-1])[:3])
                push = reaction_velocity(replayed.force[at], react.compliance_m_s_n, react.speed_max_m_s)
                replayed.motion[at] = least @ push
            return replayed
        sees, steps, end = params.perception is not None, len(self.stream.count), 0
        every, count = self.stream.near(params.perception)
        detector, first = DetectorAlone(params, model), FirstMotion(model, params, self.stream.robot["q"][0], REST)
        alarm, statistic, force = np.zeros(steps, np.bool_), np.empty(steps), np.full((steps, 3), np.nan)
        motion = np.full((steps, model.n), np.nan)
        for i, (robot, _, reacting, watched, kin) in enumerate(self.each):
            end += count[i]
            near = some_of(every, end - count[i], end)
            detection = detector.step(kin, robot, near, reacting, sees and watched)
            statistic[i] = contender.statistic(detection, detector.window.newest, robot.wrench)
            if detection.contact is not None:
                alarm[i], force[i] = True, detection.contact.force
            begins = first.step(kin, robot, detection, near)
            if begins is not None:
                motion[i] = begins
        return Replayed(self.stream.stamp, alarm, force, motion, statistic)


def alarms_of(steps: Steps, contender: Contender) -> Replayed:
    """Replay a stream without `Replayed.motion`, in an eighth of the time or less."""
    stream, model, params = steps.stream, steps.model, contender.profile
    robot, detect, sees = stream.robot, params.detect, params.perception is not None
    count, valid = len(stream.count), np.isfinite(robot["wrench"][:, 0])
    armed = np.cumsum(valid) - valid >= params.window.samples
    statistic, force = np.full(count, -np.inf), np.full((count, 3), np.nan)
    near = stream.near(params.perception)
    if isinstance(detect, MovingThresholds):
        alarm, window = np.zeros(count, np.bool_), window_init(params.window.samples)
        thresholds = detect.numbers, params.window.numbers, detect.compare == "filtered"
        out = alarm, statistic, force
        _by_thresholds(model.hinges, model.ee, (robot["q"], robot["wrench"]), near, (*thresholds, window), out)
    elif isinstance(detect, FixedBounds):
        force, share = robot["wrench"][:, :3].copy(), (np.abs(robot["tau_ext"]) / detect.bounds(model.n)).max(axis=1)
        statistic = np.fmax(share, np.sqrt((force * force).sum(axis=1)) / detect.force_n)
        alarm = statistic >= 1.0
        for at in np.flatnonzero(alarm & ~valid):
            force_map_into(model.ee_jacobian(model.kinematics(robot["q"][at])), inverse := np.empty((3, model.n)))
            force[at] = inverse @ robot["tau_ext"][at]
    elif isinstance(detect, SequentialTest):
        begin = sequential_init(model.n, detect)
        # parts of the first state are one array
        state = SequentialState._make((begin.model, *(part.copy() for part in begin[1:])))
        results = zeros(SampleTest, n=model.n, W=len(LENGTHS))
        test = state, sequential_numbers(model.n, params.task.control_period_s, detect), results
        watch = (stream.watched > 0.0) & sees, no_cues(len(model.links)).gain
        reports = robot["q"], robot["qd"], robot["qd_commanded"], robot["tau_ext"]
        _by_sequential_test(model.hinges, model.mechanism, reports, near, (*watch, *test), statistic)
        alarm = statistic >= 1.0
    else:
        raise TypeError(f"the detector {detect.name} has no compiled pass")
    nothing = np.full((count, model.n), np.nan)
    return Replayed(stream.stamp, alarm & armed, force, nothing, np.where(armed, statistic, -np.inf))


_Wrenches = tuple[FloatArray, FloatArray]
_Alarms = tuple[BoolArray, FloatArray, FloatArray]
_Near = tuple[Obstacles, IntArray]
"""Obstacles of all steps, one after the other, and their number in each step (S,)."""
_Thresholds = tuple[ThresholdParams, WindowParams, bool, Window]
"""Parameters of the thresholds, and True to compare the filtered force; the window is updated in place."""
_Test = tuple[BoolArray, FloatArray, SequentialState, SequentialNumbers, SampleTest]
"""Flags (S,) of a watching skin and gain of each link; the rest belongs to the test and is updated in place."""


@entry
def _by_thresholds(hinges: Hinges, ee: int, robot: _Wrenches, near: _Near, params: _Thresholds, out: _Alarms) -> None:
    """Write alarms (S,), the largest base forces (S,) that keep them, and F_ext (S, 3), eqs. 8-12.

    `robot` has q and the wrench. The window leaves out steps without an estimate of the force, NaN.
    """
    (q, wrench), (obstacles, number), (alarm, statistic, force) = robot, near, out
    thresholds, p, filtered, window = params
    kin, parts, end = _unplaced(hinges), np.empty((6, 3)), 0
    for i in range(len(q)):
        end += number[i]
        if np.isnan(wrench[i, 0]):
            continue
        place(hinges, q[i], kin)
        add_sample(window, wrench[i, :3], p)
        compared = window.sums[0] if filtered else wrench[i, :3]
        some = some_of(obstacles, end - number[i], end)
        alarm[i], _ = compare(window, compared, kin.position[ee], some, thresholds, parts)
        statistic[i] = np.max(np.maximum(compared - parts[0], parts[1] - compared)) + thresholds.f_base_n
        force[i] = compared - parts[2]


@entry
def _by_sequential_test(
    hinges: Hinges, mechanism: Mechanism, robot: tuple[FloatArray, ...], near: _Near, test: _Test, statistic: FloatArray
) -> None:
    """Write the evidence (S,) of a test. `robot` has q, qd, qd_commanded and tau_ext."""
    (q, qd, qd_commanded, tau_ext), (obstacles, number), kin, end = robot, near, _unplaced(hinges), 0
    watched, gain, state, numbers, results = test
    for i in range(len(q)):
        end += number[i]
        place(hinges, q[i], kin)
        some = some_of(obstacles, end - number[i], end)
        now = Moment(kin, qd[i], qd_commanded[i], tau_ext[i], some, gain, watched[i], False)
        assess_sample(state, now, numbers, mechanism, results)
        statistic[i] = results.log_likelihood_ratio[0]


@kernel
def _unplaced(hinges: Hinges) -> Kinematics:
    links, n = len(hinges.parent), len(hinges.joint)
    return Kinematics(np.empty((links, 3)), np.empty((links, 3, 3)), np.empty((n, 3)), np.empty((n, 3)))
