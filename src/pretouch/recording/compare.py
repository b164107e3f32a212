"""Decisions of a detector cycle by cycle, and those of another profile on the same data."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pretouch.contact.moving_thresholds import MovingThresholds
from pretouch.controller import Controller, ControllerState
from pretouch.errors import RecordingError, RobotStateError
from pretouch.profiles import Profile, at_rate
from pretouch.recording.run_record import DetectorRecord
from pretouch.types import BoolArray, Contact, ControlStep, FloatArray, Mode, RobotState, Thresholds
from pretouch.values import value

if TYPE_CHECKING:
    from pretouch.recording.reader import Recorded

SAME_CONTACT_S = 0.3
"""Two detectors' contacts within this time of each other [s] are one."""

Decision = tuple[float, FloatArray, FloatArray, Thresholds, bool, bool, Contact | None]
"""Decision of a cycle: its instant [s], the force (3,) and the one compared with thresholds (3,) [N], these,
whether the force window was full, whether a reaction was under way, and the contact that began."""


@value
class Circumstances:
    """An alarm by joint torques as somebody would judge it, n joints."""

    joint: str
    """The joint whose residual is largest beside its deviation."""
    residual_nm: FloatArray
    """(n,) torques less those of learnt free motion, averaged over the time in which they are most significant [Nm]."""
    sigma_nm: FloatArray
    """(n,) standard deviation of that in free motion [Nm]."""
    free_motion_nm: FloatArray
    """(n,) torques of learnt free motion at the alarm [Nm]."""
    speed_rad_s: FloatArray
    """(n,) commanded velocities [rad/s]."""
    doing: tuple[str, ...]
    """Motion of each joint, see `joint_motion`."""


@value
class DetectedContact:
    """A contact that a detector reported."""

    time_s: float
    """Time of the detection."""
    force_n: FloatArray
    """(3,) on the robot, base frame: F_ext of eq. 12, or where the joint torques place the contact."""
    axes: str = ""
    """Axes whose threshold was crossed, as "xz"."""
    link: str | None = None
    """The link that is touched; None where the profile does not say or the torques cannot tell."""
    point_m: FloatArray | None = None
    """(3,) where on the likeliest link's surface, base frame; None where the profile does not say."""
    end_s: float | None = None
    """Time of the last evidence of it; None where there is no evidence but the contact itself."""
    probability: float | None = None
    """That it is the likeliest link's rigid body, if a touch is as likely on all of the arm's surface."""
    evidence: float | None = None
    """Largest of the contact."""
    links: tuple[str, ...] = ()
    """All links that the torques could be of, one a rigid body, the likeliest first."""
    circumstances: Circumstances | None = None
    """Those of the alarm; None without joint torques."""

    @property
    def norm_n(self) -> float:
        """Size of the force."""
        return float(np.linalg.norm(self.force_n))


@dataclass(frozen=True, kw_only=True)
class Decisions(DetectorRecord):
    """Decisions of a detector in S cycles. Forces on the robot, base frame."""

    name: str
    """The profile."""
    compared: FloatArray
    """(S, 3) what was held against the thresholds [N], NaN without an estimate."""
    reacting: BoolArray
    """(S,) whether a reaction was under way, so that contacts are ignored."""
    contacts: tuple[DetectedContact, ...]

    @property
    def judged(self) -> BoolArray:
        """(S,) whether a contact could be detected."""
        return self.armed & np.isfinite(self.compared).all(axis=1)


def decisions_of(name: str, cycles: Sequence[Decision]) -> Decisions:
    """Return the decisions of one or more cycles as arrays."""
    time, *columns, contacts = zip(*cycles, strict=True)
    names = ("force", "compared", "thresholds", "armed", "reacting")
    arrays = {part: np.array(column) for part, column in zip(names, columns, strict=True)}
    detected = tuple(
        DetectedContact(t, c.force, "".join(axis for axis, crossed in zip("xyz", c.axes, strict=True) if crossed))
        for t, c in zip(time, contacts, strict=True)
        if c is not None
    )
    return Decisions(name=name, time=np.array(time), contacts=detected, **arrays)


def _decision_of(step: ControlStep, profile: Profile) -> Decision:
    """Return a controller's decision; the profile says which force it compared."""
    filtered = isinstance(profile.detect, MovingThresholds) and profile.detect.compare == "filtered"
    compared = step.filtered_force if filtered and not np.isnan(step.force).any() else step.force
    reacting = step.mode is Mode.REACT
    return step.stamp, step.force, compared, step.thresholds, step.armed, reacting, step.contact


@value
class Comparison:
    """Two detectors on the same data. The arm moved as it was recorded, whatever the other would have made of it."""

    recorded: Decisions
    other: Decisions
    pairs: tuple[tuple[DetectedContact | None, DetectedContact | None], ...]
    """Contacts in time order, the recorded one first; None where only one has it."""
    left_out: int
    """Cycles whose inputs are not in the recording."""


def compare(recorded: "Recorded", profile: Profile, progress: Callable[[int], None] = lambda done: None) -> Comparison:
    """Let another profile decide on the inputs of a recording, cycle by cycle; its commands go nowhere.

    It begins with the force window of the recording's first snapshot, if it has one of the same length. A profile for
    another rate is brought to that of the run. `progress` gets how many cycles are done. Raises RecordingError if
    none has usable inputs.
    """
    theirs, ours = list[Decision](), list[Decision]()
    controllers = [run.controller() for run in recorded.runs]
    periods = [c.profile.task.control_period_s for c in controllers]
    profiles = [profile if profile.task.control_period_s == s else at_rate(profile, 1 / s) for s in periods]
    others = [Controller(c.model, c.skin, c.fixtures, c.path, p) for c, p in zip(controllers, profiles, strict=True)]
    state: ControllerState | None = None
    last = left_out = 0
    for i, cycle in enumerate(recorded):
        progress(i + 1)
        other = others[cycle.run]
        if cycle.inputs is not None and state is None:
            state = _first_state(other, controllers[cycle.run], cycle.snapshot, cycle.inputs.robot)
        elif cycle.inputs is not None and state is not None and cycle.run != last:
            state = other.adopt(state, others[last])
        if cycle.inputs is None or state is None:
            left_out += 1
            continue
        last = cycle.run
        step, state = other.step(state, cycle.inputs)
        theirs.append(_decision_of(cycle.step, recorded.runs[cycle.run].profile))
        ours.append(_decision_of(step, other.profile))
    if not ours:
        raise RecordingError(f"{recorded.place} has no cycle with a usable robot state: nothing can be compared.")
    names = dict.fromkeys(run.profile.name for run in recorded.runs)
    a, b = decisions_of(", ".join(names), theirs), decisions_of(profile.name, ours)
    return Comparison(a, b, paired(a.contacts, b.contacts), left_out)


def paired(
    first: Sequence[DetectedContact], second: Sequence[DetectedContact]
) -> tuple[tuple[DetectedContact | None, DetectedContact | None], ...]:
    """Pair contacts of two detectors that are one by `SAME_CONTACT_S`, the closest first; in time order.

    What only one of them has is paired with None.
    """
    close = sorted(
        (abs(a.time_s - b.time_s), i, j)
        for i, a in enumerate(first)
        for j, b in enumerate(second)
        if abs(a.time_s - b.time_s) <= SAME_CONTACT_S
    )
    partner: dict[int, int] = {}
    for _, i, j in close:
        if i not in partner and j not in partner.values():
            partner[i] = j
    pairs: list[tuple[DetectedContact | None, DetectedContact | None]] = [
        (a, second[partner[i]] if i in partner else None) for i, a in enumerate(first)
    ]
    pairs += [(None, b) for j, b in enumerate(second) if j not in partner.values()]
    return tuple(sorted(pairs, key=lambda pair: min(contact.time_s for contact in pair if contact)))


def _first_state(
    other: Controller, recorded: Controller, snapshot: ControllerState | None, robot: RobotState
) -> ControllerState | None:
    """State to begin with, or None as long as the robot's state cannot be used."""
    if snapshot is not None:
        return other.adopt(snapshot, recorded)
    try:
        return other.init(robot)
    except RobotStateError:
        return None
