"""From a reading to a joint velocity: the paper on one page.

`Controller.step(state, inputs) -> (ControlStep, state)` is pure: no clock, no file, no memory beside the state.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from pretouch.contact.detector import Body, Sample
from pretouch.contact.reaction import ReactionInputs
from pretouch.contact.residual_model import ResidualModel
from pretouch.contact.window import WindowState, add_force, window_init
from pretouch.control import path as paths
from pretouch.control.interface import MotionBody, MotionRequest
from pretouch.control.joint_box import joint_limits
from pretouch.control.motion import MotionState, joint_motion, restriction_on
from pretouch.control.reduction import ReductionState, reduce_speed, speed_scale
from pretouch.control.setup import motion_setup
from pretouch.errors import RobotStateError, SkinError
from pretouch.events import events_of
from pretouch.faults import (
    Watch,
    examine,
    sound_imu,
    sound_points,
    sound_readings,
    sound_robot,
    sound_touch,
    watch_init,
)
from pretouch.modes import Event, ModeState, mode_init, next_mode
from pretouch.perception.obstacles import TrackState, track_init
from pretouch.perception.outside import OutsideState, outside_silence, see_outside
from pretouch.perception.perceive import perceive, perception_setup, silent_units
from pretouch.perception.scene_filter import Fixtures
from pretouch.profiles import Profile
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.types import ControlStep, FloatArray, Inputs, Mode, QpOutcome, RobotState
from pretouch.values import value


@value
class ControllerState:
    """All the controller remembers from one step to the next."""

    watch: Watch
    tracks: TrackState
    window: WindowState
    """Of the external force, eq. 8."""
    detector: object
    """What the profile's detector remembers."""
    reduction: ReductionState
    reaction: object
    path: paths.PathState
    approach: object
    """What the profile's restriction remembers."""
    motion: MotionState
    mode: ModeState
    command: FloatArray
    """(n,) last joint velocity command [rad/s]."""
    rotation_goal: FloatArray
    """(3, 3) R_O_ee at the start, held if the task asks for it."""
    outside: OutsideState | None = None
    """What outside sources showed; None before there is one."""


STAGES = ("state", "kinematics", "perception", "contact", "mode", "path", "motion", "record")
"""What a step is made of, in order."""


class Controller:
    """The line from readings to joint velocities for one arm, skin, surrounding, path and profile.

    `mark` is told the name of each of `STAGES` as it ends, so that a caller with a clock can see where the time goes.
    """

    def __init__(
        self, model: RobotModel, skin: Skin, fixtures: Fixtures, path: paths.Path, profile: Profile,
        mark: Callable[[str], None] = lambda stage: None,
    ) -> None:  # fmt: skip
        self.model, self.skin, self.fixtures, self.path, self.profile = model, skin, fixtures, path, profile
        for unit, link in zip(skin.units, skin.link, strict=True):
            if model.link_index(unit.link) != link:
                raise SkinError(f"The skin was made for another arm than {model.description.name}: make one for it.")
        self.limits = joint_limits(model, profile.task.position_margin_rad, profile.task.control_period_s)
        self._sight = perception_setup(model, skin, fixtures, profile.perception)
        self._moved = MotionBody(model, len(skin), self.limits, profile.task)
        self._approach = restriction_on(profile.approach, self._moved)
        self._setup = motion_setup(self._moved, profile.null_space, profile.failure.solver_iterations)
        self.body = Body(model, skin, self.limits.period, fixtures.planes, fixtures.capsules)
        self._detector = profile.detect.on(self.body)
        self._units = len(skin)
        self._touching = "touch" in profile.detect.reads and len(skin.touching) > 0
        self._shaken = "imu" in self._detector.reads
        self._mark = mark

    def init(self, robot: RobotState, learnt: ResidualModel | None = None) -> ControllerState:
        """Return the state before the first step; a robot state that cannot be used is a RobotStateError.

        `learnt` is the arm's free motion as an earlier session left it, for a detector that learns it.
        """
        sound, wrong = sound_robot(robot, self.limits.qd_max)
        if sound is None:
            raise RobotStateError(f"The controller cannot start: {wrong}: check the connection to the arm.")
        return ControllerState(
            watch=watch_init(sound),
            tracks=track_init(len(self.skin)),
            window=window_init(self.profile.window.samples),
            detector=self._detector.init(self.body, learnt),
            reduction=ReductionState(),
            reaction=self.profile.react.init(self.body, sound.q_commanded),
            path=paths.PathState(),
            approach=self._approach_init(),
            motion=MotionState(np.zeros(self.model.n)),
            mode=mode_init(),
            command=sound.qd_commanded,
            rotation_goal=self.model.kinematics(sound.q).rotation[self.model.ee],
        )

    def adopt(self, state: ControllerState, before: "Controller") -> ControllerState:
        """Go on from a state of another controller of the same arm and skin, with this one's profile and path.

        A force window of another length, and another method of detection, begin anew; another path is joined where it
        is nearest, and the speed along it grows from 0. A reaction that is over stays so.
        """
        mine, theirs, robot = self.profile, before.profile, state.watch.robot
        if len(state.command) != self.model.n or len(state.tracks.point) != len(self.skin):
            raise RobotStateError("The state is that of a controller for another arm or skin: begin with init().")
        same_window = mine.window.samples == theirs.window.samples and type(mine.detect) is type(theirs.detect)
        same_points = mine.perception.outside_points == theirs.perception.outside_points
        way = state.path
        if self.path is not before.path:
            way = paths.joined(self.path, self.model.kinematics(robot.q).position[self.model.ee])
        return replace(
            state,
            window=state.window if same_window else window_init(mine.window.samples),
            detector=self._detector.adopted(state.detector, self.body, before._detector)
            if same_window
            else self._detector.init(self.body),
            reaction=mine.react.adopted(state.reaction, self.body, theirs.react, robot.q_commanded),
            path=way,
            approach=state.approach if mine.approach == theirs.approach else self._approach_init(),
            motion=state.motion if mine.null_space == theirs.null_space else MotionState(np.zeros(self.model.n)),
            outside=state.outside if same_points else None,
        )

    def _approach_init(self) -> object:
        """Return what the restriction remembers at first; a part says so itself, whatever works in its place."""
        return None if self.profile.approach is None else self.profile.approach.init(self._moved)

    def step(self, state: ControllerState, inputs: Inputs) -> tuple[ControlStep, ControllerState]:
        """Run one control cycle; to be called once a period, with the state that the step before returned."""
        p, model, units, mark = self.profile, self.model, self._units, self._mark
        if len(state.command) != model.n or len(state.tracks.point) != units:
            raise RobotStateError("The state is that of a controller for another arm or skin: begin with init().")
        robot, events, watch = examine(
            state.watch, inputs, state.command, self.limits.period, self.limits.qd_max, p.failure, p.detect.by_torques
        )
        readings, unfit = sound_readings(inputs.readings, units)
        touches, wrong = sound_touch(inputs.touch, units) if self._touching else (None, "")
        points, lost = sound_points(inputs.points)
        unfit, now = unfit or wrong, watch.stamp
        mark("state")
        kin = model.kinematics(robot.q)
        x = kin.position[model.ee]
        mark("kinematics")

        # what is near: eq. 1 and the closest points of the body
        known = track_init(units) if Event.TIME_BACKWARDS in events else state.tracks
        seen, tracks = perceive(known, self._sight, kin, readings, now, robot)
        seen, outside = see_outside(
            state.outside, Event.TIME_BACKWARDS in events, seen, points, self._sight, kin, robot, now
        )
        heard, silent = silent_units(self.skin, tracks, readings.status, seen.longest_silence, now, p.perception)
        told, lost = outside_silence(outside, lost, now, p.perception)
        mark("perception")

        # what is felt: eqs. 8-11
        watched = p.perception.enabled and units > 0 and heard >= 1.0 and not silent
        reacting = state.mode.mode is Mode.REACT
        window = add_force(state.window, None if robot.wrench is None else robot.wrench[:3], p.window)
        imu = sound_imu(inputs.imu, units) if self._shaken else None
        sample = Sample(now, kin, robot, window, state.window.full, seen.obstacles, reacting, watched, touches, imu)
        felt, detector = self._detector.step(state.detector, self.body, sample)
        if reacting and p.window.freeze_while_reacting:
            window = state.window
        mark("contact")

        # what to do
        given = ReactionInputs(
            state.mode, kin, robot, felt, seen.obstacles, bool(silent or lost), state.command,
            state.path.phase, inputs.resume,
        )  # fmt: skip
        answers, react = p.react.sense(state.reaction, self.body, given)
        events |= answers | events_of(unfit, silent, lost, felt, window.count, state.motion.blocked, p)
        mode = next_mode(state.mode, events, inputs.resume)
        contact = felt.contact if mode.mode is Mode.REACT is not state.mode.mode else None
        mark("mode")

        # how fast: eqs. 3-4 on the path, or the reaction
        slowed = 1.0 if p.slow is None else speed_scale(seen.nearest, p.slow.d_max_m)
        scale, reduction = reduce_speed(state.reduction, min(heard, told, slowed), p.task.restore_cycles)
        way = paths.follow(self.path, state.path, x, p.task)
        answer, react = p.react.move(react, self.body, given, mode)
        desired, qd = (way.scaled(scale), None) if answer is None else (answer.velocity, answer.qd)
        mark("path")

        # how near: eqs. 5-7, and the joint velocities: eq. 2
        touch = None if answer is None else answer.touch_speed
        room = units + (0 if outside is None else len(outside.sigma))
        hold = mode.mode is Mode.HOLD and qd is None
        request = MotionRequest(desired, state.rotation_goal, hold, mode.mode is Mode.TRACK, qd, touch, room)
        allowed, approach = self._approach.step(state.approach, self._moved, kin, robot, seen.obstacles, request)
        motion, moving = joint_motion(state.motion, self._setup, kin, robot, seen.obstacles, request, allowed)
        qp = motion.qp
        if qp.outcome in _TROUBLE and (qp.outcome is QpOutcome.FAILED or mode.mode is not Mode.HOLD):
            mode = next_mode(mode, {_TROUBLE[qp.outcome]: qp.status}, resume=False)
        mark("motion")

        reacts = mode.mode is Mode.REACT
        step = ControlStep(
            stamp=now, mode=mode.mode, reason=mode.reason, q=robot.q, q_commanded=robot.q_commanded,
            ee_position=x, ee_velocity=motion.ee_velocity, path_position=way.point,
            path_phase=state.path.phase, desired_velocity=np.zeros(3) if mode.mode is Mode.HOLD else desired,
            speed_scale=scale, range_distance=seen.distance, obstacles=seen.obstacles,
            force=np.full(3, np.nan) if robot.wrench is None else robot.wrench[:3],
            filtered_force=window.newest, thresholds=felt.thresholds, armed=felt.armed, contact=contact,
            reaction_velocity=desired if reacts else _STILL, restricted=motion.restricted,
            approach_limit=motion.approach_limit,
            qp=qp, command=qp.qd, residual=felt.residual, evidence=felt.evidence, touched=felt.touched,
        )  # fmt: skip
        after = ControllerState(
            watch=watch, tracks=tracks, window=window, detector=detector, reduction=reduction, reaction=react,
            path=paths.advance(self.path, state.path, way, motion.ee_velocity_commanded, p.task)
            if mode.mode is Mode.TRACK else paths.pause(state.path),
            approach=approach, motion=moving, mode=mode, command=qp.qd.copy(), rotation_goal=state.rotation_goal,
            outside=outside,
        )  # fmt: skip
        mark("record")
        return step, after


_STILL = np.zeros(3)
"""One for all steps: its numbers are not written to."""
_TROUBLE = {QpOutcome.FAILED: Event.SOLVER_FAILED, QpOutcome.INFEASIBLE: Event.BLOCKED}
