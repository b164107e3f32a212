"""From readings to a joint velocity: the paper on one page, as compiled code.

A control step has five stages. Nearly every step is one call of all of them; in other steps Python calls them one by
one and decides between them (`decision`). With `NUMBA_DISABLE_JIT=1` a debugger steps through.

Each stage takes the blocks of three records, `Fixed`, `Remembered` and `Now`, and opens the fields that it needs. The
last two are changed.
"""

import numpy as np

from pretouch.compiled import entry, inlined, kernel
from pretouch.contact.clamp import note_place
from pretouch.contact.moving_thresholds import compare
from pretouch.contact.sequential import Moment
from pretouch.contact.sequential_step import assess_sample
from pretouch.contact.virtual_mass import learn_mean
from pretouch.contact.window import add_sample
from pretouch.control.approach import ConstraintRows, approach_rows
from pretouch.control.braking import braking_rows
from pretouch.control.motion import move_within
from pretouch.control.path import advance, follow, reduce_speed, speed_scale
from pretouch.faults import is_plausible
from pretouch.line_records import ADMITTANCE, BRAKING, PAPER, THRESHOLDS, Fixed, Now, Remembered
from pretouch.modes import SOLVED
from pretouch.perception.external_points import take_points
from pretouch.perception.obstacles import measured, speed_factor
from pretouch.perception.perceive import perceive
from pretouch.records import Blocks, opener
from pretouch.robot.body import Capsules
from pretouch.robot.kinematics import Chain, place
from pretouch.types import SEEN_NOW_S, FloatArray, SeenPoints, some_of

CHECK, SEE, DETECT, ASK, MOVE = range(5)
"""Stages of a step."""


_checks, _watch = opener(Fixed, "qd_max", "failure"), opener(Remembered, "watch", "command")
_report = opener(Now, "stamp", "robot")


@entry
def line(fixed: Blocks, remembered: Blocks, now: Blocks, beside: Capsules, first: int, last: int) -> bool:
    """Run the stages from the first to the last; from `CHECK` on, return False where Python has to decide."""
    alone = first == CHECK
    if alone:
        (qd_max, failure), (watch, command), (stamp, robot) = _checks(fixed), _watch(remembered), _report(now)
        if not is_plausible(stamp[0], robot, watch, command, qd_max, failure):
            return False
    if first <= SEE <= last and see(fixed, remembered, now, beside) < 1.0 and alone:
        return False
    if first <= DETECT <= last and detect(fixed, remembered, now) and alone:
        return False
    if first <= ASK <= last:
        ask(fixed, remembered, now, alone)
    if first <= MOVE <= last:
        move(fixed, remembered, now)
    return True


_sight = opener(Fixed, "hinges", "mechanism.arm", "sight")
_tracks = opener(Remembered, "tracks", "places", "source_stamp")
_perceived = opener(Now, "stamp", "robot", "readings", "kin", "ee", "scene")


@inlined
def see(fixed: Blocks, remembered: Blocks, now: Blocks, beside: Capsules) -> float:
    """Compute the posture and the obstacles (eq. 1); return the factor on the speed for units that fall silent."""
    (hinges, arm, sight), (tracks, places, source_stamp) = _sight(fixed), _tracks(remembered)
    stamp, robot, readings, kin, ee, scene = _perceived(now)
    place(hinges, robot.q, kin)
    ee[:] = kin.position[arm.ee]
    scene.sensed[0], scene.nearest[0], scene.silence_scale[0] = 0, np.inf, 1.0
    if sight.sees or source_stamp[0] > -np.inf:
        memory = tracks, places
        posture = kin, Chain(kin.anchor, kin.axis, arm.moved_by, robot.qd), ee
        count, nearest, oldest = perceive(sight, memory, readings, scene, posture, (stamp[0], robot.stamp[0]), beside)
        silence, p = stamp[0] - oldest, sight.perception
        scene.sensed[0], scene.nearest[0] = count, nearest
        scene.silence_scale[0] = speed_factor(silence, p.slow_after_s, p.silent_after_s)
    else:
        scene.distance[:] = measured(readings.distance, readings.status, sight.skin.cones)
    scene.total[0] = scene.sensed[0]
    return scene.silence_scale[0]


_points, _place = opener(Remembered, "places", "source_stamp"), opener(Now, "stamp", "robot", "kin")


@entry
def line_points(fixed: Blocks, remembered: Blocks, now: Blocks, points: SeenPoints, beside: Capsules) -> None:
    """Add points of outside sources before the stage `SEE`; a step in one call has none."""
    (hinges, arm, sight), memory, (stamp, robot, kin) = _sight(fixed), _points(remembered), _place(now)
    place(hinges, robot.q, kin)
    chain = Chain(kin.anchor, kin.axis, arm.moved_by, robot.qd)
    take_points(sight, memory, points, (kin, chain), (stamp[0], robot.stamp[0]), beside)


_detection = opener(Fixed, "kinds", "window", "filtered", "thresholds", "notes_path")
_test = opener(Fixed, "test", "no_gain", "mechanism", "sight.sees")
_memory = opener(Remembered, "window", "test", "mass")
_sample = opener(Now, "robot", "kin", "ee", "scene", "filtered_force", "detection")


@inlined
def detect(fixed: Blocks, remembered: Blocks, now: Blocks) -> bool:
    """Add the force to its window (eq. 8), and distinguish a contact from free motion (eqs. 9-11, or by the torques).

    Return whether Python has to decide; otherwise the arm's own motion is learnt.
    """
    (kinds, p, filtered, thresholds, notes_path), (test, no_gain, mechanism, sees) = _detection(fixed), _test(fixed)
    (window, state, mass), (robot, kin, ee, scene, force, d) = _memory(remembered), _sample(now)
    armed, near = window.samples[0] == len(window.ring), some_of(scene.near, 0, scene.sensed[0])
    add_sample(window, robot.wrench[:3], p)
    force[:] = window.sums[0]
    if kinds.detect == THRESHOLDS:
        compared = force if filtered else robot.wrench[:3]
        contact, d.log_likelihood_ratio[0] = compare(window, compared, ee, near, thresholds, d.bands)
        d.residual[:] = robot.tau_ext
    else:
        moment = Moment(kin, robot.qd, robot.qd_commanded, robot.tau_ext, near, no_gain, sees, False)
        assess_sample(state, moment, test, mechanism, d)
        contact = d.log_likelihood_ratio[0] >= 1.0
    if contact or not armed:
        return True
    if kinds.react == ADMITTANCE:
        learn_mean(mass, d.residual, test.period)
        if notes_path:
            note_place(mass.path, mass.marked, robot.q_commanded, test.period)
    return False


_task, _pace = opener(Fixed, "motion.task", "end_m", "slow_m"), opener(Remembered, "pace", "rotation_goal")
_way = opener(Now, "ee", "scene.nearest", "scene.silence_scale", "path", "request")


@inlined
def ask(fixed: Blocks, remembered: Blocks, now: Blocks, alone: bool) -> None:
    """Compute the velocity along the path, slowed near obstacles (eqs. 3-4); request it where `alone`."""
    (p, _, slow_m), (pace, rotation_goal) = _task(fixed), _pace(remembered)
    ee, nearest, silence_scale, path, request = _way(now)
    slowed = speed_scale(nearest[0], slow_m) if slow_m > 0.0 else 1.0
    path.scale[0] = reduce_speed(pace, min(silence_scale[0], slowed), p.restore_cycles)
    follow(path, pace.speed[0], ee, p)
    if alone:
        request.goal[:], request.advances[0] = rotation_goal, 1
        for i in range(3):
            request.velocity[i] = path.scale[0] * path.velocity[i]


_body = opener(Fixed, "kinds.approach", "mechanism", "paper", "braking", "motion")
_moving = opener(Remembered, "slots", "null_velocity", "command")
_motion = opener(Now, "robot", "kin", "ee", "scene.near", "scene.total", "request", "answer")


@inlined
def move(fixed: Blocks, remembered: Blocks, now: Blocks) -> None:
    """Write the rows that restrict the body (eqs. 5-7), and the joint velocities within them (eq. 2)."""
    (approach, mechanism, paper, braking, motion), (slots, null_velocity, command) = _body(fixed), _moving(remembered)
    robot, kin, ee, room, count, request, answer = _motion(now)
    near, n, free = some_of(room, 0, count[0]), len(robot.q), np.empty(0)
    rows = ConstraintRows(np.empty((0, n)), np.empty(0), np.empty(0, np.int64), 1.0)
    if approach == PAPER:
        rows = approach_rows(kin, mechanism.arm.moved_by, near, paper)
    elif approach == BRAKING:
        # posture as measured, speeds as commanded: a row tightens from what the arm was sent last
        chain = Chain(kin.anchor, kin.axis, mechanism.arm.moved_by, robot.qd_commanded)
        p, fixtures = braking.curve, request.untouched[0]
        touch = p.touch_speed_m_s, braking.deadband_m_s, fixtures, p.untouched_s, np.inf
        if not np.isnan(request.touch_m_s[0]):
            # the speeds of the objects do not count, nor what was seen before
            touch = request.touch_m_s[0], np.inf, fixtures, 0.0, SEEN_NOW_S
        rows = braking_rows(braking, slots, near, chain, touch)
    move_within(motion, robot, (kin, ee, near), request, rows, (free, free), null_velocity, answer)
    command[:] = answer.command
    go_on(fixed, remembered, now)


_phase, _moved = opener(Remembered, "pace"), opener(Now, "path", "request", "answer")


@kernel
def go_on(fixed: Blocks, remembered: Blocks, now: Blocks) -> None:
    """Advance along the path with the motion, or stay at its phase and accelerate from there later."""
    (p, end_m, _), (pace,), (path, request, answer) = _task(fixed), _phase(remembered), _moved(now)
    if request.advances[0] == 1 and (request.hold[0] == 1 or answer.ending[0] == SOLVED):
        pace.phase[0] = min(advance(pace.phase[0], path, answer.velocities[1], p.control_period_s), end_m)
        pace.speed[0] = min(p.speed_m_s, pace.speed[0] + p.acceleration_m_s2 * p.control_period_s)
    else:
        pace.speed[0] = 0.0


_limits = opener(Fixed, "motion")


@entry
def line_within(
    fixed: Blocks, remembered: Blocks, now: Blocks, rows: ConstraintRows, speeds: tuple[FloatArray, FloatArray]
) -> None:
    """Run the stage `MOVE` within rows and joint speeds of a part in plain Python; see `Restricted`."""
    (motion,), (_, null_velocity, command) = _limits(fixed), _moving(remembered)
    robot, kin, ee, room, count, request, answer = _motion(now)
    scene = kin, ee, some_of(room, 0, count[0])
    move_within(motion, robot, scene, request, rows, speeds, null_velocity, answer)
    command[:] = answer.command
    go_on(fixed, remembered, now)
