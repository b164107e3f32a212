"""Contacts on an arm whose units have IMUs, recorded once, and what the sequential test makes of them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pretouch.contact.detector import Sample
from pretouch.contact.hypotheses import NearPrior, write_hypotheses
from pretouch.contact.residual_model import spread_of_sample
from pretouch.contact.residual_windows import LENGTHS, window_means
from pretouch.contact.sequential import Hypotheses, judge
from pretouch.contact.sequential_detector import SequentialState
from pretouch.contact.sequential_test import SequentialTest
from pretouch.contact.window_scatter import white_means
from pretouch.errors import ExperimentError
from pretouch.groups import NOTHING_NEAR
from pretouch.params import ProximityPriorParams
from pretouch.profiles import Profile
from pretouch.robot.model import Kinematics
from pretouch.sim.imu import ImuParams
from pretouch.sim.plant import Plant
from pretouch.types import NOT_TOUCHED, BoolArray, FloatArray, ImuReadings, RobotState, Touched
from pretouch_lab.baselines.accelerometers import Accelerometers
from pretouch_lab.benchmarks.detection.arm import (
    AWAY,
    Alone,
    Sensing,
    model,
    path_of,
    plant_of,
    record,
    sensing_of,
)
from pretouch_lab.benchmarks.detection.contacts import Toucher, Touching, place_on, start_posture
from pretouch_lab.benchmarks.detection.stream import Stream
from pretouch_lab.detector_alone import DetectorAlone
from pretouch_lab.studies.impacts.kinds import HELD_S, IMPACTS_M_S, KINDS, LINKS, PUSH_N, PUSHES_S, pulse
from pretouch_lab.studies.impacts.units import SentImus

LOOK = 3
"""Steps after an alarm at which the touched link is asked for: by then the units' datagrams have come."""
WARM_UP_S = 30.0
"""Free motion before the first contact [s]."""

_GAP_S = (2.6, 3.2)
_TILT = 0.25
_HAND_RADIUS_M, _CLEAR_M = 0.04, 0.2


def plan(seed: int, kinds: Sequence[str] = KINDS, links: Sequence[str] = LINKS) -> list[Touching]:
    """Draw contacts: each kind on each link once, in any order."""
    rng, at, touches = np.random.default_rng([seed, 62]), WARM_UP_S, []
    every = [(kind, link) for kind in kinds for link in links]
    for k in rng.permutation(len(every)):
        kind, name = every[int(k)]
        link = model().link_index(f"{model().description.name}_{name}")
        point, normal = place_on(link, start_posture(), _HAND_RADIUS_M, rng, _CLEAR_M)
        inwards = _TILT * rng.uniform(-1, 1, 3) - normal
        if kind in IMPACTS_M_S:
            force, duration = pulse(IMPACTS_M_S[kind])
            rise = duration / 2
        else:
            force, rise = PUSH_N, PUSHES_S[kind]
            duration = 2 * rise + HELD_S
        inwards /= np.linalg.norm(inwards)
        touches.append(Touching(link, KINDS.index(kind), force, rise, duration, at, point, normal, inwards))
        at = touches[-1].end + rng.uniform(*_GAP_S)
    return touches


@dataclass(frozen=True)
class Course:
    """A recorded arm, its units' samples of each step, and the contacts on it."""

    stream: Stream
    imu: list[ImuReadings]
    sensing: Sensing
    touches: list[Touching]


def course(seed: int, touches: list[Touching], end_s: float, way: tuple[float, float]) -> Course:
    """Let an arm go round its circle at 0.3 m/s, touched as planned by what no unit sees; `way` as in `judged`."""
    datagram_s, vibration = way
    sensing = sensing_of("seven", seed)
    mounted: list[SentImus] = []
    samples: list[ImuReadings] = []

    def prepare(plant: Plant) -> Callable[[float], FloatArray]:
        imu = ImuParams(vibration_m_s2=vibration)
        mounted.append(SentImus(plant, sensing.skin, sensing.ranging, imu, seed, datagram_s))
        Toucher(plant, touches, _HAND_RADIUS_M)
        return lambda time: AWAY

    what = Alone(path_of("circle"), 0.3, plant_of("nominal"), sensing, _HAND_RADIUS_M, seed, end_s)
    stream = record(what, prepare, lambda plant, ghost, cycle: samples.append(mounted[0].imu()))
    return Course(stream, samples, sensing, touches)


@dataclass(frozen=True)
class Played:
    """What the test made of S steps."""

    alarm: BoolArray
    """(S,)"""
    gain: FloatArray
    """(S, L) of the cues."""
    links: FloatArray
    """(S, P) ln R of a force on each part alone, `LOOK` steps after an alarm; NaN elsewhere."""
    touched: list[Touched]
    """Where the arm was said to be touched in each step."""


def play_again(course: Course, found: Profile, use_imu: bool) -> Played:
    """Give the sequential test of a profile each step of a course, with the accelerometers or without."""
    arm, stream, skin, cue = model(), course.stream, course.sensing.believed, Accelerometers()
    test = replace(test_of(found), cues=(cue,) if use_imu else ())
    detector = DetectorAlone(replace(found, detect=test), arm, skin)
    steps, jolts = len(stream.count), cue.init(detector.body)
    alarm, gain = np.zeros(steps, np.bool_), np.ones((steps, len(arm.links)))
    links, touched = np.full((steps, len(arm.parts)), np.nan), [NOT_TOUCHED] * steps
    for i, (robot, near, reacting, watched) in enumerate(stream.steps()):
        kin, imu = arm.kinematics(robot.q), course.imu[i]
        if use_imu:  # once more beside the test, to see what it gets
            sample = Sample(robot.stamp, kin, robot, detector.window, True, near, imu=imu)
            cues, jolts = cue.step(jolts, detector.body, sample)
            gain[i] = 1.0 if cues is None else cues.gain
        said = detector.step(kin, robot, near, reacting, watched, imu=imu)
        alarm[i], touched[i] = said.contact is not None, said.touched
        if i >= LOOK and alarm[i - LOOK]:
            links[i] = link_evidence(detector.state.test, kin, robot, test)
    return Played(alarm, gain, links, touched)


def test_of(found: Profile) -> SequentialTest:
    """Return the sequential test of a profile; an ExperimentError if it detects otherwise."""
    if not isinstance(found.detect, SequentialTest):
        raise ExperimentError(f"The profile {found.name} detects by {found.detect.name}: choose pretouch.")
    return found.detect


def link_evidence(known: SequentialState, kin: Kinematics, robot: RobotState, p: SequentialTest) -> FloatArray:
    """Return ln R (P,) of the windows that end with a step, of a force at the middle of each link alone."""
    arm, near = model(), p.proximity or ProximityPriorParams()
    n, parts = arm.n, len(arm.parts)
    means, S = np.zeros((len(LENGTHS), n)), np.empty((n, n))
    whole = window_means(known.ring, known.at, known.count, means)
    moving = int(np.any(np.abs(robot.qd_commanded) > p.still_rad_s))
    spread_of_sample(arm.mass_matrix(robot.q), known.model.spread[moving], p.noise_floor_nm, S)
    contacts = Hypotheses(np.empty((parts, 3, n)), np.empty(parts, np.int64), np.empty(n + parts), np.zeros((parts, 3)))
    prior = NearPrior(near.gain, near.distance_m, near.horizon_s)
    write_hypotheses(kin, arm.mechanism, robot.qd, NOTHING_NEAR, np.ones(len(arm.links)), prior, contacts)
    free, found = white_means(S, np.full(n, p.bias_floor_nm**2)), np.empty(parts)
    for h in range(parts):
        one = np.zeros(n + parts)
        one[n + h] = 1.0
        found[h] = judge(means, whole, free, contacts._replace(weight=one), p.contact_gain, p.tails)[0]
    return found
