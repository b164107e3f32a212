"""What must hold after each control step, whatever went in. Each check recomputes what it compares with."""

import math
from dataclasses import fields, is_dataclass, replace
from functools import cache

import numpy as np

from pretouch.contact.admittance import Admittance
from pretouch.contact.moving_thresholds import MovingThresholds
from pretouch.contact.reaction import Reaction
from pretouch.contact.sequential_test import SequentialTest
from pretouch.control.approach import ApproachRestriction, BrakingCurve, notice_m
from pretouch.modes import Event, ModeState
from pretouch.params import ClampParams
from pretouch.profiles import Profile
from pretouch.records import Flat
from pretouch.robot.description import SpeedEnvelope
from pretouch.robot.model import RobotModel
from pretouch.types import SEEN_NOW_S, ControlStep, Mode, QpOutcome, RobotState, Thresholds, Touched
from tests.reference.modes import FAULTS
from tests.reference.motion import limit as eq_7

LATCHING = {Event.UNUSABLE, Event.TIME_BACKWARDS, Event.STATE_STALE, Event.SOLVER_FAILED, Event.CLAMPED}
SOFT = {Event.SKIN_SILENT, Event.NO_FORCE, Event.GIVEN_UP, Event.PRESSED, Event.CLAMPED}
MAY_BE_NAN = {"range_distance", "force"}


@cache
def _names(kind: type) -> tuple[str, ...]:
    if kind is Flat:
        return ("blocks",)
    return tuple(f.name for f in fields(kind)) if is_dataclass(kind) else getattr(kind, "_fields", ())


def arrays_of(value: object) -> list[tuple[str, np.ndarray]]:
    """All arrays within a value, with their names."""
    found: list[tuple[str, np.ndarray]] = []
    for part in _names(type(value)):
        inner = getattr(value, part)
        if isinstance(inner, np.ndarray):
            found.append((part, inner))
        elif _names(type(inner)):
            found += arrays_of(inner)
    return found


def same(a: object, b: object) -> bool:
    """Whether two values agree to the last bit, NaN with NaN."""
    if isinstance(a, np.ndarray):
        return isinstance(b, np.ndarray) and a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()
    if _names(type(a)):
        return type(a) is type(b) and all(same(getattr(a, name), getattr(b, name)) for name in _names(type(a)))
    if isinstance(a, tuple):
        return isinstance(b, tuple) and len(a) == len(b) and all(map(same, a, b))
    if isinstance(a, float):
        return isinstance(b, float) and (a == b or (math.isnan(a) and math.isnan(b)))
    return bool(a == b)


def check_shapes(step: ControlStep, n: int, units: int) -> None:
    """Every array has the shape and type its docstring says."""
    k, rows = len(step.obstacles.unit), len(step.restricted)
    shapes = {
        **dict.fromkeys(("q", "q_commanded", "command", "qd", "residual"), (n,)), "range_distance": (units,),
        "restricted": (rows,), "approach_limit": (rows,), "slack": (rows,), "multipliers": (n + rows,),
        **dict.fromkeys(("unit", "link", "ee_distance", "body_distance", "closing_speed", "slot", "age"), (k,)),
        **dict.fromkeys(("point", "body_point", "direction"), (k, 3)),
    }  # fmt: skip
    check_touched(step.touched)
    for name, array in arrays_of(replace(step, touched=None)):
        whole, logical = name in ("unit", "link", "slot", "restricted"), name == "axes"
        assert array.dtype == (np.int64 if whole else np.bool_ if logical else np.float64), name
        assert array.shape == shapes.get(name, (3,)), name


def check_touched(touched: Touched) -> None:
    """One contact, finite, with a probability; or none."""
    count = len(touched.link)
    assert count <= 1
    assert touched.link.dtype == np.int64
    assert touched.point.shape == touched.force.shape == (count, 3)
    assert touched.link.shape == touched.sigma.shape == touched.probability.shape == (count,)
    assert all(np.isfinite(array).all() for _, array in arrays_of(touched))
    assert (touched.sigma >= 0.0).all()
    assert ((touched.probability > 0.0) & (touched.probability <= 1.0 + 1e-9)).all()


def check_finite(step: ControlStep, believed: RobotState, p: Profile) -> None:
    """Every number is finite but for what is documented to be NaN."""
    unknown = MAY_BE_NAN if np.isfinite(step.residual).any() else MAY_BE_NAN | {"residual", *Thresholds._fields}
    unknown = unknown if isinstance(p.detect, MovingThresholds | SequentialTest) else unknown | {*Thresholds._fields}
    numbers = [array.ravel() for name, array in arrays_of(step) if name not in unknown]
    assert np.isfinite(np.concatenate(numbers)).all()
    wrench = believed.wrench
    assert np.isnan(step.force).all() if wrench is None else np.array_equal(step.force, wrench[:3])
    assert math.isfinite(step.stamp)
    assert math.isfinite(step.path_phase)
    assert 0.0 <= step.speed_scale <= 1.0


def check_speed_scale(step: ControlStep, p: Profile) -> None:
    """Eq. 3 bounds the factor, whatever came before, and the factor bounds the speed along the path."""
    if step.mode is Mode.TRACK:
        assert np.linalg.norm(step.desired_velocity) <= step.speed_scale * p.task.speed_m_s * (1 + 1e-9) + 1e-12
    if p.slow is not None and len(step.obstacles.unit):
        assert step.speed_scale <= step.obstacles.ee_distance.min() / p.slow.d_max_m + 1e-12


def end_of_braking(speed: np.ndarray, reach: np.ndarray, period: float) -> np.ndarray:
    """How far joints still travel [rad] that move at `speed` [rad/s] and lose `reach` [rad/s] each period from now."""
    speed = np.minimum(np.maximum(speed, 0.0), 1e6)  # far beyond any limit, and its square is finite
    steps = np.floor(speed / reach)
    return np.asarray(period * (steps * speed - reach * steps * (steps + 1) / 2))


def check_command(step: ControlStep, believed: RobotState, p: Profile, model: RobotModel) -> None:
    """Acceleration within limits; position and velocity too, or as hard as possible on the way back to them."""
    dt, arm, margin = p.task.control_period_s, model.description, p.task.position_margin_rad
    c, reach, last = step.command, arm.qdd_max * dt, believed.qd_commanded
    assert np.isfinite(c).all()
    rounding = 1e-9 + 1e-15 * np.abs(last)
    assert (np.abs(c - last) <= reach + rounding).all(), ("acceleration", np.abs(c - last) / reach)
    q = believed.q_commanded + c * dt
    speed, place = np.stack((c, -c)), np.stack((q, -q))  # towards the upper and the lower side
    braking = speed <= np.stack((believed.qd_commanded, -last)) - reach + rounding
    assert (braking | (speed <= arm.qd_max + 1e-9)).all(), "velocity"
    done = braking | (speed <= 1e-12)
    if done.all():
        return
    room = np.stack((model.q_max, -model.q_min)) - margin - place
    assert (done | (end_of_braking(speed, reach, dt) <= room + 1e-9)).all(), "position"
    envelope = envelope_within(model, margin)
    if envelope is not None:
        assert (done | below_envelope(speed, place, reach, dt, envelope)).all(), "envelope"


@cache
def envelope_within(model: RobotModel, margin: float) -> SpeedEnvelope | None:
    """Return an arm's envelope moved inwards by a margin [rad], made once for each."""
    envelope = model.description.envelope
    return None if envelope is None else envelope.moved_in(margin)


def below_envelope(
    speed: np.ndarray, q: np.ndarray, reach: np.ndarray, period: float, envelope: SpeedEnvelope
) -> np.ndarray:
    """Whether joints that are at q with `speed`, and brake from now on, stay below the envelope.

    Speeds and positions (2, n) are counted towards the upper and the lower side, at the end of each period.
    """
    speed = np.minimum(np.maximum(speed, 0.0), 10.0)
    k = np.arange(1 + int((speed / reach).max()))[:, None, None]
    speeds = np.maximum(speed - k * reach, 0.0)
    places = q - speed * period + np.cumsum(speeds, axis=0) * period
    end = np.stack((envelope.q_upper, -envelope.q_lower))
    most = np.sqrt(np.maximum(envelope.slope * (end - places), 0.0)) - envelope.offset
    return np.asarray((speeds <= np.maximum(most, 0.0) + 1e-7).all(axis=0))


def check_braking(step: ControlStep, believed: RobotState, p: Profile, model: RobotModel) -> None:
    """Where no motion was asked for, no joint speeds up or turns round, and one of them brakes as hard as it may."""
    if step.qp.outcome is QpOutcome.SOLVED:
        return
    last = believed.qd_commanded
    rounding = 1e-9 + 1e-15 * np.abs(last)
    assert (step.command * np.sign(last) >= -rounding).all()
    assert (np.abs(step.command) <= np.abs(last) + rounding).all()
    full = np.abs(step.command - last) >= model.description.qdd_max * p.task.control_period_s - 2 * rounding
    assert full.any() or not step.command.any()


def check_rows(step: ControlStep, p: Profile, model: RobotModel) -> None:
    """Approach velocities by finite differences: no faster than eq. 7 allows and the reported slack."""
    o, which = step.obstacles, step.restricted
    if p.approach is not None and not isinstance(p.approach, ApproachRestriction | BrakingCurve):
        return  # the rows of a restriction of others are for them to say
    notice = o.body_distance < notice_m(p.approach)
    if step.mode is not Mode.TRACK and len(which) != notice.sum():
        notice &= o.age < SEEN_NOW_S  # while a contact moves the arm, only what is seen now counts
    assert np.array_equal(which, np.flatnonzero(notice & (p.approach is not None)))
    if not len(which) or np.abs(step.q).max() > 100.0 or np.abs(step.command).max() > 1e3:
        return  # answers to lies, beyond what differences resolve
    if isinstance(p.approach, ApproachRestriction):
        limit = [eq_7(d, p.approach) for d in o.body_distance[which].tolist()]
        assert (np.abs(step.approach_limit - limit) <= 1e-9 * p.approach.v_max_m_s).all()
    excess = approach_velocity(step, model) - step.approach_limit
    size = 1e-7 * (1.0 + np.abs(step.command).max())
    assert (step.qp.slack >= 0.0).all()
    assert (np.abs(step.qp.slack - np.maximum(excess, 0.0)) <= size).all(), (step.qp.slack, excess)
    if getattr(p.approach, "rows", "") == "hard" and step.qp.outcome is QpOutcome.SOLVED:
        assert step.qp.slack.max() <= 1e-7


def approach_velocity(step: ControlStep, model: RobotModel) -> np.ndarray:
    """Velocity of the restricted body points towards their obstacles [m/s], by central differences of the posture."""
    o, which = step.obstacles, step.restricted
    link, point, direction = o.link[which], o.body_point[which], o.direction[which]
    h = 1e-5 / max(1.0, float(np.abs(step.command).max()))
    here = model.kinematics(step.q)
    local = np.einsum("kji,kj->ki", here.rotation[link], point - here.position[link])
    ends = [model.kinematics(step.q + s * h * step.command) for s in (1.0, -1.0)]
    ahead, behind = (k.position[link] + np.einsum("kij,kj->ki", k.rotation[link], local) for k in ends)
    return np.asarray(((ahead - behind) * direction).sum(axis=1) / (2.0 * h))


def check_obstacles(step: ControlStep, units: int) -> None:
    """One obstacle a slot at most, seen by a unit or an outside source, each with a unit vector."""
    o = step.obstacles
    assert len(set(o.slot.tolist())) == len(o.slot)
    assert ((o.unit >= 0) & (o.unit <= units)).all()
    assert (np.abs((o.direction**2).sum(axis=1) - 1.0) <= 1e-9).all()


def check_mode(step: ControlStep, before: ModeState, wrong: dict[Event, str], resume: bool, p: Profile) -> None:
    """Nothing moves on inputs that speak against it, a hold that latched lasts, and a contact alone begins a reaction.

    `wrong` is what the plain controller finds of the inputs. That of all that is seen the right event decides, and its
    sentence, is shown by `tests/test_modes.py`; which units are silent and what is a contact, by the plain controller.
    """
    fault = next((event for event in FAULTS if event in wrong), None)
    assert step.reason
    assert step.latched == (step.event in LATCHING)
    if fault:
        assert step.event is fault
    elif before.latched and not resume:
        assert (step.mode, step.latched, step.reason) == (Mode.HOLD, True, before.reason)
    assert step.event is not Event.OVERRUN or Event.OVERRUN in wrong
    if step.mode is Mode.TRACK:
        assert step.armed
        assert Event.OVERRUN not in wrong
        assert np.isfinite(step.residual).all() if p.detect.by_torques else Event.NO_FORCE not in wrong
    if step.contact is not None:
        assert step.mode is Mode.REACT or step.event is Event.SOLVER_FAILED
    elif step.mode is Mode.REACT:
        assert before.mode is Mode.REACT
    check_motion(step, p.react)


def check_motion(step: ControlStep, react: Reaction) -> None:
    """A hold asks for no motion, but for yielding where that is soft; a reaction is no faster than it may be."""
    skips = step.mode is Mode.HOLD and step.event not in (Event.SOLVER_FAILED, Event.BLOCKED)
    soft = skips and isinstance(react, Admittance) and react.soft_hold and step.event in SOFT
    assert soft or (step.qp.outcome is QpOutcome.SKIPPED) == skips
    if step.mode is Mode.HOLD:
        assert not step.desired_velocity.any()
    if step.mode is not Mode.REACT:
        assert not step.reaction_velocity.any()
    most = react.speed_max_m_s
    if isinstance(react, Admittance):
        most = 1.05 * max(most, (react.clamp or ClampParams()).open_m_s)
    assert np.linalg.norm(step.reaction_velocity) <= most + 1e-12
