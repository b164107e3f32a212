"""A simulated arm that a person can touch, change and watch: no page, no thread, no clock.

`LiveSimulation.advance` turns the same loop over the same simulation as the experiments do. What a person does comes in
between two control cycles: the same commands before the same cycles give the same run, bit for bit.
"""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path as File
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from pretouch.controller import Controller
from pretouch.desired import Desired
from pretouch.errors import ParameterError
from pretouch.loop import Cycle, Options, turn
from pretouch.page.frame import Frame, World
from pretouch.page.opening import Opening
from pretouch.page.real_units import RealUnits
from pretouch.page.room import LiveSettings, PathName, Room, live_path
from pretouch.perception.local_map import LocalMap
from pretouch.profiles import Profile
from pretouch.recording.simulation import surroundings, truth_of
from pretouch.robot.description import panda
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin, paper_skin
from pretouch.session.progress import PushOutcome
from pretouch.sim.scene import described, fixtures
from pretouch.sim.tcp_push import Pushes, TcpPush
from pretouch.types import ControlStep, FloatArray

if TYPE_CHECKING:
    from pretouch.recording.writer import Recording


def nobody(now: float) -> Desired | None:
    """Request no motion: the arm follows its path."""
    return None


class LiveSimulation:
    """An arm on its path, its skin, an object and a person's hand, to be advanced and interfered with.

    All methods are called from one thread: whoever takes a person's commands from another one queues them. A command
    counts from the next control cycle on.
    """

    world: World
    """Static world; another object after each change."""
    frame: Frame
    """The newest instant."""
    room: Room
    """Simulated room; another object after a reset."""

    def __init__(
        self,
        settings: LiveSettings | None = None,
        model: RobotModel | None = None,
        skin: Skin | None = None,
        real: RealUnits | None = None,
    ) -> None:
        """Begin with the first control cycle done. Without others, the arm is a Panda with the paper's skin.

        Another arm needs `room.settings_for`.

        With `real` units, they are what the skin's units read.
        """
        self.model = model or RobotModel(panda())
        self.skin = skin or paper_skin(self.model)
        self.real = real
        """The real units on the arm; None: it carries simulated ones."""
        self.recording: Recording | None = None
        """The recording under way."""
        self.notice = ""
        """The last notice for a person, as a sentence; whoever shows it may empty it."""
        self.opening: Opening | None = None
        """The hand's script under way; None: the hand is a person's."""
        self.commander: Callable[[float], Desired | None] = nobody
        """Motion requested of the arm at an instant [s]; None: the path."""
        self._begin(settings or LiveSettings())

    def _begin(self, settings: LiveSettings) -> None:
        path = live_path(settings)
        room = Room(settings, path, self.model, self.skin, self.real)
        self.notice = self.stop_recording() or self.notice
        self.settings = settings
        """Present settings, which a reset starts with."""
        self.controller = Controller(self.model, self.skin, fixtures(room.scene), path, settings.profile)
        self.room, self._state = room, self.controller.init(room.plant.read())
        self._boxes = surroundings({"scene": described(room.scene)}).boxes
        self._resume, self._remainder, self.opening = False, 0.0, None
        self._pushes = Pushes(room.plant, (), 0.0)
        self._push: PushOutcome | None = None
        """The newest push, until its outcome is known."""
        self._update_world()
        self.single_step()

    @property
    def time(self) -> float:
        """Time in the simulation [s]."""
        return self.room.plant.time

    # time passes

    def advance(self, duration: float) -> list[ControlStep]:
        """Let a duration [s] pass in whole control cycles and return their steps; the rest of it counts next time."""
        period = self.controller.limits.period
        self._remainder += duration
        cycles = max(0, int(self._remainder / period + 1e-9))
        self._remainder -= cycles * period
        return [self.single_step() for _ in range(cycles)]

    def single_step(self) -> ControlStep:
        """Let one control cycle pass and return its step."""
        room, resume = self.room, self._resume
        self._resume = False
        if self.opening:
            room.mouse.move(self.opening.target(self.frame.step))
            self.opening = None if self.opening.over else self.opening
        tick = room.tick()
        options = Options(resume=lambda: resume, desired=lambda: self.commander(tick))
        cycle = turn(self.controller, self._state, room.plant, room.units, tick, options)
        self._state = cycle.after
        hand = room.hand.position
        age = cycle.step.stamp - cycle.inputs.readings.stamp
        force = room.plant.true_force + self._pushes.force
        places = cycle.after.memory.part("places", LocalMap) if self.controller.remembers else None
        self.frame = Frame(cycle.step, hand, room.mouse.target, force, room.touched, age, cycle.inputs, places)
        if self._push:
            self.notice = self._push.take(cycle.step) or self.notice
        self._keep(cycle, hand)
        return cycle.step

    # what a person does

    @property
    def hand_target(self) -> FloatArray:
        """Target of the hand (3,) [m], base frame."""
        return self.room.mouse.target

    def move_hand(self, target: FloatArray) -> None:
        """Move the hand's target to a place (3,) [m], base frame, or the nearest in the workspace; ends an opening."""
        self.opening = None
        self.room.mouse.move(target)

    def point_hand(self, eye: FloatArray, place: FloatArray) -> None:
        """Draw the hand to what an `eye` (3,) [m] sees at a place (3,) [m], as `Mouse.point` does; ends an opening."""
        self.opening = None
        self.room.mouse.point(eye, place, self.model, self.frame.step.q)

    def set_profile(self, profile: Profile) -> None:
        """Continue with other parameters; another control period is a ParameterError."""
        period = self.controller.limits.period
        if profile.task.control_period_s != period:
            raise ParameterError(
                f"The control period is {profile.task.control_period_s:g} s, but can change only by a reset: it stays"
                f" {period:g} s."
            )
        self._replace_controller(replace(self.settings, profile=profile))

    def set_path(self, name: str) -> None:
        """Go on along another path, 'circle' or 'line', from where it is nearest."""
        if name != self.settings.path:
            self._replace_controller(replace(self.settings, path=cast(PathName, name)))

    def silence(self, units: frozenset[str]) -> None:
        """Let units, by their ids, send nothing; an unknown id, and any of a real unit, is a ParameterError."""
        self.room.silence(units)
        self.settings = replace(self.settings, silenced=units)

    def push(self, force: FloatArray, duration: float) -> None:
        """Push the robot's hand with a force (3,) [N], base frame, for a time [s]; the notice tells the outcome."""
        x, y, z = np.asarray(force, dtype=np.float64).tolist()
        self._pushes.add(TcpPush(self.time, (x, y, z), duration))
        self._push = PushOutcome(force, self.time, duration)

    def resume(self) -> None:
        """Ask to leave a latched HOLD, once."""
        self._resume = True

    def play_opening(self) -> None:
        """Begin again at time 0 with a scripted hand, which is a person's again as soon as it is moved."""
        self.reset()
        scale = self.settings.placement.scale
        self.opening = Opening(self.model, self.skin, self.controller.path, scale, self.room.mouse.target)

    def reset(self, **changes: Any) -> None:
        """Restart at time 0 with the present settings, but for changes of `LiveSettings`; ends a recording."""
        self._begin(replace(self.settings, **changes))

    # recordings

    def start_recording(self, place: File) -> None:
        """Record from the next control cycle on; ends a recording under way. An unusable place is a RecordingError."""
        from pretouch.recording.writer import Recording

        begun = Recording(place, self.controller, self._about())
        self.stop_recording()
        self.recording = begun

    def stop_recording(self) -> str:
        """End the recording and return a sentence on it; '' if there was none."""
        recording, self.recording = self.recording, None
        return recording.close() if recording else ""

    def _replace_controller(self, settings: LiveSettings) -> None:
        """Let a controller with other settings take over."""
        path = self.controller.path if settings.path == self.settings.path else live_path(settings)
        after = Controller(self.model, self.skin, self.controller.fixtures, path, settings.profile)
        self._state = after.adopt(self._state, self.controller)
        self.controller, self.settings = after, settings
        if self.recording:
            self.recording.change(after)
        self._update_world()

    def _update_world(self) -> None:
        scene = self.room.scene
        radius = scene.hand.radius if scene.hand else None
        path, profile = self.controller.path, self.controller.profile
        self.world = World(self.model, self.skin, path, profile, self._boxes, radius, scene.floor_height)

    def _keep(self, cycle: Cycle, hand: FloatArray) -> None:
        """Empty the plant's log, into the recording if there is one."""
        log, touches = self.room.plant.take_log()
        if self.recording is None:
            return
        forces = [(time, force + self._pushes.at(time)) for time, force in log]
        self.recording.record(cycle, truth_of(forces, touches, hand))
        if self.recording.trouble:
            self.notice = self.recording.trouble
            self.stop_recording()

    def _about(self) -> dict[str, Any]:
        """Description of the session for a recording."""
        settings = self.settings
        return {
            "command": "pretouch live",
            "seed": settings.seed,
            "path": settings.path,
            "units": "real" if self.real else "simulated",
            "object": settings.object,
            "scene": described(self.room.scene),
        }
