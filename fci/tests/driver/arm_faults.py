"""Faults of the arm's side, one run each in real time against `serve-fci`: what the controller does, how soon, and how
it goes on. `python -m fci.tests.driver.arm_faults` prints the table of docs/results/shield.md."""

import argparse
import re
import tempfile
import time
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass, field, replace
from pathlib import Path
from subprocess import Popen

import numpy as np
from fci.tests.driver.served import Served, child
from fci.tests.soak.truth import Truth

from pretouch import loop
from pretouch.arms.franka.arm import FrankaArm
from pretouch.arms.franka.exchange import Feedback
from pretouch.arms.franka.limits import LimiterParams, collision_behavior, planned
from pretouch.control.path import Circle
from pretouch.controller import Controller
from pretouch.errors import RobotError
from pretouch.modes import TABLE
from pretouch.perception.scene_filter import no_fixtures
from pretouch.ports import NoUnits
from pretouch.profiles import profile
from pretouch.realtime import warm_up
from pretouch.robot.description import panda
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.types import ControlStep, Mode

PERIOD_S = 0.01
FAULT_S, LASTS_S, RESUME_S, ENDS_S = 3.0, 1.5, 5.0, 6.0
"""When a fault begins and how long it lasts, when a person resumes, and when the run ends [s]."""
_LOOK_S = 0.8
"""How long after a fault was noticed the truth is looked at: the arm rests by then, and has not been resumed [s]."""

Change = Callable[[list[Feedback], Feedback], Feedback]
"""Given the feedback so far, the newest last, and the last before the fault, what is told instead."""


def _state(**changes: Callable[[np.ndarray], np.ndarray]) -> Change:
    def changed(heard: list[Feedback], _: Feedback) -> Feedback:
        newest = heard[-1]
        made = {name: change(getattr(newest.state, name)) for name, change in changes.items()}
        return replace(newest, state=replace(newest.state, **made))  # type: ignore[arg-type]

    return changed


def _one(joint: int, by: float) -> Callable[[np.ndarray], np.ndarray]:
    return lambda values: values + by * (np.arange(7) == joint)


def _late(heard: list[Feedback], _: Feedback) -> Feedback:
    return next(old for old in reversed(heard) if heard[-1].stamp - old.stamp > 0.2)


def _jumping(heard: list[Feedback], last: Feedback) -> Feedback:
    return _state(q=_one(3, 0.3 * (int(10.0 * heard[-1].stamp) % 2)))(heard, last)


@dataclass(frozen=True)
class Fault:
    """One fault, and what must come of it."""

    said: str
    """Part of the reason of the HOLD, or of the error that ends the run; '': the arm goes on."""
    change: Change | None = None
    """What the controller is told instead; None: something happens to the arm."""
    do: Callable[[Served], None] = lambda _: None
    undo: Callable[[Served], None] = lambda _: None
    at: Mode | None = None
    """Wait for this mode before it begins."""
    resumes: bool = False
    """Whether the arm goes on only when a person resumes."""
    ends: bool = False
    """Whether the run ends."""
    lasts_s: float = LASTS_S


def _refused(_: Served) -> None:
    """The second program has been refused."""
    said, _ = _seconds.pop().communicate(timeout=60.0)
    assert "in use by process" in said


_seconds: list[Popen[str]] = []
_STOP = Fault(
    "User Stop|user stop|emergency|Emergency",
    do=lambda served: served.type("stop"), undo=lambda served: served.type("release"), ends=True,
)  # fmt: skip
FAULTS = {
    "states 0.2 s late": Fault("s old", _late, resumes=True),
    "the same state again and again": Fault("s old", lambda _, last: last, ends=True),
    "values that freeze, new times": Fault(
        "s old", lambda heard, last: replace(last, stamp=heard[-1].stamp), resumes=True
    ),
    "joint positions that jump": Fault("RobotState.q holds nan", _jumping, resumes=True),
    "an encoder's step of 0.1 rad, for good": Fault(
        "RobotState.q holds nan", _state(q=_one(1, 0.1)), resumes=True, lasts_s=np.inf
    ),
    "a false commanded velocity": Fault(
        "RobotState.qd_commanded holds nan", _state(dq_d=lambda qd: qd + 1.0), resumes=True
    ),
    "a torque sensor that sticks": Fault(
        "no force estimate", _state(tau_ext=lambda tau: np.where(np.arange(7) == 3, 1.25, tau))
    ),
    "no force estimate": Fault("no force estimate", _state(wrench=np.zeros_like)),
    "numbers that are none": Fault("RobotState.qd holds nan", _state(qd=lambda qd: qd * np.nan), resumes=True),
    "time that jumps ahead": Fault(
        "in the future", lambda heard, _: replace(heard[-1], stamp=heard[-1].stamp + 10.0), resumes=True
    ),
    "time that jumps back": Fault(
        "No state has come", lambda heard, _: replace(heard[-1], stamp=heard[-1].stamp - 10.0), ends=True
    ),
    "a second commander": Fault(
        "", do=lambda served: _seconds.append(child("commander.py", "panda", served.address)), undo=_refused
    ),
    "emergency stop in TRACK": _STOP,
    "emergency stop in REACT": replace(_STOP, at=Mode.REACT),
    "emergency stop in HOLD": replace(_STOP, at=Mode.HOLD),
}  # fmt: skip


@dataclass
class Seen:
    """What came of a fault."""

    held_s: float = np.inf
    """Time until the first HOLD, or the error [s]."""
    rested_s: float = np.inf
    """Time until the arm rested [s], up to 0.1 s too long; 0 if it did not move."""
    reason: str = ""
    modes: list[Mode] = field(default_factory=list)
    """Of all steps after the fault began."""
    goes_on: bool = False
    """Whether it followed its path again at the end, by itself or after a resume; of a run that ended: the next one."""


class Rehearsal:
    """One run with one fault."""

    def __init__(self, served: Served, fault: Fault) -> None:
        self._served, self._fault, self.seen = served, fault, Seen()
        self._heard: list[Feedback] = []
        self._last: Feedback | None = None
        """The last feedback before the fault."""
        self._truth = Truth(served.truth, panda().qd_max)
        self._begun = self._instant = np.nan
        self._robot_instant = self._newest_step = self._rest_by = np.inf
        self._pushed = self._moved = False

    def play(self) -> Seen:
        """Play it."""
        model, seen = RobotModel(planned(panda(), LimiterParams())), self.seen
        control = Controller(model, Skin([], model), no_fixtures(), Circle(), profile("paper"))
        with FrankaArm(
            self._served.address, "panda", model, behavior=collision_behavior(control.profile, model)
        ) as arm:
            warm_up(control, arm.read())
            honest = arm._feedback
            setattr(arm, "_feedback", lambda: self._told(honest()))  # noqa: B010  # a class's method, to mypy
            arm.begin()
            self._begun = time.monotonic()
            try:
                loop.run(
                    control, arm, NoUnits(), loop.MonotonicClock(PERIOD_S), self, self._done, loop.Options(self._asked)
                )
                arm.end()
            except RobotError as error:
                if not np.isfinite(seen.held_s):
                    seen.reason, seen.held_s = str(error), self._newest_step - self._instant + PERIOD_S
            assert not np.isnan(self._instant), f"the run ended before its fault: {seen.reason}"
            if self._fault.said and not np.isfinite(seen.rested_s):
                time.sleep(1.0)
                self._read_rest()
        self._fault.undo(self._served)
        seen.goes_on = self._runs_again(model) if self._fault.ends else seen.modes[-1] is Mode.TRACK
        self._truth.close()
        return seen

    def _told(self, newest: Feedback) -> Feedback:
        """Return the feedback that the controller is given."""
        self._heard = [*self._heard[-1000:], newest]
        since, fault = time.monotonic() - self._instant, self._fault
        if fault.change is None or not 0.0 <= since < fault.lasts_s:
            self._last = newest
            return newest
        return fault.change(self._heard, self._last or newest)

    def _asked(self) -> bool:
        """Whether a person resumes now."""
        since = time.monotonic() - self._begun
        return self._fault.resumes and RESUME_S <= since < RESUME_S + 0.05

    def _done(self, step: ControlStep) -> bool:
        now = time.monotonic()
        since = now - self._begun
        if np.isnan(self._instant):
            if self._fault.at is Mode.REACT and since > FAULT_S and step.mode is Mode.TRACK and not self._pushed:
                self._served.type("0,25,0")
                self._pushed = True
            if since > FAULT_S if self._fault.at is None else step.mode is self._fault.at:
                self._truth.read()
                self._moved, self._robot_instant, self._instant = self._truth.moves, self._truth.now, now
                self._fault.do(self._served)
        return since > ENDS_S

    def record(self, cycle: loop.Cycle) -> None:
        """Look at a step."""
        self._newest_step = time.monotonic()
        if not np.isnan(self._instant):
            step, seen = cycle.step, self.seen
            named = step.mode is Mode.HOLD and self._fault.said and re.search(self._fault.said, step.reason)
            if named and not np.isfinite(seen.held_s):
                seen.held_s, seen.reason = time.monotonic() - self._instant, step.reason
                self._rest_by = time.monotonic() + _LOOK_S
            seen.modes.append(step.mode)
        if np.isfinite(self.seen.held_s) and not np.isfinite(self.seen.rested_s) and time.monotonic() > self._rest_by:
            self._read_rest()

    def _read_rest(self) -> None:
        self._truth.read()
        self.seen.rested_s = self._truth.rested_after(self._robot_instant) if self._moved else 0.0

    def _runs_again(self, model: RobotModel) -> bool:
        """Whether the arm moves in a new run, recovered if need be."""
        time.sleep(0.5)
        with FrankaArm(self._served.address, "panda", model) as arm:
            if arm.state().mode == "reflex":
                arm.recover()
            arm.begin()
            until = time.monotonic() + 1.0
            while time.monotonic() < until:
                arm.command(np.array([0.0, 0, 0, 0, 0, 0, 0.2]))
                time.sleep(0.01)
            moves = self._served.moves()
            arm.end()
        return moves


def play(folder: Path, name: str) -> Seen:
    """Play one fault with an arm of its own."""
    with closing(Served(folder, "panda", "--start", "path")) as served:
        return Rehearsal(served, FAULTS[name]).play()


_ABOUT = f"""# Faults of the arm's side

Made by `python -m fci.tests.driver.arm_faults`: `paper` on its circle, in real time through the
vendor's library, against `pretouch serve-fci`. A fault begins after {FAULT_S:g} s and lasts {LASTS_S:g} s; a person
resumes after {RESUME_S:g} s. *Noticed*: until the HOLD or the error that names it. *Rest*: until the arm rests, up to
0.1 s too long.

| fault | noticed [s] | rest [s] | goes on | what is said |
|---|---|---|---|---|
"""


def document(found: dict[str, Seen]) -> str:
    """Return the table of what came of the faults, and the state machine."""
    rows = [_row(name, FAULTS[name], seen) for name, seen in found.items()]
    arrows: dict[tuple[str, str], list[str]] = {}
    for row in TABLE:
        for source in sorted(row.source - {row.target}, key=lambda mode: mode.name):
            arrows.setdefault((source.name, row.target.name), []).append(row.event.name + "*" * row.latches)
    drawn = [f"    {a} --> {b}: {', '.join(events)}" for (a, b), events in arrows.items()]
    return _ABOUT + "\n".join([
        *rows, "", "## The modes", "", "```mermaid", "stateDiagram-v2", "    [*] --> HOLD", *drawn, "```", "",
        "\\* until a person resumes, and the cause is gone.", "",
    ])  # fmt: skip


def _row(name: str, fault: Fault, seen: Seen) -> str:
    if not fault.said:
        return f"| {name} | - | - | undisturbed | the second is refused |"
    way = "next run" if fault.ends else "when resumed" if fault.resumes else "by itself"
    said = re.sub(r"127(\.\d+){3}", "127.0.0.1", seen.reason)
    return f"| {name} | {seen.held_s:.2f} | {seen.rested_s:.2f} | {way if seen.goes_on else 'no'} | {said} |"


def main() -> None:
    """Play all of them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", default="")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        found = {name: play(Path(folder), name) for name in FAULTS if given.only in name}
    print(document(found))


if __name__ == "__main__":
    main()
