"""From a reading to a joint velocity.

`Controller.step(state, inputs) -> (ControlStep, state)` is pure: no clock, no file, no memory beside the state. Nearly
every step is one call of `line`. After an event, with a part in plain Python or with rare inputs, `decision` takes the
same stages one by one.
"""

from dataclasses import replace
from typing import Any

from pretouch.contact.announced_load import LoadState, most_kg
from pretouch.contact.detector import Body
from pretouch.contact.residual_model import ResidualModel, SequentialState
from pretouch.control.approach import MotionBody
from pretouch.control.joint_box import joint_limits
from pretouch.control.path import Path, nearest_phase
from pretouch.decision import Decision, move_restricted
from pretouch.errors import RobotStateError, SkinError
from pretouch.faults import Watched, begin_watch, robot_of, take_sent
from pretouch.line import ASK, CHECK, MOVE, line
from pretouch.line_records import PYTHON, SEQUENTIAL
from pretouch.line_setup import fixed_of, kinds_of, now_init, remembered_init
from pretouch.modes import CLEAR, SOLVED, ModeState, mode_init
from pretouch.perception.scene_filter import Fixtures
from pretouch.profiles import Profile
from pretouch.records import Flat
from pretouch.robot.body import Capsules
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.sound import UsualInputs, sound_robot
from pretouch.types import ControlStep, Inputs, Report, RobotState
from pretouch.values import value


@value
class ControllerState:
    """Memory of the controller from one step to the next."""

    memory: Flat
    """Memory of compiled code, see `line_records.Remembered`."""
    mode: ModeState
    detector: object
    """Other state of the profile's detector."""
    reaction: object
    approach: object
    """Other state of the profile's restriction."""
    load: LoadState | None
    """Announced load; None before the first announcement."""
    calm: bool
    """True if the next step may be one call."""

    @property
    def phase(self) -> float:
        """Arc length travelled along the path [m]."""
        return self.memory.get("pace.phase")

    @property
    def robot(self) -> RobotState:
        """The last state of the arm that was plausible."""
        return robot_of(self.memory.part("watch.robot", Report))

    @property
    def learnt(self) -> ResidualModel:
        """The sequential detector's model of free motion."""
        return self.memory.part("test.model", ResidualModel)


class Controller:
    """Computes joint velocities from readings, for one arm, skin, surroundings, path and profile.

    `step` accepts any finite report of the arm, and a false one can move it against its acceleration limits: a loop of
    your own calls `loop.turn` instead, or `loop.explained` before it.
    """

    def __init__(self, model: RobotModel, skin: Skin, fixtures: Fixtures, path: Path, profile: Profile) -> None:
        self.model, self.skin, self.fixtures, self.path, self.profile = model, skin, fixtures, path, profile
        for unit, link in zip(skin.units, skin.link, strict=True):
            if model.link_index(unit.link) != link:
                raise SkinError(f"The skin was made for another arm than {model.description.name}: make one for it.")
        self.limits = joint_limits(model, profile.task.position_margin_rad, profile.task.control_period_s)
        self.body = Body(model, skin, self.limits.period, fixtures.planes, fixtures.capsules)
        self.kinds, self.most_kg = kinds_of(profile), most_kg(model)
        self.motion_body = MotionBody(model, len(skin), self.limits, profile.task)
        self.approach = profile.approach if self.kinds.approach == PYTHON else None
        """A restriction in plain Python; None if it is compiled."""
        self._begin_approach = None if self.approach is None else self.approach.init(self.motion_body)
        self.touching = profile.detect.touch is not None and len(skin.touching) > 0
        see = profile.perception
        self.remembers = see is not None and see.memory is not None
        self.slots = len(model.parts) * see.memory.per_link if see is not None and see.memory else len(skin)
        """Largest number of obstacles that are seen."""
        self.beside = fixtures.capsules
        self.fixed, self._begin = Flat.of(fixed_of(self)), Flat.of(remembered_init(self))
        self.blank = now = Flat.of(now_init(self))
        """Values that each step starts from; not written to."""
        self._usual = UsualInputs(now)
        self._on_path = slice(now.places["path.phase"].at.start, now.places["path.tangent"].at.stop)

    def init(self, robot: RobotState, learnt: ResidualModel | None = None) -> ControllerState:
        """Return the state before the first step; an unusable robot state is a RobotStateError.

        `learnt` is the model of free motion from an earlier session, for a detector that learns one.
        """
        sound, wrong = sound_robot(robot, self.limits.qd_max)
        if sound is None:
            raise RobotStateError(f"The controller cannot start: {wrong}: check the connection to the arm.")
        memory = self._begin.copy()
        begin_watch(memory.part("watch", Watched), sound)
        memory.put("command", sound.qd_commanded)
        memory.get("mass.path")[:] = sound.q_commanded
        memory.put("rotation_goal", self.model.kinematics(sound.q).rotation[self.model.ee])
        detector = self.store_detector(memory, self.profile.detect.init(self.body, learnt))
        reaction = self.profile.react.init(self.body, sound.q_commanded)
        return ControllerState(memory, mode_init(), detector, reaction, self._begin_approach, None, False)

    def adopt(self, state: ControllerState, before: "Controller") -> ControllerState:
        """Continue from a state of another controller of the same arm and skin, with this one's profile and path.

        A force window of another length and another detector start anew. The arm joins another path at its nearest
        point, and the speed along it grows from 0. A reaction that is over stays so.
        """
        mine, theirs, memory = self.profile, before.profile, self._begin.copy()
        remembered = before.with_places(state.memory)
        same_units = remembered.places["tracks.point"].shape == memory.places["tracks.point"].shape
        if not same_units or remembered.places["command"].shape != memory.places["command"].shape:
            raise RobotStateError("The state is that of a controller for another arm or skin: begin with init().")
        same_window = mine.window.samples == theirs.window.samples and type(mine.detect) is type(theirs.detect)
        same_slots = self.slots == before.slots and self.remembers == before.remembers
        same_map = self.remembers and before.remembers
        parts = ["watch", "tracks", "pace", "command", "rotation_goal"] + ["places", "source_stamp"] * same_map
        parts += ["window"] * same_window + ["null_velocity"] * (mine.null_space == theirs.null_space)
        parts += ["mass"] * (type(mine.react) is type(theirs.react))
        memory.take(remembered, parts + ["slots"] * (mine.approach == theirs.approach and same_slots))
        watch = memory.part("watch", Watched)
        take_sent(watch, remembered.part("watch", Watched))
        if "mass" not in parts:
            memory.get("mass.path")[:] = watch.robot.q_commanded
        if self.path is not before.path:
            here = self.model.kinematics(watch.robot.q).position[self.model.ee]
            memory.put("pace.phase", nearest_phase(self.path, here))
            memory.put("pace.speed", 0.0)
        detector = mine.detect.init(self.body)
        if same_window:
            detector = mine.detect.adopted(before.whole_detector(state), self.body, theirs.detect)
        reaction = mine.react.adopted(state.reaction, self.body, theirs.react, watch.robot.q_commanded)
        approach = state.approach if mine.approach == theirs.approach else self._begin_approach
        detector = self.store_detector(memory, detector)
        return replace(state, memory=memory, detector=detector, reaction=reaction, approach=approach, calm=False)

    def step(self, state: ControllerState, inputs: Inputs) -> tuple[ControlStep, ControllerState]:
        """Run one control cycle, once a period, with the state of the step before; any finite report is accepted."""
        remembered = self.with_places(state.memory)
        memory = remembered.copy()
        if state.calm:
            now = self.blank.copy()
            if self._usual.copy(now, inputs):
                self.put_path(now, remembered.get("pace.phase"))
                approach, part = state.approach, self.approach
                calm = self.take(memory, now, self.beside, CHECK, MOVE if part is None else ASK)
                if calm and part is not None:
                    approach = move_restricted(self, part, approach, memory, now)
                if calm and now.get("answer.ending") == SOLVED:
                    return ControlStep.of(now, CLEAR), ControllerState(
                        memory, CLEAR, state.detector, state.reaction, approach, None, True
                    )
                memory = remembered.copy()
        step, after = Decision(self, state, memory).run(inputs)
        return step, ControllerState(memory, **after)

    def take(self, memory: Flat, now: Flat, beside: Capsules, first: int, last: int) -> bool:
        """Run stages of a step; see `line`."""
        return line(self.fixed.blocks, memory.blocks, now.blocks, beside, first, last)

    def put_path(self, now: Flat, phase: float) -> None:
        """Write point and tangent of the path at an arc length [m]."""
        at = now.blocks[0][self._on_path]
        at[0], at[1:4], at[4:] = phase, self.path.point(phase), self.path.tangent(phase)

    def whole_detector(self, state: ControllerState) -> Any:
        """Return the whole state of the detector, with its part in the memory of compiled code."""
        detector: Any = state.detector
        if self.kinds.detect != SEQUENTIAL:
            return detector
        return replace(detector, test=self.with_places(state.memory).part("test", SequentialState))

    def store_detector(self, memory: Flat, state: Any) -> Any:
        """Write the part of a detector's state that compiled code keeps to memory; return the rest."""
        if self.kinds.detect != SEQUENTIAL:
            return state
        memory.fill("test", state.test)
        return replace(state, test=None)

    def with_places(self, memory: Flat) -> Flat:
        """Return a memory with the places of its fields, which a recording does not store."""
        if memory.places is self._begin.places:
            return memory
        if [len(block) for block in memory.blocks] != [len(block) for block in self._begin.blocks]:
            raise RobotStateError("The state is that of a controller for another arm or skin: begin with init().")
        return memory if memory.places else Flat(memory.blocks, self._begin.places)
