"""Conditions for moving an arm: it stands, nothing touches it, its units are well, it is where its path begins."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from pretouch.contact.moving_thresholds import MovingThresholds
from pretouch.controller import Controller
from pretouch.errors import RobotError
from pretouch.importing.mounting import lean_of, weights_of
from pretouch.ports import Arm, Clock, Robot, SkinPort
from pretouch.sound import sound_robot
from pretouch.types import FloatArray, RobotState
from pretouch.units.findings import Finding
from pretouch.units.skin import NetworkSkin
from pretouch.units.watch import ModelCheck, UnitWatch

# Figures without a source are ours.
WATCH_S = 3.0
"""Time for which an arm is watched while it stands [s]."""
MEAN_S = 0.1
"""Time over which a force is averaged before it is judged [s]: one sample of a Panda's is off by up to 6 N."""
DRIFT_RAD = 0.005
"""Largest motion of a joint during the checks [rad]."""
NEAR_LIMIT_RAD = 0.1
"""Distance to a joint's limit below which it is mentioned [rad]."""
LEAST_ROOM_RAD = 0.004
"""Distance to a joint's limit below which the arm is refused [rad]: a Franka arm's set-points are followed up to
0.003 rad before it (`LimiterParams.position_margin_rad`), and the rest is rounding. An arm between here and the
profile's margin, where a run may end, is moved away from the limit alone."""
BIAS_SHARE = 0.5
"""Largest mean force at rest, as a share of the base threshold F_b: 5 N of Table I's 10. Real Pandas have 0.4 to 1.7 N
an axis with nothing attached (franka_ros, issue 404)."""
DISTURBANCE_SHARE = 0.5
"""Largest deviation from that mean, averaged over `MEAN_S`, as a share of F_b: more, and somebody touches the arm."""
MISSING_SHARE = 0.1
"""Largest share of states without a force estimate."""
MOUNTING_DEG, MOUNTING_SHARE = 10.0, 0.2
"""Angle of gravity from which an arm is mounted otherwise [degrees]: a tool of 3 kg that nobody told leans it by 6; and
share of the torques at rest that this may leave."""
FLOOR_CLEARANCE_M = 0.05
"""Distance that the path keeps from what is below the arm [m]."""
_NEAR_SHARE = 0.5
"""Share of the distance from which the arm no longer advances along its path, up to which it may begin off it."""
_ENOUGH = 0.5
"""Share of the usual number of states that a mean needs."""
_PLACES = 200
"""Places of the path whose height is looked at."""
_LOOK_S = 0.1
"""Time between two looks at the units [s]."""


@dataclass(frozen=True, eq=False)
class Standstill:
    """S states of an arm of n joints that stands, in order."""

    stamp: FloatArray
    """(S,) [s]."""
    q: FloatArray
    """(S, n) joint positions [rad]."""
    tau_ext: FloatArray
    """(S, n) estimated external torques [Nm]."""
    wrench: FloatArray
    """(S, 6) estimated external force [N] and torque [Nm], NaN where there was no estimate."""
    newest: RobotState

    @property
    def rest_wrench(self) -> FloatArray:
        """Mean wrench (6,), NaN without any estimate."""
        return _mean(self.wrench)

    @property
    def rest_torque(self) -> FloatArray:
        """Mean external torques (n,) [Nm]."""
        return _mean(self.tau_ext)

    @property
    def noise(self) -> FloatArray:
        """Standard deviation of each force component (3,) [N]."""
        force = self.wrench[np.isfinite(self.wrench).all(axis=1), :3]
        return np.array(force.std(axis=0)) if len(force) else np.full(3, np.nan)

    @property
    def missing_share(self) -> float:
        """Share of the states without a force estimate."""
        return float(np.mean(~np.isfinite(self.wrench).all(axis=1)))

    @property
    def disturbance(self) -> float:
        """Largest deviation of the force from its mean, averaged over `MEAN_S` [N].

        A span with fewer than half as many states as is usual is left out: its mean is that of the noise.
        """
        valid = np.isfinite(self.wrench).all(axis=1)
        away = self.wrench[valid, :3] - self.rest_wrench[:3]
        span = np.floor((self.stamp[valid] - self.stamp[0]) / MEAN_S)
        spans, counts = np.unique(span, return_counts=True)
        enough = spans[counts >= _ENOUGH * np.median(counts)] if len(spans) else spans
        means = [away[span == one].mean(axis=0) for one in enough]
        return max((float(np.linalg.norm(mean)) for mean in means), default=0.0)


def _mean(values: FloatArray) -> FloatArray:
    valid = values[np.isfinite(values).all(axis=1)]
    return np.array(valid.mean(axis=0)) if len(valid) else np.full(values.shape[1], np.nan)


def new_states(robot: Robot, clock: Clock, qd_max: FloatArray, seconds: float) -> Iterator[RobotState | None]:
    """Yield an arm's state at each tick for some seconds, None where it is no newer one.

    A state that cannot be used, by joint velocity limits (n,) [rad/s] too, is a RobotError.
    """
    begin = now = clock.tick()
    last = -np.inf
    while now - begin < seconds:
        state, wrong = sound_robot(robot.read(), qd_max)
        if state is None:
            raise RobotError(f"The robot's state cannot be used ({wrong}): check the connection to the arm.")
        yield state if state.stamp > last else None
        last, now = max(last, state.stamp), clock.tick()


def watch(
    robot: Robot, clock: Clock, qd_max: FloatArray, seconds: float, on_tick: Callable[[], object] = lambda: None
) -> Standstill:
    """Watch an arm for some seconds.

    Args:
        robot: it is only read.
        clock: gives the ticks at which it is read.
        qd_max: (n,) joint velocity limits [rad/s].
        seconds: how long.
        on_tick: called after each reading.

    Raises RobotError for a state that cannot be used, and where fewer than one in two ticks brought another one.
    """
    states, ticks = list[RobotState](), 0
    for state in new_states(robot, clock, qd_max, seconds):
        ticks += 1
        if state:
            states.append(state)
        on_tick()
    if 2 * len(states) < ticks or not states:
        raise RobotError(
            f"The robot sent {len(states)} states in {ticks} ticks of the control loop: check the network, and make it"
            " report at least once per control period."
        )
    none = np.full(6, np.nan)
    return Standstill(
        stamp=np.array([s.stamp for s in states]),
        q=np.array([s.q for s in states]),
        tau_ext=np.array([np.asarray(s.tau_ext, dtype=np.float64) for s in states]),
        wrench=np.array([none if s.wrench is None else s.wrench for s in states]),
        newest=states[-1],
    )


def refusals(findings: Iterable[Finding]) -> tuple[str, ...]:
    """Return the sentences of those that forbid a run."""
    return tuple(finding.sentence for finding in findings if finding.level == "fault")


def vector(values: FloatArray, digits: int = 1, sign: str = "") -> str:
    """Return a vector in words."""
    return f"({', '.join(f'{value:{sign}.{digits}f}' for value in values)})"


def _fault(what: str, sentence: str) -> Finding:
    return Finding("the arm", "fault", what, sentence)


def check(controller: Controller, rest: Standstill, floor: float) -> tuple[Finding, ...]:
    """Return the findings on an arm at rest that a controller is to move, over a floor at a height [m], base frame."""
    return (
        *_limits(controller, rest.newest.q),
        *_rest(controller, rest),
        *_force(controller, rest),
        *_torques(controller, rest),
        *_mounting(controller, rest),
        *_floor(controller, floor),
    )


def _limits(controller: Controller, q: FloatArray) -> Iterator[Finding]:
    model = controller.model
    room = np.minimum(q - model.q_min, model.q_max - q)
    for joint in np.flatnonzero(room < NEAR_LIMIT_RAD).tolist():
        where = f"{model.joints[joint]} is at {q[joint]:.3f} rad, {room[joint]:.3f} rad from its limit"
        if room[joint] < LEAST_ROOM_RAD:
            yield _fault("limits", f"{where} (at least {LEAST_ROOM_RAD:g} rad): guide the arm away from it.")
        else:
            yield Finding("the arm", "warning", "limits", f"{where}: it can hardly move in that direction.")


def _rest(controller: Controller, rest: Standstill) -> Iterator[Finding]:
    moved = np.ptp(rest.q, axis=0)
    joint = int(np.argmax(moved))
    if moved[joint] > DRIFT_RAD:
        yield _fault(
            "rest",
            f"The arm does not stand still, {controller.model.joints[joint]} moved by {moved[joint]:.3f} rad (limit"
            f" {DRIFT_RAD:g} rad): let it come to rest, and do not guide it.",
        )


def _force(controller: Controller, rest: Standstill) -> Iterator[Finding]:
    threshold = MovingThresholds.of_kind(controller.profile.detect)
    if rest.missing_share > MISSING_SHARE:
        yield _fault(
            "no force",
            f"The robot gives no force estimate in {100 * rest.missing_share:.0f}% of its states, because it is near a"
            " singularity: guide it to another posture.",
        )
    if rest.missing_share == 1.0:
        return
    force, most = rest.rest_wrench[:3], BIAS_SHARE * threshold.f_base_n
    if np.abs(force).max() > most:
        yield _fault(
            "bias",
            f"At rest the robot measures a force of {vector(force)} N (limit {most:g} N on an axis): set the mass of"
            " its hand and load, and check that nothing touches the arm.",
        )
    if rest.noise.max() > threshold.sigma_max_n:
        yield _fault(
            "noise",
            f"The force at rest has a standard deviation of {rest.noise.max():.1f} N (limit {threshold.sigma_max_n:g}"
            " N): check that nothing shakes the arm, and that its mounting is firm.",
        )
    most = DISTURBANCE_SHARE * threshold.f_base_n
    if rest.disturbance > most:
        yield _fault(
            "touched",
            f"During the checks the force changed by {rest.disturbance:.1f} N (limit {most:g} N): do not touch the arm"
            " yet.",
        )


def _torques(controller: Controller, rest: Standstill) -> Iterator[Finding]:
    profile, missing = controller.profile, float(np.mean(~np.isfinite(rest.tau_ext).all(axis=1)))
    if (profile.detect.by_torques or profile.react.by_torques) and missing > MISSING_SHARE:
        yield _fault(
            "no torques",
            f"The robot gives no external joint torques in {100 * missing:.0f}% of its states, and the profile"
            f" {profile.name} needs them: check that its driver estimates them, or choose another profile.",
        )


def _mounting(controller: Controller, rest: Standstill) -> Iterator[Finding]:
    model, torque = controller.model, rest.rest_torque
    weights = weights_of(model, rest.newest.q)
    # a robot takes for external the torque of the gravity that it knows less that of the true one
    error = np.linalg.lstsq(weights, np.nan_to_num(torque))[0]
    gravity, left = model.gravity - error, np.linalg.norm(torque - weights @ error)
    size = np.linalg.norm(gravity) / np.linalg.norm(model.gravity)
    if lean_of(model, gravity) > MOUNTING_DEG and 0.7 < size < 1.3 and left < MOUNTING_SHARE * np.linalg.norm(torque):
        yield _fault(
            "mounting",
            f"At rest the robot's external torques are those of an arm whose gravity points along {vector(gravity)}"
            f" m/s^2 in its base frame, not {vector(model.gravity)}: tell the robot how it is mounted, or give"
            " --gravity.",
        )


def _floor(controller: Controller, floor: float) -> Iterator[Finding]:
    path = controller.path
    lowest = min(float(path.point(phase)[2]) for phase in np.linspace(0.0, path.length, _PLACES))
    if lowest < floor + FLOOR_CLEARANCE_M:
        yield _fault(
            "floor",
            f"The path comes down to z = {lowest:.2f} m, too close to the floor at {floor:.2f} m (clearance"
            f" {FLOOR_CLEARANCE_M:g} m): give the real height of the floor with --floor, or choose another path.",
        )


def check_start(controller: Controller, q: FloatArray) -> tuple[Finding, ...]:
    """Return a finding if an arm at q (n,) [rad] is too far from the start of its path."""
    model, start, most = controller.model, controller.path.point(0.0), _NEAR_SHARE * controller.profile.task.off_path_m
    away = float(np.linalg.norm(model.kinematics(q).position[model.ee] - start))
    if away <= most:
        return ()
    sentence = (
        f"The end-effector is {away:.2f} m from the start of the path, {vector(start, 2)} m (limit {most:g} m): guide"
        " it there by hand, or let the arm move there slowly with --approach."
    )
    return (_fault("start", sentence),)


@dataclass(frozen=True)
class StandingArm:
    """An arm at rest, and the controller that is to move it."""

    arm: Arm
    skin: SkinPort
    """Its units: their health is judged where it is a `NetworkSkin`."""
    controller: Controller
    floor: float
    """Height of what is below the arm, base frame [m]."""
    clock: Clock
    approach: bool = False
    """True if the arm is going to the start of its path first."""
    left_out: Callable[[], float] = lambda: 0.0
    """Time that this machine was too slow to simulate so far [s], where arm and units are simulated."""

    def check(self) -> tuple[Standstill, tuple[Finding, ...]]:
        """Watch arm and units for some seconds; return the arm's states and the findings.

        Units that are not heard, and states that cannot be used, are an error at once.
        """
        self.demand_fit()
        c, units = self.controller, None
        if isinstance(self.skin, NetworkSkin):
            agree = ModelCheck(c.model, c.skin, c.fixtures)
            units = UnitWatch(self.skin, _LOOK_S, agree, lambda: self.arm.read().q, self.left_out)
            units.wait(self.clock)
        rest = watch(self.arm, self.clock, c.limits.qd_max, WATCH_S, units.take if units else lambda: None)
        wrong = units.judge()[1] if units else ()
        start = () if self.approach else check_start(c, rest.newest.q)
        return rest, (*check(c, rest, self.floor), *start, *wrong)

    def recheck(self, checked: Standstill) -> FloatArray:
        """Return the arm's joint positions (n,) [rad]; RobotError if it has moved since the checks, or may not move.

        `checked` is what `check` saw of it.
        """
        self.demand_fit()
        q = np.array(self.arm.read().q)
        moved = np.abs(q - checked.newest.q)
        joint = int(np.argmax(moved))
        if not moved[joint] <= DRIFT_RAD:
            raise RobotError(
                f"The arm moved after the checks, {self.controller.model.joints[joint]} by {moved[joint]:.3f} rad"
                f" (limit {DRIFT_RAD:g} rad): start again."
            )
        for sentence in () if self.approach else refusals(check_start(self.controller, q)):
            raise RobotError(sentence)
        return q

    def demand_fit(self) -> None:
        """Raise a RobotError with all reasons of the arm itself against moving."""
        if against := self.arm.unfit():
            raise RobotError(" ".join(against))
