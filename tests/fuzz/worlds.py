"""What a fuzzed controller is made of: profile, skin, fixtures, path, and where the arm starts."""

from dataclasses import dataclass, fields, replace

import numpy as np
from scipy.spatial.transform import Rotation

from pretouch.contact.admittance import Admittance
from pretouch.contact.moving_thresholds import MovingThresholds
from pretouch.contact.reaction import DecayingVelocity, Reaction
from pretouch.contact.sequential_test import SequentialTest
from pretouch.control.approach import ApproachRestriction, BrakingCurve
from pretouch.control.path import Circle, Path, WayPoints, segment
from pretouch.params import (
    ClampParams,
    ClosingSpeed,
    FailureParams,
    GiveUpParams,
    LocalisationParams,
    PerceptionParams,
    PinchParams,
    ProximityPriorParams,
    SpeedReduction,
    TaskParams,
    WindowParams,
)
from pretouch.params.pretouch import EffectiveMass, NullSpaceMotion, Tangential
from pretouch.perception.scene_filter import Fixtures, no_fixtures
from pretouch.profiles import Profile, profile
from pretouch.robot.body import Capsules
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin, paper_skin
from tests.reference.skins import spread

# for each parameter its usual value and values far to both sides; what a check bounds, up to the bound
CHOICES: dict[type, dict[str, tuple[object, ...]]] = {
    PerceptionParams: {
        "persistence_s": (0.06, 0.005, 1.0), "self_margin_m": (0.06, 0.0, 1.0, None), "slow_after_s": (0.1, 0.02),
        "silent_after_s": (0.3, 0.101), "spread_sigmas": (2.0, 0.0, 20.0),
    },
    TaskParams: {
        "speed_m_s": (0.3, 1e-3, 5.0), "acceleration_m_s2": (1.0, 1e-3, 100.0), "restore_cycles": (20, 1, 10_000),
        "position_gain_1_s": (2.0, 0.0, 50.0),
        "off_path_m": (0.1, 1e-3, 10.0), "orientation": ("hold", "free"), "orientation_gain_1_s": (1.0, 0.0, 20.0),
        "damping_max": (0.1, 0.0, 10.0), "manipulability_threshold": (0.001, 1e-6, 10.0),
        "mid_joint_gain": (0.001, 1e-6, 1.0), "mid_joint_time_s": (5.0, 0.01, 1e3),
        "control_period_s": (0.01, 0.001), "position_margin_rad": (0.01, 0.0, 0.2),
    },
    SpeedReduction: {"d_max_m": (0.8, 1e-3, 5.0)},
    ApproachRestriction: {
        "rows": ("slack", "hard", "floor"), "v_max_m_s": (0.04, 1e-4, 2.0), "beta": (-10.0, -1e-3, -1e3),
        "d_repulse_m": (0.1, 1e-3, 1.0), "d_crit_m": (0.1, 1e-3), "d_notice_m": (0.6, 0.2, 5.0),
        "floor_m_s": (0.02, 0.0, 1.0), "slack_weight": (1000.0, 1e-2, 1e6),
    },
    WindowParams: {"samples": (5, 2, 30), "alpha": (0.1, 0.0, 1.0), "lambda_": (0.75, 0.0, 5.0)},
    MovingThresholds: {
        "f_base_n": (10.0, 4.1), "f_std_n": (3.0, 0.0), "sigma_max_n": (3.0, 1e-3), "f_d_n": (4.0, 0.0),
        "d_max_m": (0.8, 5.0), "d_min_m": (0.05, 0.0, 0.79), "compare": ("filtered", "raw"),
    },
    DecayingVelocity: {
        "compliance_m_s_n": (0.03, 1e-4, 1.0), "speed_max_m_s": (0.3, 0.01, 2.0), "decay_cycles": (20, 1, 200),
    },
    FailureParams: {
        "state_timeout_s": (0.05, 1.0), "overrun_s": (0.05, 0.5), "force_max_n": (1e5, 200.0),
        "force_timeout_s": (0.2, 0.05),
    },
}  # fmt: skip


# the same of what the paper has not: all of these are drawn for half of the worlds
OURS: dict[type, dict[str, tuple[object, ...]]] = {
    PerceptionParams: {
        "closing": (ClosingSpeed(), ClosingSpeed(0.01), ClosingSpeed(1.0), None),
        "reckon_below_minimum": (True, False), "place_at_stamp": (True, False),
    },
    TaskParams: {"mid_joint_projected": (True, False)},
    BrakingCurve: {
        "d_notice_m": (0.6, 0.2, 5.0), "slack_weight": (1000.0, 1e-2, 1e6),
        "deceleration_m_s2": (0.6, 0.01, 10.0), "latency_s": (0.06, 0.0, 1.0), "margin_m": (0.01, 0.0, 0.3),
        "touch_speed_max_m_s": (0.05, 1e-3, 1.0), "retreat_max_m_s": (0.1, 0.0, 1.0),
        "effective_mass": (
            EffectiveMass("chest"), EffectiveMass(), EffectiveMass(region_force_n=1.0),
            EffectiveMass("chest", region_force_n=1e3), None,
        ),
        "closing_deadband_m_s": (0.05, 0.0, None), "tangential": (Tangential(), None),
        "tighten_m_s2": (3.0, 0.1, 100.0), "loosen_m_s2": (1.0, 0.1, 100.0),
    },
    NullSpaceMotion: {"speed_m_s": (0.1, 2.0), "joint_rad_s": (0.5, 5.0), "rate_rad_s2": (1.0, 100.0)},
    WindowParams: {"freeze_while_reacting": (True, False)},
    SequentialTest: {
        "false_alarms_per_hour": (1.0, 3600.0),
        "proximity": (ProximityPriorParams(), ProximityPriorParams(gain=1e4), None),
        "learn": ("watched", "always", "never"), "memory_s": (300.0, 1.0), "tails": (30.0, 3.0), "suspect": (0.6, 1.0),
        "localise": (LocalisationParams(), None),
    },
    Admittance: {
        "speed_max_m_s": (0.3, 0.01, 2.0), "soft_hold": (True, False), "lag_s": (0.0167, 0.0, 0.2),
        "inertia_kg_m2": (1.5, 1e-3, 100.0), "damping_nm_s": (15.0, 0.1, 1e3), "dead_band_nm": (0.5, 0.0),
        "dead_band_fraction": (0.02, 0.0, 0.5), "static_friction_nm": (3.0, 0.0, 20.0),
        "start_energy_j": (0.2, 0.0, 50.0), "quiet_s": (0.05, 1.0), "patience_s": (0.1, 10.0),
    },
    ClampParams: {"torque_nm": (4.0, 0.1), "open_m_s": (0.1, 2.0), "open_s": (0.05, 0.5)},
    PinchParams: {"gap_m": (0.2, 5.0), "force_n": (10.0, 0.01)},
    GiveUpParams: {"contacts": (3, 1), "push_j": (0.3, 1e-3, 50.0), "retry_s": (0.3, 30.0)},
}  # fmt: skip
DETECTORS = (SequentialTest, SequentialTest, MovingThresholds)
NAMED = ("pretouch",)
NAMED_SHARE = 0.15
"""Share of profiles that are the named one as it is."""


@dataclass(frozen=True)
class World:
    """One arm's controller and the state the arm is in when it takes over."""

    model: RobotModel
    profile: Profile
    skin: Skin
    fixtures: Fixtures
    path: Path
    q: np.ndarray
    qd: np.ndarray
    lying: bool
    """Whether the arm's interface also gives finite numbers that are not true."""
    measured_off: float
    """Spread of the measured about the commanded joint positions [rad]."""


def any_world(rng: np.random.Generator, model: RobotModel) -> World:
    """Draw a world."""
    chosen = any_profile(rng)
    q, qd = any_start(rng, model, chosen.task.position_margin_rad)
    return World(
        model, chosen, any_skin(rng, model), any_fixtures(rng), any_path(rng, model, q), q, qd,
        lying=rng.random() < 0.15, measured_off=float(rng.choice([0.0, 1e-3, 0.03])),
    )  # fmt: skip


def any_profile(rng: np.random.Generator) -> Profile:
    """Draw each parameter, mostly the usual value in a third of the profiles; a few are named ones as they are."""
    usual = 0.85 if rng.random() < 1 / 3 else 0.4
    if rng.random() < NAMED_SHARE:
        named = profile(str(rng.choice(NAMED)))
        return replace(named, window=replace(named.window, samples=5))
    ours = rng.random() < 0.6
    groups = {f.name: f.type for f in fields(Profile) if f.type in CHOICES or (ours and f.type in OURS)}
    groups["perception"] = PerceptionParams
    choices = {group: CHOICES.get(group, {}) | (OURS.get(group, {}) if ours else {}) for group in groups.values()}
    drawn = {name: group(**_drawn(rng, choices[group], usual)) for name, group in groups.items()}
    detector = DETECTORS[int(rng.integers(len(DETECTORS)))] if ours else MovingThresholds
    drawn["detect"] = detector(**_drawn(rng, CHOICES.get(detector, {}) | OURS.get(detector, {}), usual))
    if rng.random() < 0.25 * (1 - usual):
        drawn["perception"] = None
    drawn |= {"slow": _one_of(rng, usual, SpeedReduction, None), "null_space": None}
    drawn["approach"] = _one_of(rng, usual, ApproachRestriction, ApproachRestriction, None)
    if ours:
        drawn["approach"] = _one_of(rng, usual, BrakingCurve, BrakingCurve, ApproachRestriction, None)
        drawn["null_space"] = _one_of(rng, usual, NullSpaceMotion, None)
    return Profile(**{**drawn, "name": "fuzzed", "react": any_reaction(rng, ours, usual)})


def any_reaction(rng: np.random.Generator, ours: bool, usual: float) -> Reaction:
    """Draw the paper's reaction, or an admittance that looks for clamps, for things caught, for places, or not."""
    if not ours or rng.random() < 0.2:
        return DecayingVelocity(**_drawn(rng, CHOICES[DecayingVelocity], usual))
    drawn = {kind: kind(**_drawn(rng, OURS[kind], usual)) for kind in (ClampParams, PinchParams, GiveUpParams)}
    clamp, pinch, give_up = (found if rng.random() < 0.8 else None for found in drawn.values())
    return Admittance(**_drawn(rng, OURS[Admittance], usual), clamp=clamp, pinch=pinch, give_up=give_up)


def _one_of(rng: np.random.Generator, usual: float, *kinds: type | None) -> object:
    """Draw a part, or none, and its parameters; the first kind mostly."""
    kind = kinds[0] if rng.random() < usual else kinds[rng.integers(len(kinds))]
    return None if kind is None else kind(**_drawn(rng, CHOICES.get(kind) or OURS[kind], usual))


def _drawn(rng: np.random.Generator, choices: dict[str, tuple[object, ...]], usual: float) -> dict[str, object]:
    return {name: v[0] if rng.random() < usual else v[rng.integers(len(v))] for name, v in choices.items()}


def any_skin(rng: np.random.Generator, model: RobotModel) -> Skin:
    """Draw the paper's skin where it fits, or 0, 1, 7 or 32 units on the surface of the arm.

    They look outwards, anywhere, or inwards: then a reading may put its point on the axis of the unit's own link. In
    half of these skins the places of the units are uncertain, slightly or as much as a skin may say.
    """
    if rng.random() < 0.3 and model.description.name == "panda":
        return paper_skin(model)
    count = int(rng.choice([0, 1, 7, 7, 32]))
    worst = np.array([(0.0, 0.0), (0.0, 0.0), (0.01, 0.05), (0.5, 1.5)])[rng.integers(4)]
    units = []
    for unit in spread(model, count, int(rng.integers(1 << 31))).units:
        T, (p, o) = unit.T_link_sensor.copy(), worst * rng.random(2)
        looks = {0: np.eye(3), 1: Rotation.random(rng=rng).as_matrix(), 2: np.diag([1.0, -1.0, -1.0])}
        T[:3, :3] = T[:3, :3] @ looks[int(rng.choice([0, 0, 1, 2]))]
        units.append(replace(unit, T_link_sensor=T, position_sigma=p, orientation_sigma=o))
    return Skin(units, model)


def any_fixtures(rng: np.random.Generator) -> Fixtures:
    """Draw nothing, a floor, or a floor, a wall, a pole and a ball, one of them where the arm is."""
    kind = rng.integers(3)
    if kind == 0:
        return no_fixtures()
    planes = np.array([[0.0, 0.0, 1.0, -0.2], [0.0, 1.0, 0.0, rng.uniform(-1.0, 0.5)]])[:kind]
    a = rng.uniform(-0.8, 0.8, (2, 3))
    b = a + np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 0.0]])
    pole_and_ball = Capsules(np.zeros(2, np.int64), a, b, np.array([0.03, 0.3]))
    return Fixtures(planes, pole_and_ball if kind == 2 else no_fixtures().capsules)


def any_start(rng: np.random.Generator, model: RobotModel, margin: float) -> tuple[np.ndarray, np.ndarray]:
    """Draw joint positions and velocities: ready, anywhere, at limits, beyond them, stretched, folded."""
    low, high = model.q_min + margin, model.q_max - margin
    q = model.description.q_ready.copy()
    kind = rng.integers(6)
    if kind == 1:
        q = rng.uniform(low, high)
    elif kind == 2:
        q = np.where(rng.random(7) < 0.5, low, high)
    elif kind == 3:
        j = rng.integers(7)
        q[j] = rng.choice([low[j] - rng.choice([1e-9, 0.05, 3.0]), high[j] + rng.choice([1e-9, 0.05, 3.0])])
    elif kind == 4:
        q = np.array([0.0, 0.0, 0.0, high[3], 0.0, 0.0, 0.0])
    elif kind == 5:
        q[3] = low[3]
    qd = model.description.qd_max * rng.uniform(-1.0, 1.0, 7) * rng.choice([0.0, 0.0, 0.3, 1.0, 1.6])
    return q, qd


def any_path(rng: np.random.Generator, model: RobotModel, q: np.ndarray) -> Path:
    """Draw a path: the paper's, at the hand, tiny, through many corners, far away, out of reach."""
    x = model.kinematics(q).position[model.ee]
    kind = rng.integers(7)
    if kind == 0:
        return Circle()
    if kind == 1:
        return Circle((x[0], x[1] - 0.25, x[2]))
    if kind == 2:
        return Circle(tuple(x), float(rng.choice([1e-6, 1e-4, 10.0])))
    if kind == 3:
        return WayPoints(x + rng.uniform(-0.4, 0.4, (int(rng.integers(2, 9)), 3)), closed=bool(rng.random() < 0.5))
    if kind == 4:
        return WayPoints(x + np.array([[0, 0, 0], [2e-6, 0, 0], [0, 2e-6, 0]]), closed=bool(rng.random() < 0.5))
    ends = rng.uniform(-1.0, 1.0, 3) * rng.choice([1.0, 3.0, 900.0])
    return segment(tuple(x), tuple(ends)) if kind == 5 else segment((0.0, 0.0, 0.3), tuple(ends + 2.0))
