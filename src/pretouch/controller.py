"""From a reading to a joint velocity: the paper on one page.

`Controller.step(state, inputs) -> (ControlStep, state)` is pure: no clock, no file, no memory beside the state.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from pretouch.contact import response
from pretouch.contact.cues import Cues, together
from pretouch.contact.feel import FeelState, feel, feel_init
from pretouch.contact.impact import ImpactState, impact_init, listen
from pretouch.contact.residual_model import ResidualModel
from pretouch.contact.tactile import TouchState, feel_touch, touch_init, touch_settings
from pretouch.control import path as paths
from pretouch.control.interface import Body, MotionRequest, restriction_on
from pretouch.control.joint_box import joint_limits
from pretouch.control.motion import MotionState, joint_motion
from pretouch.control.reduction import ReductionState, reduce_speed, speed_scale
from pretouch.control.setup import motion_setup
from pretouch.errors import RobotStateError, SkinError
from pretouch.events import doing, events_of
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
from pretouch.params import Profile
from pretouch.perception.obstacles import TrackState, track_init
from pretouch.perception.outside import OutsideState, outside_silence, see_outside
from pretouch.perception.perceive import perceive, perception_setup, silent_units
from pretouch.perception.scene_filter import Fixtures
from pretouch.robot.model import Kinematics, RobotModel
from pretouch.sensing.skin import Skin
from pretouch.types import ControlStep, FloatArray, Inputs, Mode, QpOutcome, RobotState, TouchReadings
from pretouch.values import value


@value
class ControllerState:
    """All the controller remembers from one step to the next."""

    watch: Watch
    tracks: TrackState
    feel: FeelState
    reduction: ReductionState
    reaction: response.ResponseState
    path: paths.PathState
    approach: object
    """What the profile's restriction remembers."""
    motion: MotionState
    mode: ModeState
    command: FloatArray
    """(n,) last joint velocity command [rad/s]."""
    rotation_goal: FloatArray
    """(3, 3) R_O_ee at the start, held if the task asks for it."""
    touch: tuple[TouchState, ...] = ()
    """Of the units with a touch sensor, one; none unless there are such units and the profile uses them."""
    impact: tuple[ImpactState, ...] = ()
    """Of the units' accelerometers, one; none before IMU samples came, or if the profile does not use them."""
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
        self._body = Body(model, len(skin), self.limits, profile.task)
        self._approach = restriction_on(profile.approach, self._body)
        self._setup = motion_setup(self._body, profile.null_space, profile.failure.solver_iterations)
        self._touching = touch_settings(model, skin, profile.detection)
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
            feel=feel_init(self.model, self.profile, learnt),
            reduction=ReductionState(),
            reaction=response.response_init(sound.q_commanded, self.profile.reaction),
            path=paths.PathState(),
            approach=self._approach_init(),
            motion=MotionState(np.zeros(self.model.n)),
            mode=mode_init(),
            command=sound.qd_commanded,
            rotation_goal=self.model.kinematics(sound.q).rotation[self.model.ee],
            touch=touch_init(self._touching),
        )

    def adopt(self, state: ControllerState, before: "Controller") -> ControllerState:
        """Go on from a state of another controller of the same arm and skin, with this one's profile and path.

        A force window of another length, and another method of detection, begin anew; another path is joined where it
        is nearest, and the speed along it grows from 0. A reaction that is over stays so.
        """
        mine, theirs, robot = self.profile, before.profile, state.watch.robot
        if len(state.command) != self.model.n or len(state.tracks.point) != len(self.skin):
            raise RobotStateError("The state is that of a controller for another arm or skin: begin with init().")
        same_window = mine.threshold.window_samples == theirs.threshold.window_samples
        same_window = same_window and mine.detection.method == theirs.detection.method
        same_points = mine.perception.outside_points == theirs.perception.outside_points
        way = state.path
        if self.path is not before.path:
            way = paths.joined(self.path, self.model.kinematics(robot.q).position[self.model.ee])
        return replace(
            state,
            feel=state.feel if same_window else feel_init(self.model, mine),
            reaction=response.adopted(state.reaction, mine.reaction, theirs.reaction),
            path=way,
            approach=state.approach if mine.approach == theirs.approach else self._approach_init(),
            motion=state.motion if mine.null_space == theirs.null_space else MotionState(np.zeros(self.model.n)),
            touch=state.touch if mine.detection == theirs.detection else touch_init(self._touching),
            outside=state.outside if same_points else None,
        )

    def _approach_init(self) -> object:
        """Return what the restriction remembers at first; a part says so itself, whatever works in its place."""
        return None if self.profile.approach is None else self.profile.approach.init(self._body)

    def step(self, state: ControllerState, inputs: Inputs) -> tuple[ControlStep, ControllerState]:
        """Run one control cycle; to be called once a period, with the state that the step before returned."""
        p, model, mark = self.profile, self.model, self._mark
        if len(state.command) != model.n or len(state.tracks.point) != len(self.skin):
            raise RobotStateError("The state is that of a controller for another arm or skin: begin with init().")
        robot, events, watch = examine(
            state.watch,
            inputs,
            state.command,
            self.limits.period,
            self.limits.qd_max,
            p.failure,
            p.detection.method != "thresholds",
        )
        readings, unfit = sound_readings(inputs.readings, len(self.skin))
        touches, wrong = sound_touch(inputs.touch, len(self.skin)) if self._touching else (None, "")
        points, lost = sound_points(inputs.points)
        unfit, now = unfit or wrong, watch.stamp
        mark("state")
        kin = model.kinematics(robot.q)
        x = kin.position[model.ee]
        mark("kinematics")

        # what is near: eq. 1 and the closest points of the body
        known = track_init(len(self.skin)) if Event.TIME_BACKWARDS in events else state.tracks
        seen, tracks = perceive(known, self._sight, kin, readings, now, robot)
        seen, outside = see_outside(
            state.outside, Event.TIME_BACKWARDS in events, seen, points, self._sight, kin, robot, now
        )
        heard, silent = silent_units(self.skin, tracks, readings.status, seen.longest_silence, now, p.perception)
        told, lost = outside_silence(outside, lost, now, p.perception)
        mark("perception")

        # what is felt: eqs. 8-11
        watched = p.perception.enabled and len(self.skin) > 0 and heard >= 1.0 and not silent
        cues, touched, impact = self._cues(state, touches, inputs, kin, robot, now)
        felt, feeling = feel(
            state.feel, model, kin, robot, seen.obstacles, state.mode.mode is Mode.REACT, p, watched, cues
        )  # fmt: skip
        mark("contact")

        # what to do
        close = bool(silent or lost) or response.seen_near(seen.obstacles, p.reaction)
        before = doing(state.mode, felt.armed, p)
        fixed = self.fixtures
        push = response.Felt(model, kin, robot, felt, close, state.command, p, fixed.planes, fixed.capsules)
        react = response.noticed(state.reaction, before, push, state.path.phase, inputs.resume)
        events |= events_of(
            unfit, silent, lost, felt, feeling.window.count, react, close, before, state.motion.blocked, p
        )  # fmt: skip
        mode = next_mode(state.mode, events, inputs.resume)
        contact = felt.contact if mode.mode is Mode.REACT is not state.mode.mode else None
        if contact is not None:
            react = response.began(react, before, push, state.path.phase, x)
        mark("mode")

        # how fast: eqs. 3-4 on the path, or eq. 12
        slowed = 1.0 if p.slow is None else speed_scale(seen.nearest, p.slow.d_max_m)
        scale, reduction = reduce_speed(state.reduction, min(heard, told, slowed), p.task.restore_cycles)
        way = paths.follow(self.path, state.path, x, p.task)
        answer, react = response.answered(react, doing(mode, felt.armed, p), push)
        desired, qd = (way.scaled(scale), None) if answer is None else (answer.velocity, answer.qd)
        mark("path")

        # how near: eqs. 5-7, and the joint velocities: eq. 2
        touch = None if answer is None else answer.touch
        room = len(self.skin) + (0 if outside is None else len(outside.sigma))
        hold = mode.mode is Mode.HOLD and qd is None
        request = MotionRequest(desired, state.rotation_goal, hold, mode.mode is Mode.TRACK, qd, touch, room)
        allowed, approach = self._approach.step(state.approach, self._body, kin, robot, seen.obstacles, request)
        motion, moving = joint_motion(state.motion, self._setup, kin, robot, seen.obstacles, request, allowed)
        qp = motion.qp
        if qp.outcome in _TROUBLE and (qp.outcome is QpOutcome.FAILED or mode.mode is not Mode.HOLD):
            mode = next_mode(mode, {_TROUBLE[qp.outcome]: qp.status}, resume=False)
        mark("motion")

        reacting = mode.mode is Mode.REACT
        step = ControlStep(
            stamp=now, mode=mode.mode, reason=mode.reason, q=robot.q, q_commanded=robot.q_commanded,
            ee_position=x, ee_velocity=motion.ee_velocity, path_position=way.point,
            path_phase=state.path.phase, desired_velocity=np.zeros(3) if mode.mode is Mode.HOLD else desired,
            speed_scale=scale, range_distance=seen.distance, obstacles=seen.obstacles,
            force=np.full(3, np.nan) if robot.wrench is None else robot.wrench[:3],
            filtered_force=feeling.window.newest, thresholds=felt.thresholds, armed=felt.armed, contact=contact,
            reaction_velocity=desired if reacting else _STILL, restricted=motion.restricted,
            approach_limit=motion.approach_limit,
            qp=qp, command=qp.qd, residual=felt.residual, evidence=felt.evidence, touched=felt.touched,
        )  # fmt: skip
        after = ControllerState(
            watch=watch, tracks=tracks, feel=feeling, reduction=reduction, reaction=react,
            path=paths.advance(self.path, state.path, way, motion.ee_velocity_commanded, p.task)
            if mode.mode is Mode.TRACK else paths.pause(state.path),
            approach=approach, motion=moving, mode=mode, command=qp.qd.copy(), rotation_goal=state.rotation_goal,
            touch=touched, impact=impact, outside=outside,
        )  # fmt: skip
        mark("record")
        return step, after

    def _cues(
        self, state: ControllerState, touches: TouchReadings | None, inputs: Inputs, kin: Kinematics, robot: RobotState,
        now: float,
    ) -> tuple[Cues | None, tuple[TouchState, ...], tuple[ImpactState, ...]]:  # fmt: skip
        """Return what the units' touch sensors and accelerometers say of a touch, and what to remember of each."""
        p, model, skin = self.profile, self.model, self.skin
        cues, touched = feel_touch(state.touch, self._touching, touches, kin, now, self.limits.period, p.detection)
        imu = sound_imu(inputs.imu, len(skin)) if p.detection.use_imu else None
        if imu is None:
            return cues, touched, state.impact
        before = state.impact[0] if state.impact else impact_init(model, len(skin))
        jolts, impact = listen(before, model, skin, kin, robot, imu, now, p)
        return jolts if cues is None else together(cues, jolts), touched, (impact,)


_STILL = np.zeros(3)
"""One for all steps: its numbers are not written to."""
_TROUBLE = {QpOutcome.FAILED: Event.SOLVER_FAILED, QpOutcome.INFEASIBLE: Event.BLOCKED}
