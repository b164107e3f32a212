"""From a reading to a joint velocity: the paper on one page.

`Controller.step(state, inputs) -> (ControlStep, state)` is pure: no clock, no file, no memory beside the state.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from pretouch.contact import reaction
from pretouch.contact.detect import detect
from pretouch.contact.window import WindowState, window_init
from pretouch.control import path as paths
from pretouch.control.joint_box import joint_limits
from pretouch.control.motion import joint_motion
from pretouch.control.reduction import ReductionState, reduce_speed, speed_scale
from pretouch.errors import RobotStateError, SkinError
from pretouch.faults import Watch, examine, sound_readings, sound_robot, watch_init
from pretouch.modes import Event, ModeState, mode_init, next_mode
from pretouch.params import Profile
from pretouch.perception.obstacles import TrackState, track_init
from pretouch.perception.perceive import perceive, silent_units
from pretouch.perception.scene_filter import Fixtures
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.types import Contact, ControlStep, FloatArray, Inputs, Mode, QpOutcome, RobotState
from pretouch.values import value


@value
class ControllerState:
    """All the controller remembers from one step to the next."""

    watch: Watch
    tracks: TrackState
    window: WindowState
    reduction: ReductionState
    reaction: reaction.ReactionState
    path: paths.PathState
    mode: ModeState
    command: FloatArray
    """(n,) last joint velocity command [rad/s]."""
    rotation_goal: FloatArray
    """(3, 3) R_O_ee at the start, held if the task asks for it."""


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
        self._mark = mark

    def init(self, robot: RobotState) -> ControllerState:
        """Return the state before the first step; a robot state that cannot be used is a RobotStateError."""
        sound, wrong = sound_robot(robot, self.limits.qd_max)
        if sound is None:
            raise RobotStateError(f"The controller cannot start: {wrong}: check the connection to the arm.")
        return ControllerState(
            watch=watch_init(sound),
            tracks=track_init(len(self.skin)),
            window=window_init(self.profile.threshold.window_samples),
            reduction=ReductionState(),
            reaction=reaction.reaction_init(self.profile.reaction),
            path=paths.PathState(),
            mode=mode_init(),
            command=sound.qd_commanded,
            rotation_goal=self.model.kinematics(sound.q).rotation[self.model.ee],
        )

    def adopt(self, state: ControllerState, before: "Controller") -> ControllerState:
        """Go on from a state of another controller of the same arm and skin, with this one's profile and path.

        A force window of another length is filled anew; another path is joined where it is nearest, and the speed along
        it grows from 0. A reaction that is over stays so.
        """
        mine, theirs, robot = self.profile, before.profile, state.watch.robot
        if len(state.command) != self.model.n or len(state.tracks.point) != len(self.skin):
            raise RobotStateError("The state is that of a controller for another arm or skin: begin with init().")
        same_window = mine.threshold.window_samples == theirs.threshold.window_samples
        reacting = reaction.active(state.reaction, theirs.reaction)
        way = state.path
        if self.path is not before.path:
            way = paths.joined(self.path, self.model.kinematics(robot.q).position[self.model.ee])
        return replace(
            state,
            window=state.window if same_window else window_init(mine.threshold.window_samples),
            reaction=state.reaction if reacting else reaction.reaction_init(mine.reaction),
            path=way,
        )

    def step(self, state: ControllerState, inputs: Inputs) -> tuple[ControlStep, ControllerState]:
        """Run one control cycle; to be called once a period, with the state that the step before returned."""
        p, model, mark = self.profile, self.model, self._mark
        if len(state.command) != model.n or len(state.tracks.point) != len(self.skin):
            raise RobotStateError("The state is that of a controller for another arm or skin: begin with init().")
        robot, events, watch = examine(
            state.watch, inputs, state.command, self.limits.period, self.limits.qd_max, p.failure
        )
        readings, unfit = sound_readings(inputs.readings, len(self.skin))
        now = watch.stamp
        mark("state")
        kin = model.kinematics(robot.q)
        x = kin.position[model.ee]
        mark("kinematics")

        # what is near: eq. 1 and the closest points of the body
        known = track_init(len(self.skin)) if Event.TIME_BACKWARDS in events else state.tracks
        seen, tracks = perceive(known, model, self.skin, self.fixtures, kin, readings, now, p.perception)
        heard, silent = silent_units(self.skin, tracks, readings.status, seen.longest_silence, now, p.perception)
        mark("perception")

        # what is felt: eqs. 8-11
        force = None if robot.wrench is None else robot.wrench[:3]
        felt, window = detect(state.window, force, x, seen.obstacles, p.threshold)
        mark("contact")

        # what to do
        events |= _events(unfit, silent, felt.armed, window.count, felt.contact, state.reaction, p)
        mode = next_mode(state.mode, events, inputs.resume)
        begins = mode.mode is Mode.REACT and state.mode.mode is not Mode.REACT
        contact = felt.contact if begins else None
        react = reaction.start_reaction(contact.force, p.reaction) if contact else state.reaction
        mark("mode")

        # how fast: eqs. 3-4 on the path, or eq. 12
        slowed = speed_scale(seen.nearest, p.reduction.d_max_m) if p.reduction.enabled else 1.0
        scale, reduction = reduce_speed(state.reduction, min(heard, slowed), p.reduction)
        way = paths.follow(self.path, state.path, x, p.task)
        if mode.mode is Mode.REACT:
            desired = reaction.decayed(react, p.reaction)
        else:
            react = reaction.reaction_init(p.reaction)
            desired = way.scaled(scale)
        mark("path")

        # how near: eqs. 5-7, and the joint velocities: eq. 2
        motion = joint_motion(
            model, kin, robot, seen.obstacles, desired, state.rotation_goal, self.limits, p, mode.mode is Mode.HOLD
        )
        qp = motion.qp
        if qp.outcome in _TROUBLE:
            mode = next_mode(mode, {_TROUBLE[qp.outcome]: qp.status}, resume=False)
        mark("motion")

        reacting = mode.mode is Mode.REACT
        step = ControlStep(
            stamp=now, mode=mode.mode, reason=mode.reason, q=robot.q, q_commanded=robot.q_commanded,
            ee_position=x, ee_velocity=motion.ee_velocity, path_position=way.point,
            path_phase=state.path.phase, desired_velocity=np.zeros(3) if mode.mode is Mode.HOLD else desired,
            speed_scale=scale, range_distance=seen.distance, obstacles=seen.obstacles,
            force=np.full(3, np.nan) if force is None else force, filtered_force=window.newest,
            thresholds=felt.thresholds, armed=felt.armed, contact=contact,
            reaction_velocity=desired if reacting else np.zeros(3), restricted=motion.restricted,
            approach_limit=motion.approach_limit,
            qp=qp, command=qp.qd,
        )  # fmt: skip
        after = ControllerState(
            watch=watch, tracks=tracks, window=window, reduction=reduction,
            reaction=reaction.advance(react) if reacting else react,
            path=paths.advance(self.path, state.path, way, motion.ee_velocity_commanded, p.task)
            if mode.mode is Mode.TRACK else paths.pause(state.path),
            mode=mode, command=qp.qd.copy(), rotation_goal=state.rotation_goal,
        )  # fmt: skip
        mark("record")
        return step, after


_TROUBLE = {QpOutcome.FAILED: Event.SOLVER_FAILED, QpOutcome.INFEASIBLE: Event.BLOCKED}


def _events(
    unfit: str,
    silent: str,
    armed: bool,
    samples: int,
    contact: Contact | None,
    react: reaction.ReactionState,
    p: Profile,
) -> dict[Event, str]:
    """What this step saw that may change the mode, each with the detail its sentence needs."""
    events: dict[Event, str] = {}
    if contact is not None:
        events[Event.CONTACT] = f"{np.linalg.norm(contact.force):.1f} N"
    if reaction.active(react, p.reaction):
        left = (p.reaction.decay_cycles - react.cycle) * p.task.control_period_s
        events[Event.REACTING] = f"{left:.2f} s"
    if unfit and p.perception.enabled:
        events[Event.SKIN_UNFIT] = unfit
    if silent:
        events[Event.SKIN_SILENT] = silent
    if not armed:
        events[Event.WINDOW_FILLING] = f"{samples} of {p.threshold.window_samples} samples"
    return events
