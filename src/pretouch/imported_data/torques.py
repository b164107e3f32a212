"""Joint torques of any arm: read, checked, and brought to external torques on the robot."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import scipy  # its parts load when they are first used: a quarter of a second that a help does not wait

from pretouch.errors import RecordingError
from pretouch.imported_data.log import TORQUES, Choice, ImportedRecording, Log, Note, check_reach, gaps, listed, pieces
from pretouch.importing.mounting import (
    LEAN_DEG,
    direction_text,
    fitted_gravity,
    fitted_load,
    lean_of,
    squares_left,
    weights_of,
)
from pretouch.params import SequentialParams
from pretouch.robot.description import STANDING
from pretouch.robot.model import RobotModel
from pretouch.sim.observer import observe, observer_init
from pretouch.types import FloatArray
from pretouch.values import value

_MOVING_RAD_S = 0.01
"""Speed of a joint, root mean square, from which its velocity tells something [rad/s]."""
_ALIKE, _UNLIKE = 0.9, 0.5
"""Correlation from which on, and below which, two velocities are taken to be the same, or not."""
_FAR_BETTER = 0.25
"""Part of the squared error that another explanation may leave to be believed [1]."""
_LITTLE, _MOST = 0.1, 0.5
"""Parts of the squared torques up to which an explanation leaves little, and from which on most [1]: a Panda's model
leaves 1 to 9 % beside a tool of 3 kg that it lacks."""
_LIGHT, _HEAVY = 0.5, 1.5
"""Sizes of an estimated acceleration by gravity between which it is one, as a part of the true one [1]."""
_SAMPLES = 400
"""How many samples are looked at."""
_THOUSAND = (300.0, 3000.0)
_LEAST_HZ = 40.0
"""Rate below which nothing is detected [Hz]."""
_OVER_S = 0.04
"""Time over which velocities are averaged, half of it before and half after [s]."""
_SETTLED = 5.0
"""Time constants after which the observer has forgotten how it began [1]."""


@value
class TorqueRecording(ImportedRecording):
    """An arm's motion and the external torques on it. N samples of n joints; NaN where there is no torque."""

    kind: str
    """Source of the external torques: one of `TORQUES`."""
    sources: tuple[str, str]
    """Topics or first columns of the torques and of the positions."""
    q: FloatArray
    """(N, n) [rad]."""
    qd: FloatArray
    """(N, n) [rad/s]."""
    qd_commanded: FloatArray
    """(N, n) [rad/s]; where the recording has none, the measured ones smoothed."""
    tau_ext: FloatArray
    """(N, n) on the robot by its environment [Nm]."""


def torque_recording(log: Log, choice: Choice) -> TorqueRecording:
    """Check a log against its arm's model, and make external torques on the robot of it.

    RecordingError for what cannot be used, with the way out.
    """
    model, kind = log.model, next(kind for kind in TORQUES if kind in log.arrays)
    _check_options(log.place, kind, model.n, choice)
    log = log.in_order(*log.arrays)
    time = (log.time - log.time[0]) / 1e9
    _check_rate(log.place, time)
    notes = [*log.notes, *gaps(time)]
    q = log.arrays["q"]
    check_reach(log.place, q, model)
    derived = velocities(time, q)
    qd = log.arrays.get("dq", derived)
    notes += _check_velocities(log.place, derived, qd) if "dq" in log.arrays else [Note("derived_velocities", {})]
    by_robot = choice.sign == "by-robot" or (choice.sign == "auto" and log.by_robot)
    torque = (-1.0 if by_robot else 1.0) * log.arrays[kind] * (np.array(choice.gains) if kind == "current" else 1.0)
    expected = _expected(model, time, q, qd, choice.payload)
    _check_units(log.place, torque, expected, model, kind != "tau_ext")
    model, mounting = _mounted(log.place, (q, qd, torque), expected, model, kind, choice)
    if kind != "tau_ext":
        expected = _expected(model, time, q, qd, choice.payload)
        notes += [*mounting, *_check_signs(log.place, qd, torque, expected, model, by_robot)]
        torque = observed(model, time, q, qd, torque, SequentialParams().observer_gain_1_s, choice.payload)
    if "dq_d" not in log.arrays:
        notes.append(Note("no_commands", {}))
    commanded = log.arrays.get("dq_d", smoothed(time, qd))
    sources, first = (log.sources[kind], log.sources["q"]), log.time[0] / 1e9
    return TorqueRecording(
        log.place, model, by_robot, first, time, tuple(notes), kind, sources, q, qd, commanded, torque
    )


def _check_options(place: Path, kind: str, n: int, choice: Choice) -> None:
    if kind == "current" and len(choice.gains) != n:
        raise RecordingError(
            f"{place} has currents of {n} motors and {len(choice.gains)} gains: give --gains, {n} torques by current in"
            " Nm/A, separated by commas."
        )
    if choice.gains and kind != "current":
        raise RecordingError(f"{place} has torques, and --gains is for motor currents (current1_A ...): leave it out.")
    if choice.payload and kind == "tau_ext":
        raise RecordingError(f"{place} has external torques, which --payload does not change: tell the robot its load.")


def _check_velocities(place: Path, true: FloatArray, qd: FloatArray) -> tuple[Note, ...]:
    """Hold velocities (N, n) [rad/s] against those of the positions; RecordingError for another unit or sign."""
    moving = np.flatnonzero(np.sqrt((true**2).mean(axis=0)) > _MOVING_RAD_S)
    if not len(moving):
        return (Note("no_motion", {}),)
    true, qd = true[:, moving], qd[:, moving]
    size, product = (true**2).sum(axis=0), (qd * true).sum(axis=0)
    alike = product / np.maximum(np.sqrt((qd**2).sum(axis=0) * size), 1e-12)
    if (alike < -_ALIKE).all():
        raise RecordingError(f"The velocities in {place} are those of its positions with the other sign: reverse them.")
    slope = float(np.median(product / size))
    if (alike > _UNLIKE).all() and 40.0 < slope < 80.0:
        raise RecordingError(
            f"The velocities in {place} are {slope:.3g} times those of its positions, so they are in degrees: name the"
            " columns dq1_deg_s and so on."
        )
    if not (alike > _UNLIKE).all() or not 0.5 < slope < 2.0:
        return (Note("velocities", {"ratio": slope, "correlation": float(alike.min())}),)
    return ()


def _some(values: FloatArray) -> FloatArray:
    """Return `_SAMPLES` of N samples, or all if there are fewer."""
    return values[np.unique(np.linspace(0, len(values) - 1, _SAMPLES).astype(np.int64))]


def _expected(model: RobotModel, time: FloatArray, q: FloatArray, qd: FloatArray, payload: float) -> FloatArray:
    """Torques (S, n) [Nm] that move an arm with a load [kg] as recorded, for some of the samples (N, n)."""
    growth, torques = _some(velocities(time, smoothed(time, qd))), []
    for p, v, a in zip(_some(q), _some(qd), growth, strict=True):
        mass, bias, _ = _loaded(model, p, v, payload, None, 1.0)
        torques.append(mass @ a + bias)
    return np.array(torques)


def _check_units(place: Path, tau: FloatArray, expected: FloatArray, model: RobotModel, measured: bool) -> None:
    """Hold torques (N, n) [Nm], measured or else external ones, against those expected (S, n) [Nm].

    RecordingError for another unit, and for external torques with gravity in them.
    """
    tau = _some(tau)
    times = float(np.median(np.abs(tau).max(axis=1)) / max(np.median(np.abs(expected).max(axis=1)), 1e-9))
    largest = float(np.median((np.abs(tau) / model.description.tau_max).max(axis=1)))
    if largest > 2.0 and _THOUSAND[0] < (times if measured else 1000.0) < _THOUSAND[1]:
        raise RecordingError(
            f"The torques in {place} are {largest:.3g} times the largest that {model.description.name} can give: in"
            " mNm, name the columns tau1_mNm or tau_ext1_mNm and so on."
        )
    same, other = (float(((tau - sign * expected) ** 2).sum()) for sign in (1.0, -1.0))
    if not measured and min(same, other) < _LITTLE * float((tau**2).sum()):
        raise RecordingError(
            f"The external torques in {place} are {'' if same < other else 'minus '}those that hold the arm: gravity is"
            " still in them, so name the columns tau1_Nm and so on for our own observer."
        )


def _check_signs(
    place: Path, qd: FloatArray, tau: FloatArray, expected: FloatArray, model: RobotModel, by_robot: bool
) -> list[Note]:
    """Find the sign of each joint's measured torques (N, n) [Nm] with which model and friction explain them.

    `expected` (S, n) are the model's, `by_robot` tells that all are turned round already. RecordingError for reversed
    joints, and for torques turned round that stay unexplained; notes for others that do, and for unsure joints.
    """
    qd, tau = _some(qd), _some(tau)
    same, other = (squares_left(s * tau - expected, qd) for s in (1.0, -1.0))
    whole = (tau**2).sum(axis=0)
    wrong = (other < _FAR_BETTER * same) & (other < _MOST * whole)
    right = (same < _FAR_BETTER * other) & (same < _MOST * whole)
    rest, arm = float(np.where(wrong, other, same).sum() / max(whole.sum(), 1e-12)), model.description.name
    if wrong.any() and rest < _MOST:
        one, others = (listed([model.joints[j] for j in np.flatnonzero(which)]) for which in (wrong, right))
        way = f"but not at {others}: turn the first round, currents by a minus in --gains"
        way = way if right.any() else f"so give --sign {'on' if by_robot else 'by'}-robot"
        raise RecordingError(f"The torques in {place} are minus the model's at {one}, {way}, or check its mounting.")
    if by_robot and rest >= _MOST:
        raise RecordingError(
            f"With --sign by-robot the model of {arm} leaves {rest:.0%} of the torques in {place} unexplained: leave it"
            " out, and check --arm, --payload and how the arm is mounted."
        )
    unexplained = [Note("unexplained", {"share": rest, "arm": arm})] if rest >= _MOST else []
    unsure = [model.joints[j] for j in np.flatnonzero(~right)]
    return [*unexplained, *([Note("unsure_signs", {"names": listed(unsure)})] if unsure else [])]


def _mounted(
    place: Path, motion: tuple[FloatArray, ...], expected: FloatArray, model: RobotModel, kind: str, choice: Choice
) -> tuple[RobotModel, list[Note]]:
    """Return the arm with the direction of gravity that measured torques have, and a note where it is another one.

    `motion` has positions, velocities and torques (N, n), `expected` (S, n) is by the description. A load that it lacks
    is a note, if it leaves less than another mounting. Of other explanations one must leave far less than the rest.
    RecordingError for others than gravity, for two that are alike, for a direction given otherwise, and if external.
    """
    q, speed, tau = map(_some, motion)
    J = np.array([model.ee_jacobian(model.kinematics(p))[:3].T for p in q])
    weights = np.array([weights_of(model, p) for p in q]) - choice.payload * J
    weight, external = weights @ model.gravity, "external " if kind == "tau_ext" else ""
    # an interface takes for external the torque of the gravity that it knows less that of the true one
    hold = weight - tau if external else tau - expected + weight
    same, whole, free, heavy = (float(squares_left(x, speed).sum()) for x in (hold - weight, tau, hold, weight))
    gravity, size, left = fitted_gravity(hold, weights, speed)
    down, lean = direction_text(gravity), lean_of(model, gravity)
    if not external and free < _LITTLE * heavy and size < _LIGHT and left > _MOST * free:
        raise RecordingError(
            f"The torques in {place} have no gravity in them, so they are external or commanded ones (tau_J_d): name"
            " external torques tau_ext1_Nm and so on, or give those that were measured."
        )
    kg, carried = fitted_load(hold - weight, -J @ model.gravity, speed)
    if not external and carried < min(_LITTLE * whole, _FAR_BETTER * same, left):
        return model, [Note("load", {"kg": choice.payload + kg, "share": carried / whole, "before": same / whole})]
    rival = min(same, carried, left if lean < LEAN_DEG and _LIGHT < size < _HEAVY else same)
    explanations = list[tuple[float, str, str]]()
    if lean > LEAN_DEG and _LIGHT < size < _HEAVY:
        tell = "tell the robot, or name measured torques tau1_Nm and so on, with" if external else "give"
        along = (
            f"those of an arm whose gravity points along {down} in its base frame, not {direction_text(model.gravity)}"
        )
        explanations.append((left, along, f"{tell} --gravity {down}"))
    if not external:
        other, size, rest = fitted_gravity(weight - tau - expected, weights, speed)
        if rest < _FAR_BETTER * left and lean_of(model, other) < LEAN_DEG:
            return model, []  # of the other sign, and nothing else: `_check_signs` names it
        turned = f"minus those of an arm whose gravity points along {direction_text(other)}"
        rest = rest if _LIGHT < size < _HEAVY else np.inf
        explanations.append((rest, turned, f"give the other --sign and --gravity {direction_text(other)}"))
        scale = (tau * expected).sum(axis=0) / np.maximum((expected**2).sum(axis=0), 1e-12)
        # where gravity does little, friction hides the scale, and none is needed
        scale *= scale**2 * (expected**2).sum(axis=0) > _LITTLE * (tau**2).sum(axis=0)
        times = f"the model's times {', '.join(f'{x:.2g}' for x in scale)}, joint by joint, as motor currents are"
        rest = float(squares_left(tau - scale * expected, speed).sum()) if (scale >= 0.0).all() else np.inf
        explanations.append((rest, times, "name the columns current1_A and so on, and give --gains"))
    good = sorted(e for e in explanations if e[0] < min(_LITTLE * whole, _FAR_BETTER * rival))
    good = good[: 1 if len(good) < 2 or good[0][0] < _FAR_BETTER * good[1][0] else 2]
    if not good:
        return model, []
    own = bool(choice.gravity) or not np.array_equal(model.description.gravity, STANDING)
    if len(good) > 1 or external or own or good[0][0] != left:
        what, way = (" or ".join(str(e[i]) for e in good) for i in (1, 2))
        raise RecordingError(f"The {external}torques in {place} are {what}: {way}.")
    model = RobotModel(replace(model.description, gravity=np.array([float(x) for x in down.split(",")])))
    return model, [Note("mounting", {"degrees": lean, "share": left / whole, "before": same / whole, "gravity": down})]


def _check_rate(place: Path, time: FloatArray) -> None:
    """Refuse instants (N,) [s] that come too slowly."""
    rate = 1.0 / float(np.median(np.diff(time)))
    if rate < _LEAST_HZ:
        raise RecordingError(
            f"The samples of {place} come at {rate:.3g} Hz: record at {_LEAST_HZ:g} Hz or more, or check the unit of"
            " the time."
        )


def velocities(time: FloatArray, q: FloatArray) -> FloatArray:
    """Velocities (N, n) [rad/s] of positions (N, n) [rad] at instants (N,) [s], smoothed."""
    slopes = np.zeros_like(q)
    for piece in pieces(time):
        if piece.stop - piece.start > 1:
            slopes[piece] = np.gradient(q[piece], time[piece], axis=0)
    return smoothed(time, slopes)


def smoothed(time: FloatArray, values: FloatArray) -> FloatArray:
    """Means of values (N, n) over `_OVER_S` about each instant, without delay."""
    means = values.copy()
    for piece in pieces(time):
        count = piece.stop - piece.start
        size = min(max(1, round(_OVER_S * (count - 1) / max(time[piece.stop - 1] - time[piece.start], 1e-9))), count)
        for _ in range(2):  # twice: a triangle, whose derivative does not jump
            means[piece] = scipy.ndimage.uniform_filter1d(means[piece], size, axis=0, mode="nearest")
    return means


def observed(
    model: RobotModel, time: FloatArray, q: FloatArray, qd: FloatArray, tau: FloatArray, gain: float, payload: float
) -> FloatArray:
    """External torques (N, n) on the robot [Nm] by our momentum observer, NaN after each gap until it has settled.

    `time` (N,) [s], `q` (N, n) [rad], `qd` (N, n) [rad/s]; `tau` (N, n) [Nm] drive the joints and contain gravity;
    `gain` is the observer's [1/s], `payload` the mass at the end-effector [kg].
    """
    external = np.full_like(tau, np.nan)
    for piece in pieces(time):
        mass, bias, J = _loaded(model, q[piece.start], qd[piece.start], payload, None, 1.0)
        state = observer_init(mass, qd[piece.start])
        for i in range(piece.start + 1, piece.stop):
            dt = time[i] - time[i - 1]
            mass, bias, J = _loaded(model, q[i], qd[i], payload, J, dt)
            state = observe(state, mass, bias, qd[i], tau[i], gain, dt)
            if time[i] - time[piece.start] > _SETTLED / gain:
                external[i] = state.residual
    return external


def _loaded(
    model: RobotModel, q: FloatArray, qd: FloatArray, payload: float, before: FloatArray | None, dt: float
) -> tuple[FloatArray, FloatArray, FloatArray | None]:
    """Mass matrix and bias of an arm with a load, and the Jacobian (3, n) of the load, from that `dt` earlier."""
    mass, bias = model.mass_matrix_and_bias(q, qd, np.empty(model.n))
    if not payload:
        return mass, bias, None
    J = model.ee_jacobian(model.kinematics(q))[:3]
    turning = np.zeros(3) if before is None else (J - before) @ qd / dt
    return mass + payload * J.T @ J, bias + payload * J.T @ (turning - model.gravity), J
