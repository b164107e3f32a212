"""The whole control step of `pretouch.controller`, for the second time: plain NumPy, loops, an exact solver.

It shares data with the package (parameters, types, the arm's description and capsules, paths), and no computation.
"""

from dataclasses import dataclass

import numpy as np

from pretouch.control.path import Path
from pretouch.modes import Event
from pretouch.perception.scene_filter import Fixtures
from pretouch.profiles import Profile
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.types import Contact, ControlStep, Inputs, Mode, QpOutcome, QpSolution, RobotState
from tests.reference import modes
from tests.reference.contact import Touch, reaction
from tests.reference.geometry import Posture, tree_of
from tests.reference.motion import Fading, Progress, approach_rows, brake, cost, joint_box, orientation_error
from tests.reference.perception import Eyes, shown_by
from tests.reference.qp import Problem, solve


@dataclass(frozen=True)
class Reference:
    """What a step is by the reference, and the quadratic program it posed."""

    step: ControlStep
    problem: Problem


class ReferenceController:
    """A controller that remembers by itself: the state of `robot` first, then step after step."""

    def __init__(
        self, model: RobotModel, skin: Skin, fixtures: Fixtures, path: Path, profile: Profile, robot: RobotState
    ) -> None:
        self.model, self.path, self.profile, self.tree = model, path, profile, tree_of(model)
        self.trust = modes.Trust(robot, profile.failure, model.description.qd_max)
        self.eyes = Eyes(model, skin, fixtures, profile)
        self.touch = Touch(profile.detect, profile.window)
        self.fading = Fading(profile.slow, profile.task.restore_cycles)
        self.progress = Progress(path, profile.task)
        self.behaviour = modes.Behaviour()
        self.push, self.pushed_for = np.zeros(3), profile.react.decay_cycles
        self.command = robot.qd_commanded
        self.goal = Posture(self.tree, robot.q).T[model.ee, :3, :3]

    def step(self, inputs: Inputs) -> Reference:
        """Run one control cycle."""
        p, model = self.profile, self.model
        robot, seen = self.trust.judge(inputs, self.command, p.task.control_period_s)
        now = self.trust.now
        posture = Posture(self.tree, robot.q)
        x, R = posture.T[model.ee, :3, 3], posture.T[model.ee, :3, :3]
        J = posture.jacobian(model.ee, x)
        if Event.TIME_BACKWARDS in seen:
            self.eyes.forget()
        obstacles = self.eyes.look(posture, x, inputs.readings, now)
        force = None if robot.wrench is None else robot.wrench[:3]
        limits, touched, armed = self.touch.feel(force, x, obstacles)

        heard, silent = self.eyes.silence(now, inputs.readings.status)
        contact = self._decide(seen, silent, touched, armed, inputs.resume)
        scale = self.fading.factor(float(obstacles.ee_distance.min(initial=np.inf)), heard)
        reacting = self.behaviour.mode is Mode.REACT
        wanted = self._yielding() if reacting else self.progress.velocity(x) * scale

        G, h, restricted = approach_rows(posture, obstacles, p.approach)
        problem, stop = self._pose(J, R, wanted, robot, G, h)
        qp = self._answer(problem, stop)
        if qp.outcome is QpOutcome.INFEASIBLE:
            self.behaviour.blocked()
        mode, phase = self.behaviour.mode, self.progress.phase
        self._remember(x, J[:3] @ qp.qd, qp.qd)
        step = ControlStep(
            stamp=now, mode=mode, event=Event.CLEAR, detail="",
            reason=self.behaviour.reason, latched=False, q=robot.q, q_commanded=robot.q_commanded,
            ee_position=x, ee_velocity=J[:3] @ robot.qd, path_position=self.path.point(phase), path_phase=phase,
            desired_velocity=np.zeros(3) if mode is Mode.HOLD else wanted, speed_scale=scale,
            range_distance=shown_by(inputs.readings),
            obstacles=obstacles, force=np.full(3, np.nan) if force is None else force, filtered_force=self.touch.newest,
            thresholds=limits, armed=armed, contact=contact,
            reaction_velocity=wanted if mode is Mode.REACT else np.zeros(3), restricted=restricted, approach_limit=h,
            qp=qp, command=qp.qd, residual=robot.tau_ext, evidence=np.nan,
        )  # fmt: skip
        return Reference(step, problem)

    def _decide(
        self, seen: dict[Event, str], silent: str, touched: Contact | None, armed: bool, resume: bool
    ) -> Contact | None:
        """Go on to the next mode; return the contact a reaction begins with, or None."""
        p, before = self.profile, self.behaviour.mode
        if touched is not None:
            seen[Event.CONTACT] = f"{np.linalg.norm(touched.force):.1f} N"
        left = p.react.decay_cycles - self.pushed_for
        if left > 0:
            seen[Event.REACTING] = f"{left * p.task.control_period_s:.2f} s"
        if silent:
            seen[Event.SKIN_SILENT] = silent
        if not armed:
            seen[Event.WINDOW_FILLING] = f"{len(self.touch.samples)} of {p.window.samples} samples"
        self.behaviour.decide(seen, resume)
        begins = self.behaviour.mode is Mode.REACT and before is not Mode.REACT
        if begins:
            assert touched is not None
            self.push, self.pushed_for = reaction(touched.force, p.react), 0
        return touched if begins else None

    def _yielding(self) -> np.ndarray:
        """Velocity (3,) [m/s] of the reaction in this cycle: linear to zero."""
        return self.push * max(0.0, 1.0 - self.pushed_for / self.profile.react.decay_cycles)

    def _pose(
        self, J: np.ndarray, R: np.ndarray, wanted: np.ndarray, robot: RobotState, G: np.ndarray, h: np.ndarray
    ) -> tuple[Problem, np.ndarray]:
        """The quadratic program of this step, and the braking command (n,) [rad/s]."""
        task, arm, model = self.profile.task, self.model.description, self.model
        if task.orientation == "hold":
            J6, turn = J, task.orientation_gain_1_s * orientation_error(R, self.goal)
            H, f = cost(J6, np.concatenate([wanted, turn]), robot.q, (model.q_min + model.q_max) / 2, task)
        else:
            H, f = cost(J[:3], wanted, robot.q, (model.q_min + model.q_max) / 2, task)
        margin, dt = task.position_margin_rad, task.control_period_s
        lower, upper = joint_box(
            robot.q_commanded, robot.qd_commanded, model.q_min + margin, model.q_max - margin, arm.qd_max, arm.qdd_max,
            dt,
        )  # fmt: skip
        part = self.profile.approach
        weight = None if part is None or part.rows == "hard" else part.slack_weight
        stop = brake(robot.qd_commanded, lower, upper, arm.qdd_max, dt)
        return Problem(H, f, lower, upper, G, h, weight), stop

    def _answer(self, problem: Problem, stop: np.ndarray) -> QpSolution:
        outcome, x, multipliers = QpOutcome.SKIPPED, stop, np.zeros(len(stop) + len(problem.h))
        if self.behaviour.mode is not Mode.HOLD:
            answer = solve(problem)
            if answer.x is None:
                outcome = QpOutcome.INFEASIBLE
            else:
                outcome, x, multipliers = QpOutcome.SOLVED, answer.x, answer.multipliers
        return QpSolution(x, np.maximum(problem.G @ x - problem.h, 0.0), multipliers, outcome, "")

    def _remember(self, x: np.ndarray, moving: np.ndarray, command: np.ndarray) -> None:
        if self.behaviour.mode is Mode.TRACK:
            self.progress.advance(x, moving)
        else:
            self.progress.speed = 0.0
        if self.behaviour.mode is Mode.REACT:
            self.pushed_for += 1
        else:
            self.push, self.pushed_for = np.zeros(3), self.profile.react.decay_cycles
        self.command = command
