"""Simulated units in real time: an arm moves on its path, a hand comes and goes, and the units send to a receiver.

Where the receiver is does not matter to them: in another program, or on another machine. The arm's own controller has
its readings within the process, so that the arm moves whatever becomes of the datagrams.
"""

from collections.abc import Callable

import numpy as np

from pretouch.arms.simulated.arm import SimulatedArm
from pretouch.control.path import Path
from pretouch.controller import Controller
from pretouch.loop import Cycle
from pretouch.loop import run as turn_on
from pretouch.profiles import Profile
from pretouch.robot.model import RobotModel
from pretouch.robot.postures import brought_to
from pretouch.sensing.skin import Skin
from pretouch.sim.hand import Hand, HandGoal
from pretouch.sim.plant import Plant
from pretouch.sim.range_finder import RangeFinderParams, RangeFinders
from pretouch.sim.scene import HandSpec, SceneSpec, fixtures
from pretouch.types import FloatArray
from pretouch.units.fleet import Fleet

_SAY_S = 1.0


class VisitingHand:
    """A hand that every 15 s comes to 0.3 m before the robot's hand, stays with it for 5 s, and goes."""

    away = (1.2, 0.0, 0.8)

    def __init__(self, link: int) -> None:
        self._link = link

    def goal(self, time: float, hand: FloatArray, plant: Plant) -> HandGoal:
        """Return the hand's target at this time of the visit, with almost no force."""
        here = 5.0 <= time % 15.0 < 10.0
        before = plant.link_position[self._link] + np.array([0.3, 0.0, 0.0])
        return HandGoal(before if here else np.array(self.away), 20.0)


class _StatusPrinter:
    """Prints the status each second."""

    def __init__(self, arm: SimulatedArm, say: Callable[[str], None]) -> None:
        self._arm, self._fleet, self._say = arm, arm.fleet, say
        self._next, self._sent = _SAY_S, 0

    def record(self, cycle: Cycle) -> None:
        """Print the status of an arm and its units, when it is due."""
        if self._arm.now < self._next:
            return
        self._next += _SAY_S
        step, fleet = cycle.step, self._fleet
        silent = [name for name, unit in zip(fleet.ids, fleet.units, strict=True) if not unit.in_session]
        sent, self._sent = fleet.sent - self._sent, fleet.sent
        parts = [
            f"{self._arm.now:7.1f} s  {step.mode.value:5}  {np.linalg.norm(step.ee_velocity):.2f} m/s",
            f"{sent} datagrams",
            f"{len(fleet.ids) - len(silent)} of {len(fleet.ids)} units in session",
        ]
        if silent:
            parts.append(f"without session: {', '.join(silent)}")
        if fleet.lost:
            parts.append(f"{fleet.lost} could not be sent")
        if self._arm.left_out:
            parts.append(f"this machine is too slow by {self._arm.left_out:.1f} s")
        self._say("; ".join(parts))


def run(
    model: RobotModel,
    skin: Skin,
    fleet: Fleet,
    path: Path,
    profile: Profile,
    hand: bool,
    done: Callable[[float], bool],
    say: Callable[[str], None],
) -> None:
    """Simulate an arm on a path until `done`, whose units are a fleet; then bring the arm to rest.

    `hand` makes a person's hand come and go; `done` is asked at each step, with the time since the begin [s]; `say`
    receives a line each second.
    """
    scene = SceneSpec(hand=HandSpec(start=VisitingHand.away)) if hand else SceneSpec()
    arm = SimulatedArm(model, brought_to(model, path.point(0.0)), skin, fleet, scene, profile.task.control_period_s)
    if hand:
        Hand(arm.plant, VisitingHand(model.ee))
    # it draws the same numbers as the units that send: what is sent is what the arm's own controller has
    finders = RangeFinders(arm.plant, skin, RangeFinderParams(), fleet.seed)
    controller = Controller(model, skin, fixtures(scene), path, profile)
    arm.begin()
    turn_on(controller, arm, finders, arm, _StatusPrinter(arm, say), lambda _: done(arm.now))
