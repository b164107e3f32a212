"""From a reading to a joint velocity: the paper on one page.

`Controller.step(state, inputs) -> (ControlStep, state)` is pure: no clock, no file, no memory beside the state.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from pretouch import faults
from pretouch.contact.announced_load import LoadState, announced, kept_free, most_kg, without_load
from pretouch.contact.detector import Body, Detection, Sample
from pretouch.contact.reaction import ReactionInputs, ReactionMotion
from pretouch.contact.residual_model import ResidualModel
from pretouch.contact.window import WindowState, add_force, window_init
from pretouch.control import path as paths
from pretouch.control.commander import Asked, asked_by, commanded
from pretouch.control.interface import MotionBody, MotionRequest
from pretouch.control.joint_box import joint_limits
from pretouch.control.motion import Motion, MotionState, joint_motion, motion_setup, restriction_on
from pretouch.control.reduction import ReductionState, reduce_speed, speed_scale
from pretouch.errors import RobotStateError, SkinError
from pretouch.groups import Kinematics
from pretouch.modes import Event, ModeState, mode_init, next_mode
from pretouch.payload import sound_payload
from pretouch.perception.moving import beside, near_moving, sound_moving
from pretouch.perception.obstacles import TrackState, silent_units, track_init
from pretouch.perception.outside import OutsideState, outside_silence, see_outside
from pretouch.perception.perceive import nothing_seen, perceive, perception_setup
from pretouch.perception.scene_filter import Fixtures
from pretouch.profiles import Profile
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.step_parts import Given, Near, events_of
from pretouch.types import (
    ControlStep,
    FloatArray,
    Inputs,
    Mode,
    Obstacles,
    QpOutcome,
    RobotState,
)
from pretouch.values import value


@value
class ControllerState:
    """All the controller remembers from one step to the next."""

    watch: faults.Watch
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
    load: LoadState | None = None
    """What was announced of a load; None before anything was."""


STAGES = ("state", "kinematics", "perception", "contact", "mode", "path", "motion", "record")
"""What a step is made of, in order."""


class Controller:
    """The line from readings to joint velocities for one arm, skin, surrounding, path and profile.

    `step` believes any finite report of the arm, and a false one can move it against its acceleration limits: a loop of
    your own calls `loop.turn` in its place, or `loop.explained` before it.

    `mark` gets the name of each of `STAGES` as it ends, so that a caller with a clock can see where the time goes.
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
        see = profile.perception
        self._sight = None if see is None else perception_setup(model, skin, fixtures, see)
        self._motion_body = MotionBody(model, len(skin), self.limits, profile.task)
        self._approach = restriction_on(profile.approach, self._motion_body)
        self._setup = motion_setup(self._motion_body, profile.null_space, profile.failure.solver_iterations)
        self.body = Body(model, skin, self.limits.period, fixtures.planes, fixtures.capsules)
        self._detector = profile.detect.on(self.body)
        self._units, self._most_kg = len(skin), most_kg(model)
        self._touching, self._mark = profile.detect.reads_touch and len(skin.touching) > 0, mark

    def init(self, robot: RobotState, learnt: ResidualModel | None = None) -> ControllerState:
        """Return the state before the first step; a robot state that cannot be used is a RobotStateError.

        `learnt` is the arm's free motion as an earlier session left it, for a detector that learns it.
        """
        sound, wrong = faults.sound_robot(robot, self.limits.qd_max)
        if sound is None:
            raise RobotStateError(f"The controller cannot start: {wrong}: check the connection to the arm.")
        return ControllerState(
            watch=faults.watch_init(sound),
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
        same_points = _points_per_link(mine) == _points_per_link(theirs)
        path = state.path
        if self.path is not before.path:
            path = paths.joined(self.path, self.model.kinematics(robot.q).position[self.model.ee])
        return replace(
            state,
            window=state.window if same_window else window_init(mine.window.samples),
            detector=self._detector.adopted(state.detector, self.body, before._detector)
            if same_window
            else self._detector.init(self.body),
            reaction=mine.react.adopted(state.reaction, self.body, theirs.react, robot.q_commanded),
            path=path,
            approach=state.approach if mine.approach == theirs.approach else self._approach_init(),
            motion=state.motion if mine.null_space == theirs.null_space else MotionState(np.zeros(self.model.n)),
            outside=state.outside if same_points else None,
        )

    def _approach_init(self) -> object:
        """Return what the restriction remembers at first; a part says so itself, whatever works in its place."""
        return None if self.profile.approach is None else self.profile.approach.init(self._motion_body)

    def step(self, state: ControllerState, inputs: Inputs) -> tuple[ControlStep, ControllerState]:
        """Run one control cycle, once a period, with the state of the step before; it believes any finite report."""
        p, model, mark = self.profile, self.model, self._mark
        if len(state.command) != model.n or len(state.tracks.point) != self._units:
            raise RobotStateError("The state is that of a controller for another arm or skin: begin with init().")
        given = self._checked(state, inputs)
        mark("state")
        kin = model.kinematics(given.robot.q)
        mark("kinematics")
        given = self._unloaded(given, kin)
        robot, now = given.robot, given.watch.stamp
        near = self._perceived(state, given, kin)
        mark("perception")
        detection, window, detector = self._detected(state, inputs, given, near, kin)
        mark("contact")

        # what to do
        noticed = ReactionInputs(
            state.mode, kin, robot, detection, near.seen.obstacles, bool(near.silent or near.lost), state.command,
            state.path.phase, inputs.resume,
        )  # fmt: skip
        answers, react = p.react.sense(state.reaction, self.body, noticed)
        events = events_of(given.unfit, near.silent, near.lost, detection, window.count, p) | given.events | answers
        mode = next_mode(state.mode, events, inputs.resume)
        contact = detection.contact if mode.mode is Mode.REACT is not state.mode.mode else None
        mark("mode")

        # along the path, or as a commander asks, as fast as eqs. 3-4 leave it, or as the reaction says
        slowed = 1.0 if p.slow is None else speed_scale(near.seen.nearest, p.slow.d_max_m)
        scale, reduction = reduce_speed(state.reduction, min(near.scale, slowed), p.task.restore_cycles)
        asked = self._asked(state, given, kin, scale)
        answer, react = p.react.move(react, self.body, noticed, mode)
        desired = asked.velocity if answer is None else answer.velocity
        mark("path")
        motion, mode, approach, moving = self._moved(state, noticed, near, mode, asked, desired, answer)
        mark("motion")

        step = ControlStep(
            stamp=now, mode=mode.mode, event=mode.event, detail=mode.detail, reason=mode.reason, latched=mode.latched,
            q=robot.q, q_commanded=robot.q_commanded,
            ee_position=kin.position[model.ee], ee_velocity=motion.ee_velocity, path_position=asked.point,
            path_phase=state.path.phase, desired_velocity=np.zeros(3) if mode.mode is Mode.HOLD else desired,
            speed_scale=scale, range_distance=near.seen.distance, obstacles=near.obstacles,
            force=np.full(3, np.nan) if robot.wrench is None else robot.wrench[:3],
            filtered_force=window.newest, thresholds=detection.thresholds, armed=detection.armed, contact=contact,
            reaction_velocity=desired if mode.mode is Mode.REACT else _STILL, restricted=motion.restricted,
            approach_limit=motion.approach_limit, qp=motion.qp, command=motion.qp.qd,
            residual=detection.residual, evidence=detection.evidence, touched=detection.touched,
            detectable_n=detection.detectable_n,
        )  # fmt: skip
        after = ControllerState(
            watch=given.watch, tracks=near.tracks, window=window, detector=detector, reduction=reduction,
            reaction=react, path=paths.advance(self.path, state.path, asked.path, motion.ee_velocity_commanded, p.task)
            if mode.mode is Mode.TRACK and asked.path is not None else paths.pause(state.path),
            approach=approach, motion=moving, mode=mode, command=motion.qp.qd.copy(),
            rotation_goal=asked.rotation_kept if mode.mode is Mode.TRACK else state.rotation_goal, outside=near.outside,
            load=given.load and kept_free(given.load, robot.tau_ext, detection.residual),
        )  # fmt: skip
        mark("record")
        return step, after

    def _checked(self, state: ControllerState, inputs: Inputs) -> Given:
        """Return what of the inputs can be used, and what is wrong with the rest."""
        p, units = self.profile, self._units
        robot, events, watch = faults.examine(
            state.watch, inputs, state.command, self.limits.period, self.limits.qd_max, p.failure, p.detect.by_torques
        )
        readings, unfit = faults.sound_readings(inputs.readings, units)
        touches, wrong = faults.sound_touch(inputs.touch, units) if self._touching else (None, "")
        points, lost = faults.sound_points(inputs.points)
        payload, heavy = sound_payload(inputs.payload, self._most_kg)
        if heavy:
            events[Event.LOAD_UNFIT] = heavy
        load = announced(state.load, payload, robot)
        moving, astray = sound_moving(inputs.moving, watch.stamp, p.failure.state_timeout_s)
        if astray:
            events[Event.MOVING_LOST] = astray
        desired, ended = commanded(inputs.desired, self.model.n, watch.stamp, p.failure)
        events |= ended
        return Given(robot, events, watch, readings, touches, points, load, desired, moving, unfit or wrong, lost)

    def _unloaded(self, given: Given, kin: Kinematics) -> Given:
        """Take an announced load out of torques and force."""
        if given.load is None:
            return given
        robot, load = without_load(given.load, self.model, kin, given.robot, self.limits.period)
        return given._replace(robot=robot, load=load)

    def _perceived(self, state: ControllerState, given: Given, kin: Kinematics) -> Near:
        """Return what is near: eq. 1 and the closest points of the body."""
        sight, robot, now, moving = self._sight, given.robot, given.watch.stamp, given.moving
        if sight is None:
            kept_off = self._kept_off(given, kin, state.outside)
            return Near(nothing_seen(given.readings, self.skin), state.tracks, state.outside, kept_off=kept_off)
        if moving is not None:
            sight = beside(sight, moving, given.readings, now)
        anew = Event.TIME_BACKWARDS in given.events
        known = track_init(self._units) if anew else state.tracks
        seen, tracks = perceive(known, sight, kin, given.readings, now, robot)
        seen, outside = see_outside(state.outside, anew, seen, given.points, sight, kin, robot, now)
        heard, silent = silent_units(self.skin, tracks, given.readings.status, seen.longest_silence, now, sight.params)
        outside_scale, lost = outside_silence(outside, given.lost, now, sight.params.outside)
        watched = self._units > 0 and heard >= 1.0 and not silent
        kept_off, scale = self._kept_off(given, kin, outside), min(heard, outside_scale)
        return Near(seen, tracks, outside, scale, watched, silent, lost, kept_off)

    def _kept_off(self, given: Given, kin: Kinematics, outside: OutsideState | None) -> Obstacles | None:
        """Return what is nearest of that which is known to move beside the arm."""
        if given.moving is None:
            return None
        return near_moving(given.moving, self.model, kin, given.watch.stamp, self._places(outside))

    def _places(self, outside: OutsideState | None) -> int:
        """How many units and places of outside points there are."""
        return self._units + (0 if outside is None else len(outside.sigma))

    def _detected(
        self, state: ControllerState, inputs: Inputs, given: Given, near: Near, kin: Kinematics
    ) -> tuple[Detection, WindowState, object]:
        """Tell a contact from free motion: eqs. 8-11."""
        robot, before, p = given.robot, state.window, self.profile.window
        reacting = state.mode.mode is Mode.REACT
        window = add_force(before, None if robot.wrench is None else robot.wrench[:3], p)
        sample = Sample(
            given.watch.stamp, kin, robot, window, before.full, near.seen.obstacles, reacting, near.watched,
            given.touches, given.load.doubted_kg if given.load else 0.0,
        )  # fmt: skip
        detection, detector = self._detector.step(state.detector, self.body, sample)
        return detection, before if reacting and p.freeze_while_reacting else window, detector

    def _asked(self, state: ControllerState, given: Given, kin: Kinematics, scale: float) -> Asked:
        """Return what follows the path, or what a commander wants."""
        task, goal = self.profile.task, state.rotation_goal
        if given.desired is None:
            following = paths.follow(self.path, state.path, kin.position[self.model.ee], task)
            return Asked(following.scaled(scale), following.point, goal, goal, None, following)
        return asked_by(given.desired, given.watch.stamp, kin, given.robot, self.model, goal, task, scale)

    def _moved(
        self, state: ControllerState, noticed: ReactionInputs, near: Near, mode: ModeState, asked: Asked,
        desired: FloatArray, answer: ReactionMotion | None,
    ) -> tuple[Motion, ModeState, object, MotionState]:  # fmt: skip
        """Return the joint velocities that come nearest to what is asked: eqs. 5-7 and eq. 2."""
        goal, qd, touch = state.rotation_goal, None, None
        if answer is not None:
            qd, touch = answer.qd, answer.touch_speed
        elif mode.mode is Mode.TRACK:
            goal, qd = asked.rotation_goal, asked.qd
        places, told = self._places(near.outside), near.kept_off
        request = MotionRequest(
            desired, goal, mode.mode is Mode.HOLD and qd is None, qd, touch,
            places + (0 if told is None else len(told.unit)), None if told is None else places,
        )  # fmt: skip
        kin, robot, obstacles = noticed.kin, noticed.robot, near.obstacles
        allowed, approach = self._approach.step(state.approach, self._motion_body, kin, robot, obstacles, request)
        motion, moving = joint_motion(state.motion, self._setup, kin, robot, obstacles, request, allowed)
        qp = motion.qp
        if qp.outcome in _TROUBLE and (qp.outcome is QpOutcome.FAILED or mode.mode is not Mode.HOLD):
            mode = next_mode(mode, {_TROUBLE[qp.outcome]: qp.status}, resume=False)
        return motion, mode, approach, moving


def _points_per_link(profile: Profile) -> int:
    return 0 if profile.sight.outside is None else profile.sight.outside.per_link


_STILL = np.zeros(3)
"""One for all steps: its numbers are not written to."""
_TROUBLE = {QpOutcome.FAILED: Event.SOLVER_FAILED, QpOutcome.INFEASIBLE: Event.BLOCKED}
