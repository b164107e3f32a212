"""From a reading to a joint velocity.

`Controller.step(state, inputs) -> (ControlStep, state)` is pure: no clock, no file, no memory beside the state. Nearly
every step is one call of `line`. Where something happened, a part is in plain Python, or inputs are out of the usual,
`decision` takes the same stages one by one.
"""

from dataclasses import replace
from typing import Any

import numpy as np

from pretouch import faults
from pretouch.contact.announced_load import LoadState, most_kg
from pretouch.contact.detector import Body
from pretouch.contact.model_update import SequentialState
from pretouch.contact.residual_model import ResidualModel
from pretouch.control.interface import MotionBody, MotionRequest, Restriction, rows_of
from pretouch.control.joint_box import joint_limits
from pretouch.control.path import Path, nearest_phase
from pretouch.decision import Decision
from pretouch.errors import RobotStateError, SkinError
from pretouch.line import CHECK, MOVE, line, line_within
from pretouch.line_records import PYTHON, SEQUENTIAL
from pretouch.line_setup import fixed_of, kinds_of, now_init, remembered_init
from pretouch.modes import CLEAR, SOLVED, ModeState, mode_init
from pretouch.perception.obstacles import TrackState
from pretouch.perception.scene_filter import Fixtures
from pretouch.profiles import Profile
from pretouch.records import Flat
from pretouch.robot.body import Capsules
from pretouch.robot.kinematics import Kinematics
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.sound import sound_robot
from pretouch.types import WHOLE, ControlStep, FloatArray, Inputs, Obstacles, RobotState
from pretouch.values import value


@value
class ControllerState:
    """All the controller remembers from one step to the next."""

    memory: Flat
    """What compiled code remembers, see `line_records.Remembered`."""
    mode: ModeState
    detector: object
    """What the profile's detector remembers beside that."""
    reaction: object
    approach: object
    """What the profile's restriction remembers beside that."""
    load: LoadState | None
    """What was announced of a load; None before anything was."""
    calm: bool
    """Whether the next step may be one call."""
    quick: bool
    """Whether the step before was."""

    @property
    def command(self) -> FloatArray:
        """(n,) last joint velocity command [rad/s]."""
        return self.memory.get("command")

    @property
    def phase(self) -> float:
        """Arc length travelled along the path [m]."""
        return self.memory.get("pace.phase")

    @property
    def watch(self) -> faults.Watch:
        """What the next inputs are judged by."""
        return faults.watch_of(self.memory)

    @property
    def heard(self) -> FloatArray:
        """(K,) stamp of each unit's newest reading that reported anything [s]."""
        return self.memory.part("tracks", TrackState).heard

    @property
    def learnt(self) -> ResidualModel:
        """What the sequential detector has learnt of free motion."""
        return self.memory.part("test.model", ResidualModel)


class Controller:
    """The line from readings to joint velocities for one arm, skin, surrounding, path and profile.

    `step` believes any finite report of the arm, and a false one can move it against its acceleration limits: a loop of
    your own calls `loop.turn` in its place, or `loop.explained` before it.
    """

    def __init__(self, model: RobotModel, skin: Skin, fixtures: Fixtures, path: Path, profile: Profile) -> None:
        self.model, self.skin, self.fixtures, self.path, self.profile = model, skin, fixtures, path, profile
        for unit, link in zip(skin.units, skin.link, strict=True):
            if model.link_index(unit.link) != link:
                raise SkinError(f"The skin was made for another arm than {model.description.name}: make one for it.")
        self.limits = joint_limits(model, profile.task.position_margin_rad, profile.task.control_period_s)
        self.body = Body(model, skin, self.limits.period, fixtures.planes, fixtures.capsules)
        self.detector = profile.detect.on(self.body)
        self.kinds, self.most_kg = kinds_of(profile), most_kg(model)
        self._motion_body = MotionBody(model, len(skin), self.limits, profile.task)
        python = self.kinds.approach == PYTHON and profile.approach is not None
        self.approach = profile.approach.on(self._motion_body) if python and profile.approach is not None else None
        """A restriction in plain Python; None of one that is compiled."""
        self.touching = profile.detect.reads_touch and len(skin.touching) > 0
        outside = None if profile.perception is None else profile.perception.outside
        self.outside_places = 0 if outside is None else outside.per_link * len(model.parts)
        """How many points of outside sources are kept."""
        self.beside = fixtures.capsules
        self.fixed, self._begin = Flat.of(fixed_of(self)), Flat.of(remembered_init(self))
        self.blank = now = Flat.of(now_init(self))
        """What a step begins with: not written to."""
        self._joints = slice(now.places["robot.q"].at.start, now.places["robot.wrench"].at.stop)
        self._heard = slice(now.places["readings.stamp"].at.start, now.places["readings.distance"].at.stop)
        self._status, self._ending = now.places["readings.status"].at, now.places["answer.ending"].at.start
        self._stamps = [now.places["stamp"].at.start, now.places["robot.stamp"].at.start]
        self._on_path = slice(now.places["path.phase"].at.start, now.places["path.tangent"].at.stop)

    def init(self, robot: RobotState, learnt: ResidualModel | None = None) -> ControllerState:
        """Return the state before the first step; a robot state that cannot be used is a RobotStateError.

        `learnt` is the arm's free motion as an earlier session left it, for a detector that learns it.
        """
        sound, wrong = sound_robot(robot, self.limits.qd_max)
        if sound is None:
            raise RobotStateError(f"The controller cannot start: {wrong}: check the connection to the arm.")
        memory = self._begin.copy()
        faults.keep_watch(memory, faults.watch_init(sound))
        memory.put("command", sound.qd_commanded)
        memory.put("rotation_goal", self.model.kinematics(sound.q).rotation[self.model.ee])
        detector = self.kept_detector(memory, self.detector.init(self.body, learnt))
        reaction = self.profile.react.init(self.body, sound.q_commanded)
        return ControllerState(memory, mode_init(), detector, reaction, self._approach_init(), None, False, False)

    def adopt(self, state: ControllerState, before: "Controller") -> ControllerState:
        """Go on from a state of another controller of the same arm and skin, with this one's profile and path.

        A force window of another length, and another method of detection, begin anew; another path is joined where it
        is nearest, and the speed along it grows from 0. A reaction that is over stays so.
        """
        mine, theirs, memory = self.profile, before.profile, self._begin.copy()
        remembered = before.with_places(state.memory)
        same_units = remembered.places["tracks.point"].shape == memory.places["tracks.point"].shape
        if not same_units or remembered.places["command"].shape != memory.places["command"].shape:
            raise RobotStateError("The state is that of a controller for another arm or skin: begin with init().")
        same_window = mine.window.samples == theirs.window.samples and type(mine.detect) is type(theirs.detect)
        same_points = self.outside_places == before.outside_places
        parts = ["tracks", "pace", "command", "rotation_goal", "mass"]
        parts += (
            ["outside"] * same_points
            + ["window"] * same_window
            + ["null_velocity"] * (mine.null_space == theirs.null_space)
        )
        memory.take(remembered, parts + ["slots"] * (mine.approach == theirs.approach and same_points))
        watch = faults.watch_of(remembered)  # at another rate more or fewer commands are kept
        faults.keep_watch(memory, watch)
        if self.path is not before.path:
            here = self.model.kinematics(watch.robot.q).position[self.model.ee]
            memory.put("pace.phase", nearest_phase(self.path, here))
            memory.put("pace.speed", 0.0)
        detector = self.detector.init(self.body)
        if same_window:
            detector = self.detector.adopted(before.whole_detector(state), self.body, before.detector)
        reaction = mine.react.adopted(before.whole_reaction(state), self.body, theirs.react, watch.robot.q_commanded)
        return replace(
            state, memory=memory, detector=self.kept_detector(memory, detector), reaction=reaction,
            approach=state.approach if mine.approach == theirs.approach else self._approach_init(),
            calm=False, quick=False,
        )  # fmt: skip

    def step(self, state: ControllerState, inputs: Inputs) -> tuple[ControlStep, ControllerState]:
        """Run one control cycle, once a period, with the state of the step before; it believes any finite report."""
        remembered = self.with_places(state.memory)
        memory = remembered.copy()
        if state.calm:
            now = self.blank.copy()
            if self._taken(now, inputs):
                self.put_path(now, remembered.get("pace.phase"))
                if self.take(memory, now, self.beside, CHECK, MOVE) and now.blocks[1][self._ending] == SOLVED:
                    return ControlStep.of(now, CLEAR), ControllerState(
                        memory, CLEAR, state.detector, state.reaction, state.approach, None, True, True
                    )
                memory = remembered.copy()
        step, after = Decision(self, state, memory).taken(inputs)
        return step, ControllerState(memory, **after)

    def take(self, memory: Flat, now: Flat, beside: Capsules, first: int, last: int) -> bool:
        """Take stages of a step; see `line`."""
        return line(self.fixed.blocks, memory.blocks, now.blocks, beside, first, last)

    def _taken(self, now: Flat, inputs: Inputs) -> bool:
        """Copy inputs that are as usual; else say so."""
        robot, readings, n, units = inputs.robot, inputs.readings, self.model.n, len(self.skin)
        if inputs.resume or inputs.points is not None or inputs.payload is not None:
            return False
        if inputs.desired is not None or inputs.moving is not None:
            return False
        try:
            parts: Any = (robot.q, robot.qd, robot.q_commanded, robot.qd_commanded, robot.tau_ext, robot.wrench)
            stamps, distance, status = readings.stamp, readings.distance, readings.status
            if [*map(len, parts)] != [n, n, n, n, n, 6] or not len(stamps) == len(distance) == len(status) == units:
                return False
            if status.dtype is not WHOLE or not (isinstance(inputs.stamp, float) and isinstance(robot.stamp, float)):
                return False
            numbers, whole = now.blocks[0], now.blocks[1]
            np.concatenate(parts, out=numbers[self._joints])
            np.concatenate((stamps, distance), out=numbers[self._heard])
            whole[self._status] = status
            numbers[self._stamps[0]], numbers[self._stamps[1]] = inputs.stamp, robot.stamp
            return True
        except (AttributeError, TypeError, ValueError, OverflowError):
            return False

    def put_path(self, now: Flat, phase: float) -> None:
        """Write where the path is at an arc length [m]."""
        at = now.blocks[0][self._on_path]
        at[0], at[1:4], at[4:] = phase, self.path.point(phase), self.path.tangent(phase)

    def restricted(
        self, part: Restriction, state: object, memory: Flat, now: Flat, robot: RobotState, request: MotionRequest
    ) -> object:
        """Move within what a restriction in plain Python allows; return what it remembers."""
        count = now.get("seen.all")
        obstacles = Obstacles._make(near[:count] for near in now.part("seen.near", Obstacles))
        kin = now.part("kin", Kinematics)
        allowed, state = part.step(state, self._motion_body, kin, robot, obstacles, request)
        if allowed.velocity is not None:
            now.put("request.velocity", request.velocity + allowed.velocity)
        line_within(self.fixed.blocks, memory.blocks, now.blocks, *rows_of(allowed, self.model.n))
        return state

    def whole_detector(self, state: ControllerState) -> Any:
        """Return all that the detector remembers."""
        kept: Any = state.detector
        if self.kinds.detect != SEQUENTIAL:
            return kept
        return replace(kept, test=self.with_places(state.memory).part("test", SequentialState))

    def kept_detector(self, memory: Flat, state: Any) -> Any:
        """Keep what compiled code remembers of a detector; return the rest."""
        if self.kinds.detect != SEQUENTIAL:
            return state
        memory.fill("test", state.test)
        return replace(state, test=None)

    def may_be_one_call(self, detector: Any) -> bool:
        """Whether all parts are compiled, and a detector remembers nothing of a contact."""
        located = self.kinds.detect == SEQUENTIAL and detector.localisation is not None
        return PYTHON not in self.kinds and not self.touching and not (located and detector.localisation.steps)

    def whole_reaction(self, state: ControllerState) -> Any:
        """Return all that the reaction remembers."""
        memory = self.with_places(state.memory)
        return self.profile.react.caught_up(state.reaction, memory) if state.quick else state.reaction

    def with_places(self, memory: Flat) -> Flat:
        """Return what is remembered with the places of its fields, which a recording does not have."""
        if memory.places is self._begin.places:
            return memory
        if [len(block) for block in memory.blocks] != [len(block) for block in self._begin.blocks]:
            raise RobotStateError("The state is that of a controller for another arm or skin: begin with init().")
        return memory if memory.places else Flat(memory.blocks, self._begin.places)

    def _approach_init(self) -> object:
        """Return what a restriction in plain Python remembers at first."""
        return None if self.approach is None else self.approach.init(self._motion_body)
