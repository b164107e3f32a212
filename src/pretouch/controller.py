"""From a reading to a joint velocity: the paper on one page.

`Controller.step(state, inputs) -> (ControlStep, state)` is pure: no clock, no file, no memory beside the state.
"""

from dataclasses import dataclass

import numpy as np

from pretouch.contact import reaction
from pretouch.contact.detect import detect
from pretouch.contact.window import WindowState, window_init
from pretouch.control import path as paths
from pretouch.control.joint_box import JointLimits, brake, joint_box
from pretouch.control.qp import skipped, solve, task_cost
from pretouch.control.reduction import ReductionState, reduce_speed, speed_scale
from pretouch.control.restriction import ApproachRows, approach_rows
from pretouch.control.task import task
from pretouch.errors import RobotStateError
from pretouch.faults import Watch, examine, not_finite, watch_init
from pretouch.modes import Event, ModeState, mode_init, next_mode
from pretouch.params import Profile
from pretouch.perception.obstacles import TrackState, measured_distance, track_init
from pretouch.perception.perceive import perceive, silent_units
from pretouch.perception.scene_filter import Fixtures
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.types import Contact, ControlStep, FloatArray, Inputs, Mode, QpOutcome, QpSolution, RobotState


@dataclass(frozen=True, slots=True)
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


class Controller:
    """The line from readings to joint velocities for one arm, skin, surrounding, path and profile."""

    def __init__(self, model: RobotModel, skin: Skin, fixtures: Fixtures, path: paths.Path, profile: Profile) -> None:
        self.model, self.skin, self.fixtures, self.path, self.profile = model, skin, fixtures, path, profile
        margin, arm = profile.task.position_margin_rad, model.description
        self.limits = JointLimits(
            model.q_min + margin, model.q_max - margin, arm.qd_max, arm.qdd_max, profile.task.control_period_s
        )

    def init(self, robot: RobotState) -> ControllerState:
        """Return the state before the first step; a robot state that is not finite is a RobotStateError."""
        wrong = not_finite(robot)
        if wrong:
            raise RobotStateError(f"The robot's first state has {wrong} that are not finite: check the connection.")
        return ControllerState(
            watch=watch_init(robot),
            tracks=track_init(len(self.skin)),
            window=window_init(self.profile.threshold.window_samples),
            reduction=ReductionState(),
            reaction=reaction.reaction_init(self.profile.reaction),
            path=paths.PathState(),
            mode=mode_init(),
            command=robot.qd_commanded,
            rotation_goal=self.model.kinematics(robot.q).rotation[self.model.ee],
        )

    def step(self, state: ControllerState, inputs: Inputs) -> tuple[ControlStep, ControllerState]:
        """Run one control cycle."""
        p, model = self.profile, self.model
        robot, events, watch = examine(state.watch, inputs, state.command, p.task.control_period_s, p.failure)
        now = watch.stamp
        kin = model.kinematics(robot.q)
        J = model.ee_jacobian(kin)
        x = kin.position[model.ee]

        # what is near: eq. 1 and the closest points of the body
        known = track_init(len(self.skin)) if Event.TIME_BACKWARDS in events else state.tracks
        obstacles, tracks = perceive(known, model, self.skin, self.fixtures, kin, inputs.readings, now, p.perception)
        heard, silent = silent_units(self.skin, tracks, now, p.perception)

        # what is felt: eqs. 8-11
        force = None if robot.wrench is None else robot.wrench[:3]
        felt, window = detect(state.window, force, x, obstacles, p.threshold)

        # what to do
        events |= _events(silent, felt.armed, window.count, felt.contact, state.reaction, p)
        mode = next_mode(state.mode, events, inputs.resume)
        begins = mode.mode is Mode.REACT and state.mode.mode is not Mode.REACT
        contact = felt.contact if begins else None
        react = reaction.start_reaction(contact.force, p.reaction) if contact else state.reaction

        # how fast: eqs. 3-4 on the path, or eq. 12
        nearest = float(obstacles.ee_distance.min(initial=np.inf))
        slowed = speed_scale(nearest, p.reduction.d_max_m) if p.reduction.enabled else 1.0
        scale, reduction = reduce_speed(state.reduction, min(heard, slowed), p.reduction)
        if mode.mode is Mode.REACT:
            desired = reaction.decayed(react, p.reaction)
        else:
            react = reaction.reaction_init(p.reaction)
            desired = paths.follow(self.path, state.path, x, p.task) * scale

        # how near: eqs. 5-7, and the joint velocities: eq. 2
        rows, restricted = approach_rows(kin, model.moved_by, obstacles, p.restriction)
        goal = task(J, desired, kin.rotation[model.ee], state.rotation_goal, p.task)
        qp = self._solve(mode.mode, goal, robot, rows)
        if qp.outcome in _TROUBLE:
            mode = next_mode(mode, {_TROUBLE[qp.outcome]: qp.status}, resume=False)

        reacting = mode.mode is Mode.REACT
        step = ControlStep(
            stamp=now, mode=mode.mode, reason=mode.reason, q=robot.q, q_commanded=robot.q_commanded,
            ee_position=x, ee_velocity=J[:3] @ robot.qd, path_position=self.path.point(state.path.phase),
            path_phase=state.path.phase, desired_velocity=np.zeros(3) if mode.mode is Mode.HOLD else desired,
            speed_scale=scale, range_distance=measured_distance(inputs.readings), obstacles=obstacles,
            force=np.full(3, np.nan) if force is None else force, filtered_force=window.newest,
            thresholds=felt.thresholds, armed=felt.armed, contact=contact,
            reaction_velocity=desired if reacting else np.zeros(3), restricted=restricted, approach_limit=rows.h,
            qp=qp, command=qp.qd,
        )  # fmt: skip
        return step, ControllerState(
            watch=watch, tracks=tracks, window=window, reduction=reduction,
            reaction=reaction.advance(react) if reacting else react,
            path=paths.advance(self.path, state.path, x, J[:3] @ qp.qd, p.task)
            if mode.mode is Mode.TRACK else paths.pause(state.path),
            mode=mode, command=qp.qd, rotation_goal=state.rotation_goal,
        )  # fmt: skip

    def _solve(
        self, mode: Mode, goal: tuple[FloatArray, FloatArray], robot: RobotState, rows: ApproachRows
    ) -> QpSolution:
        """Minimise eq. 2 for a task (Jacobian and velocity) within the joint box and rows; brake in HOLD."""
        lower, upper = joint_box(robot.q_commanded, robot.qd_commanded, self.limits)
        stop = brake(robot.qd_commanded, lower, upper, self.limits)
        if mode is Mode.HOLD:
            return skipped(stop, rows)
        cost = task_cost(*goal, robot.q, self.model.q_mid, self.profile.task)
        return solve(cost, lower, upper, rows, self.profile.restriction.slack_weight, stop)


_TROUBLE = {QpOutcome.FAILED: Event.SOLVER_FAILED, QpOutcome.INFEASIBLE: Event.BLOCKED}


def _events(
    silent: str, armed: bool, samples: int, contact: Contact | None, react: reaction.ReactionState, p: Profile
) -> dict[Event, str]:
    """What this step saw that may change the mode, each with the detail its sentence needs."""
    events: dict[Event, str] = {}
    if contact is not None:
        events[Event.CONTACT] = f"{np.linalg.norm(contact.force):.1f} N"
    if reaction.active(react, p.reaction):
        left = (p.reaction.decay_cycles - react.cycle) * p.task.control_period_s
        events[Event.REACTING] = f"{left:.2f} s"
    if silent:
        events[Event.SKIN_SILENT] = silent
    if not armed:
        events[Event.WINDOW_FILLING] = f"{samples} of {p.threshold.window_samples} samples"
    return events
