"""Records of the compiled line for an arm, a skin, its surroundings, a path and a profile."""

import math
import sys
from typing import Any

import numpy as np

from pretouch.contact.admittance import Admittance
from pretouch.contact.moving_thresholds import MovingThresholds
from pretouch.contact.reaction import DecayingVelocity
from pretouch.contact.residual_model import sequential_init, sequential_numbers
from pretouch.contact.scatter import LENGTHS
from pretouch.contact.sequential_test import SequentialTest
from pretouch.contact.virtual_mass import mass_init
from pretouch.contact.window import window_init
from pretouch.control.approach import ApproachRestriction, BrakingCurve, row_numbers
from pretouch.control.braking import braking_numbers, slots_init
from pretouch.control.motion import MotionNumbers
from pretouch.control.path import PathPace
from pretouch.faults import Watched
from pretouch.line_records import (
    ADMITTANCE,
    BRAKING,
    DECAY,
    NO_ROWS,
    PAPER,
    PYTHON,
    SEQUENTIAL,
    THRESHOLDS,
    Fixed,
    Kinds,
    Now,
    Remembered,
)
from pretouch.params import LocalMapParams, NullSpaceMotion, OutsidePoints, PerceptionParams, SequentialParams
from pretouch.perception.local_map import MOST_PLACES, map_init
from pretouch.perception.obstacles import Sight, track_init
from pretouch.records import zeros
from pretouch.types import no_obstacles


def kinds_of(profile: Any) -> Kinds:
    """Return the kinds of a profile's parts; a part of your own is not compiled, even if it extends one that is."""
    detect, approach, react = type(profile.detect), type(profile.approach), type(profile.react)
    return Kinds(
        THRESHOLDS if detect is MovingThresholds else SEQUENTIAL if detect is SequentialTest else PYTHON,
        {type(None): NO_ROWS, ApproachRestriction: PAPER, BrakingCurve: BRAKING}.get(approach, PYTHON),
        {DecayingVelocity: DECAY, Admittance: ADMITTANCE}.get(react, PYTHON),
    )


def fixed_of(controller: Any) -> Fixed:
    """Return the constants of all control steps."""
    model, skin, profile, limits = controller.model, controller.skin, controller.profile, controller.limits
    kinds, n, t, see, failure = controller.kinds, model.n, profile.task, profile.perception, profile.failure
    perception, thresholds = see or PerceptionParams(), MovingThresholds.of_kind(profile.detect)
    # nothing is nearer than -inf, so nothing moves away
    away = profile.null_space or NullSpaceMotion().numbers._replace(distance_m=-math.inf)
    test = profile.detect if kinds.detect == SEQUENTIAL else SequentialParams()
    return Fixed(
        kinds, model.hinges, model.mechanism, limits.qd_max, failure,
        Sight(
            see is not None and len(skin) > 0, perception.self_margin_m is not None, perception.self_margin_m or 0.0,
            perception.memory is not None, 0.0 if skin.exact else perception.spread_sigmas,
            model.capsules, model.body, controller.fixtures.planes, skin.arrays, skin.late,
            np.searchsorted(model.parts, np.arange(len(model.links))), perception,
            perception.memory or LocalMapParams(), perception.outside or OutsidePoints(),
        ),
        profile.window, thresholds.compare == "filtered", thresholds,
        sequential_numbers(n, limits.period, test), np.ones(len(model.links)),
        kinds.react == ADMITTANCE and profile.react.pinch is not None,
        math.inf if controller.path.closed else controller.path.length,
        0.0 if profile.slow is None else profile.slow.d_max_m,
        row_numbers(ApproachRestriction.of_kind(profile.approach)),
        braking_numbers(BrakingCurve.of_kind(profile.approach), t.speed_m_s, limits.period),
        MotionNumbers(
            model.mechanism.arm, t, t.orientation == "hold", failure.solver_iterations, limits.table, model.q_mid, away
        ),
    )  # fmt: skip


def _most_obstacles(controller: Any) -> int:
    """Return the largest number of obstacles, those of links beside moving fixtures last."""
    return int(controller.slots + len(controller.model.parts))


def remembered_init(controller: Any) -> Remembered:
    """Return the memory before the first step, without the arm's first report and a detector's knowledge."""
    n, profile, period, kinds = controller.model.n, controller.profile, controller.limits.period, controller.kinds
    sent, none = int(profile.failure.state_timeout_s / period) + 2, np.zeros(n)
    zero, cycles = np.zeros(1), np.zeros(1, np.int64)
    return Remembered(
        zeros(Watched, n=n, S=sent),
        track_init(len(controller.skin)), map_init(MOST_PLACES if controller.remembers else 0), np.full(1, np.nan),
        window_init(profile.window.samples),
        sequential_init(n if kinds.detect == SEQUENTIAL else 0, SequentialParams()),
        mass_init(n, Admittance.of_kind(profile.react)), PathPace(np.ones(1), cycles, zero, zero),
        slots_init(_most_obstacles(controller) if kinds.approach == BRAKING else 0), none, none, np.eye(3),
    )  # fmt: skip


def now_init(controller: Any) -> Now:
    """Return the values that each step starts from."""
    model, places = controller.model, _most_obstacles(controller)
    now = zeros(Now, n=model.n, L=len(model.links), K=len(controller.skin), M=places, W=len(LENGTHS))
    return now._replace(
        scene=now.scene._replace(near=no_obstacles(places), silence_scale=np.ones(1)),
        detection=now.detection._replace(detectable_n=np.full(1, np.nan)),
        request=now.request._replace(goal=np.eye(3), touch_m_s=np.full(1, np.nan), untouched=np.full(1, sys.maxsize)),
    )
