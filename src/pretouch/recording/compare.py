"""What a detector decided cycle by cycle, and what another profile would have decided on the same data."""

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


@value
class Found:
    """A contact that a detector found."""

    time: float
    """[s]"""
    force: FloatArray
    """(3,) external force F_ext of eq. 12 [N], base frame."""
    axes: BoolArray
    """(3,) axes whose threshold was crossed."""


@dataclass(frozen=True, kw_only=True)
class Decisions(DetectorRecord):
    """What a detector made of the force in S cycles. Forces on the robot, base frame."""

    name: str
    """The profile."""
    compared: FloatArray
    """(S, 3) what was held against the thresholds [N], NaN without an estimate."""
    reacting: BoolArray
    """(S,) whether a reaction was under way, so that contacts are ignored."""
    contacts: tuple[Found, ...]


class Decided:
    """Gathers decisions cycle by cycle."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._time: list[float] = []
        self._rows: list[tuple[FloatArray, FloatArray, FloatArray]] = []
        self._flags: list[tuple[bool, bool]] = []
        self._contacts: list[Found] = []

    def add(
        self, time: float, force: FloatArray, compared: FloatArray, limits: Thresholds, armed: bool, reacting: bool,
        contact: Contact | None,
    ) -> None:  # fmt: skip
        """Take in a cycle: instant [s], forces (3,) [N], thresholds, flags, and the contact that began in it."""
        self._time.append(time)
        self._rows.append((force, compared, np.array(limits)))
        self._flags.append((armed, reacting))
        if contact is not None:
            self._contacts.append(Found(time, contact.force, contact.axes))

    def add_step(self, step: ControlStep, profile: Profile) -> None:
        """Take in a controller's step; the profile says which force it compared."""
        filtered = isinstance(profile.detect, MovingThresholds) and profile.detect.compare == "filtered"
        compared = step.filtered_force if filtered else step.force
        without = np.isnan(step.force).any()
        self.add(
            step.stamp, step.force, step.force if without else compared, step.thresholds, step.armed,
            step.mode is Mode.REACT, step.contact,
        )  # fmt: skip

    def decisions(self) -> Decisions:
        """Return all that was gathered."""
        count = len(self._time)
        flags = np.array(self._flags, dtype=np.bool_).reshape(count, 2)
        shapes = ((3,), (3,), (6, 3))
        force, compared, parts = (np.array([r[k] for r in self._rows]).reshape(count, *shapes[k]) for k in range(3))
        return Decisions(
            name=self._name, time=np.array(self._time), force=force, compared=compared, thresholds=parts,
            armed=flags[:, 0], reacting=flags[:, 1], contacts=tuple(self._contacts),
        )  # fmt: skip


@value
class Comparison:
    """Two detectors on the same data. The arm moved as it was recorded, whatever the other would have made of it."""

    recorded: Decisions
    other: Decisions
    both: tuple[tuple[Found, Found], ...]
    """Contacts that both found, the recorded one first."""
    only_recorded: tuple[Found, ...]
    only_other: tuple[Found, ...]
    left_out: int
    """Cycles whose inputs are not in the recording."""


def compare(recorded: "Recorded", profile: Profile, progress: Callable[[int], None] = lambda done: None) -> Comparison:
    """Let another profile decide on the inputs of a recording, cycle by cycle; its commands go nowhere.

    It begins with the force window of the recording's first snapshot, if it has one of the same length. A profile for
    another rate is brought to that of the run. `progress` gets how many cycles are done. Raises RecordingError if
    none has usable inputs.
    """
    names = dict.fromkeys(run.profile.name for run in recorded.runs)
    theirs, ours = Decided(", ".join(names)), Decided(profile.name)
    controllers = [run.controller() for run in recorded.runs]
    others = [_with_profile(c, profile) for c in controllers]
    state: ControllerState | None = None
    last = left_out = 0
    for i, kept in enumerate(recorded):
        progress(i + 1)
        other = others[kept.run]
        if kept.inputs is None:
            left_out += 1
            continue
        if state is None:
            state = _first_state(other, controllers[kept.run], kept.snapshot, kept.inputs.robot)
        elif kept.run != last:
            state = other.adopt(state, others[last])
        if state is None:
            left_out += 1
            continue
        last = kept.run
        step, state = other.step(state, kept.inputs)
        theirs.add_step(kept.step, recorded.runs[kept.run].profile)
        ours.add_step(step, other.profile)
    if state is None:
        raise RecordingError(f"{recorded.place} has no cycle with a usable robot state: nothing can be compared.")
    a, b = theirs.decisions(), ours.decisions()
    both, only_a, only_b = matched(a.contacts, b.contacts)
    return Comparison(a, b, both, only_a, only_b, left_out)


def matched(
    first: Sequence[Found], second: Sequence[Found], within: float = SAME_CONTACT_S
) -> tuple[tuple[tuple[Found, Found], ...], tuple[Found, ...], tuple[Found, ...]]:
    """Pair contacts of two detectors that are within a time [s] of each other, the closest pairs first.

    Returns the pairs in time order, what only the first found, and what only the second found.
    """
    close = sorted(
        (abs(a.time - b.time), i, j)
        for i, a in enumerate(first)
        for j, b in enumerate(second)
        if abs(a.time - b.time) <= within
    )
    partner: dict[int, int] = {}
    taken: set[int] = set()
    for _, i, j in close:
        if i not in partner and j not in taken:
            partner[i] = j
            taken.add(j)
    pairs = tuple((first[i], second[partner[i]]) for i in sorted(partner))
    return (
        pairs,
        tuple(a for i, a in enumerate(first) if i not in partner),
        tuple(b for j, b in enumerate(second) if j not in taken),
    )


def _with_profile(controller: Controller, profile: Profile) -> Controller:
    period = controller.profile.task.control_period_s
    if profile.task.control_period_s != period:
        profile = at_rate(profile, 1 / period)
    return Controller(controller.model, controller.skin, controller.fixtures, controller.path, profile)


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
