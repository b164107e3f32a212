"""A control step in which Python decides: the stages of `line` one by one, with the decisions between them."""

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from pretouch.contact.announced_load import announce, store_free_torques, without_load
from pretouch.contact.detector import Detection, Sample
from pretouch.contact.reaction import ReactionInputs
from pretouch.contact.virtual_mass import VirtualMass
from pretouch.contact.window import Window, add_force
from pretouch.control.approach import MotionRequest, Restriction, rows_of
from pretouch.control.commander import MotionReference, reference_of
from pretouch.faults import Watched, examine, put_robot, robot_of
from pretouch.line import ASK, MOVE, SEE, line_points, line_within
from pretouch.line_records import PYTHON, SEQUENTIAL
from pretouch.modes import CLEAR, Event, QpOutcome, next_mode, outcome_of
from pretouch.perception.closest import beside, near_moving
from pretouch.perception.external_points import outside_silence
from pretouch.perception.obstacles import silent_units, track_init
from pretouch.records import Flat
from pretouch.robot.kinematics import Kinematics
from pretouch.sound import sound_desired, sound_moving, sound_payload, sound_points, sound_readings, sound_touch
from pretouch.types import ControlStep, Inputs, Mode, Obstacles, Report

if TYPE_CHECKING:
    from pretouch.controller import Controller, ControllerState


class Decision:
    """One control step while it is computed."""

    def __init__(self, controller: "Controller", state: "ControllerState", memory: Flat) -> None:
        """Take a state, and a copy of its memory, which is changed."""
        self.controller, self.state, self.memory, self.now = controller, state, memory, controller.blank.copy()
        self.profile, self.model, self.mode = controller.profile, controller.model, state.mode
        self.beside, self.silent, self.watched = controller.beside, "", False

    def run(self, inputs: Inputs) -> tuple[ControlStep, dict[str, Any]]:
        """Compute the step; return it, and the fields of the state after it."""
        self._judge(inputs)
        self._see()
        detection, detector = self._detect()
        contact, desired, reaction = self._answer(detection, inputs.resume)
        approach = self._move(desired)
        mode, still = self.mode, np.zeros(3)
        if mode.mode is Mode.TRACK:
            self.memory.put("rotation_goal", desired.lasting_rotation)
        step = ControlStep.of(
            self.now,
            mode,
            path_position=desired.point,
            contact=contact,
            desired_velocity=still if mode.mode is Mode.HOLD else desired.velocity,
            reaction_velocity=desired.velocity if mode.mode is Mode.REACT else still,
            **{name: getattr(detection, name) for name in _OF_DETECTION},
        )
        load = self.load and store_free_torques(self.load, self.robot.tau_ext, detection.residual)
        detector = self.controller.store_detector(self.memory, detector)
        event = detection.contact is not None or self._has_source or load is not None
        calm = mode == CLEAR and not event and self.profile.react.is_over(reaction) and self._is_compiled(detector)
        state = {"mode": mode, "detector": detector, "reaction": reaction, "approach": approach, "load": load}
        return step, state | {"calm": calm}

    def _is_compiled(self, detector: Any) -> bool:
        """Return whether detector and reaction are compiled, and the detector has no memory of a contact."""
        controller, (detect, _, react) = self.controller, self.controller.kinds
        located = detect == SEQUENTIAL and detector.localisation is not None
        return PYTHON not in (detect, react) and not (controller.touching or (located and detector.localisation.steps))

    def _judge(self, inputs: Inputs) -> None:
        """Select the usable inputs, and note the faults of the others."""
        p, controller, memory, units = self.profile, self.controller, self.memory, len(self.controller.skin)
        watch, command, limits = memory.part("watch", Watched), memory.get("command"), controller.limits
        self.robot, self.events = examine(
            watch, inputs, command, limits.period, limits.qd_max, p.failure, p.detect.by_torques
        )
        self.stamp, seeing = memory.get("watch.stamp"), p.perception is not None
        self.readings, unfit = sound_readings(inputs.readings, units)
        self.touches, wrong = sound_touch(inputs.touch, units) if controller.touching else (None, "")
        self.points, self.lost = sound_points(inputs.points)
        payload, heavy = sound_payload(inputs.payload, controller.most_kg)
        self.load = announce(self.state.load, payload, self.robot)
        self.moving, astray = sound_moving(inputs.moving, self.stamp, p.failure.state_timeout_s)
        self.desired, refused = sound_desired(inputs.desired, self.model.n, self.stamp)
        self._note({Event.LOAD_UNFIT: heavy, Event.MOVING_LOST: astray, Event.DESIRED_UNFIT: refused})
        if self.desired is not None and (age := self.stamp - self.desired.stamp[-1]) > p.failure.desired_timeout_s:
            self.events[Event.DESIRED_STALE] = f"{age:.2f} s"
        self._note({Event.SKIN_UNFIT: (unfit or wrong) if seeing else ""})
        self.now.put("stamp", self.stamp)
        self.now.fill("readings", self.readings)
        if Event.TIME_BACKWARDS in self.events:
            memory.fill("tracks", track_init(units))
            memory.put("places.number", 0)
            memory.put("source_stamp", -np.inf if self._has_source else np.nan)
        if self.moving is not None and p.perception is not None:
            fixtures, persistence = controller.fixtures.capsules, p.perception.persistence_s
            self.beside = beside(fixtures, self.moving, self.readings, self.stamp, persistence)

    def _note(self, events: dict[Event, str]) -> None:
        """Add the events that have a detail."""
        self.events |= {event: detail for event, detail in events.items() if detail}

    def _see(self) -> None:
        """Compute the posture and the obstacles near the arm (eq. 1)."""
        now, see, stamp, robot, controller = self.now, self.profile.perception, self.stamp, self.robot, self.controller
        report = now.part("robot", Report)
        put_robot(report, robot)
        if self.points is not None and see is not None and see.outside is not None:
            blocks = controller.fixed.blocks, self.memory.blocks, now.blocks
            line_points(*blocks, self.points, controller.beside)
        controller.take(self.memory, now, self.beside, SEE, SEE)
        self.kin = kin = now.part("kin", Kinematics)
        if self.load is not None:
            self.robot, self.load = without_load(self.load, self.model, kin, robot, self.controller.limits.period)
            put_robot(report, self.robot)
        if see is not None:
            skin, silence_scale = controller.skin, now.get("scene.silence_scale")
            last = self.memory.get("tracks.report_stamp") + skin.late
            self.silent = silent_units(skin, last, self.readings.status, stamp, see.silent_after_s)
            self.watched = len(skin) > 0 and silence_scale >= 1.0 and not self.silent
            slower, self.lost = outside_silence(self.memory.get("source_stamp"), self.lost, stamp, see.outside)
            now.put("scene.silence_scale", min(silence_scale, slower))
            self._note({Event.SKIN_SILENT: self.silent, Event.POINTS_LOST: self.lost})
        else:
            self.lost = ""
        self.near = near_of(now, "scene.sensed")
        if self.moving is not None:
            first = now.get("scene.sensed")
            near = near_moving(self.moving, self.model, kin, stamp, (len(controller.skin) + 1, controller.slots))
            for room, part in zip(now.part("scene.near", Obstacles), near, strict=True):
                room[first : first + len(part)] = part
            now.put("scene.total", first + len(near.unit))
            now.put("request.untouched", controller.slots)

    @property
    def _has_source(self) -> bool:
        """Return whether there was a source of outside points."""
        return not np.isnan(self.memory.get("source_stamp"))

    def _detect(self) -> tuple[Detection, Any]:
        """Distinguish a contact from free motion (eqs. 8-11); return the detection and the detector's state."""
        p, memory, robot, state = self.profile, self.memory, self.robot, self.state
        reacting, before = self.mode.mode is Mode.REACT, memory.part("window", Window)
        window = add_force(before, p.detect.counted(robot, before), p.window)
        kg, watched, touches = self.load.doubted_kg if self.load else 0.0, self.watched, self.touches
        sample = Sample(self.stamp, self.kin, robot, window, before.full, self.near, reacting, watched, touches, kg)
        detection, detector = p.detect.step(self.controller.whole_detector(state), self.controller.body, sample)
        window = before if reacting and p.window.freeze_while_reacting else window
        memory.fill("window", window)
        self.now.put("filtered_force", window.newest)
        if not detection.armed and p.detect.by_torques and bool(np.isnan(detection.residual).any()):
            self.events.setdefault(Event.NO_FORCE, f"up to {p.failure.force_timeout_s:g} s")
        elif not detection.armed:
            self.events[Event.WINDOW_FILLING] = f"{window.samples[0]} of {p.window.samples} samples"
        return detection, detector

    def _answer(self, detection: Detection, resume: bool) -> tuple[Any, MotionReference, Any]:
        """Decide on the mode; return the contact that begins, the desired motion, and the reaction's state."""
        p, now, memory, controller, mode = self.profile, self.now, self.memory, self.controller, self.mode
        missed = bool(self.silent or self.lost)
        phase, goal = memory.get("pace.phase"), memory.get("rotation_goal").copy()
        near, mass = near_of(now, "scene.total"), memory.part("mass", VirtualMass)
        command = memory.get("command").copy()
        noticed = ReactionInputs(mode, self.kin, self.robot, detection, near, missed, command, phase, resume, mass)
        answers, reaction = p.react.sense(self.state.reaction, controller.body, noticed)
        self.mode = next_mode(mode, self.events | answers, resume)
        contact = detection.contact if self.mode.mode is Mode.REACT is not mode.mode else None

        # along the path or as a commander requests, as fast as eqs. 3-4 allow, or as the reaction moves
        controller.put_path(now, phase)
        controller.take(memory, now, self.beside, ASK, ASK)
        scale = now.get("path.scale")
        if self.desired is None:
            reference = MotionReference(scale * now.get("path.velocity"), now.get("path.point"), goal, goal)
        else:
            reference = reference_of(self.desired, self.stamp, self.kin, self.robot, self.model, goal, p.task, scale)
        answer, reaction = p.react.move(reaction, controller.body, noticed, self.mode)
        if answer is not None:
            reference = replace(reference, velocity=answer.velocity, qd=answer.qd, rotation_goal=goal)
            now.put("request.touch_m_s", np.nan if answer.touch_speed is None else answer.touch_speed)
        elif self.mode.mode is not Mode.TRACK:
            reference = replace(reference, qd=None, rotation_goal=goal)
        return contact, reference, reaction

    def _move(self, reference: MotionReference) -> Any:
        """Compute the joint velocities closest to a reference, eqs. 5-7 and 2; return the restriction's state."""
        now, mode, controller = self.now, self.mode, self.controller
        hold = mode.mode is Mode.HOLD and reference.qd is None
        now.put("request.velocity", reference.velocity)
        now.put("request.goal", reference.rotation_goal)
        now.put("request.hold", hold)
        now.put("request.advances", mode.mode is Mode.TRACK and self.desired is None)
        if reference.qd is not None:
            now.put("request.qd", reference.qd)
            now.put("request.by_joints", 1)
        approach, part = self.state.approach, controller.approach
        if part is None:
            controller.take(self.memory, now, self.beside, MOVE, MOVE)
        else:
            approach = move_restricted(controller, part, approach, self.memory, now)
        outcome, status, _ = outcome_of(hold, now.get("answer.ending"), bool(now.get("answer.violated")))
        if outcome in _TROUBLE and (outcome is QpOutcome.FAILED or mode.mode is not Mode.HOLD):
            self.mode = next_mode(mode, {_TROUBLE[outcome]: status}, resume=False)
            self.memory.put("pace.speed", 0.0)
        return approach


def move_restricted(controller: "Controller", part: Restriction, state: object, memory: Flat, now: Flat) -> object:
    """Move within the rows of a restriction in plain Python; return its state."""
    request, kin = now.part("request", MotionRequest), now.part("kin", Kinematics)
    robot, obstacles = robot_of(now.part("robot", Report)), near_of(now, "scene.total")
    velocity = request.velocity.copy()
    allowed, state = part.step(state, controller.motion_body, kin, robot, obstacles, request)
    if allowed.velocity is not None:
        request.velocity[:] += allowed.velocity
    line_within(controller.fixed.blocks, memory.blocks, now.blocks, *rows_of(allowed, controller.model.n))
    request.velocity[:] = velocity
    return state


def near_of(now: Flat, count: str) -> Obstacles:
    """Return the obstacles of a step, as many as a field counts."""
    total = now.get(count)
    return Obstacles._make(part[:total] for part in now.part("scene.near", Obstacles))


_OF_DETECTION = ("armed", "thresholds", "residual", "evidence", "touched", "detectable_n")
"""Fields that a step has of the detection."""
_TROUBLE = {QpOutcome.FAILED: Event.SOLVER_FAILED, QpOutcome.INFEASIBLE: Event.BLOCKED}
