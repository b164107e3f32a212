"""A Panda or FR3 for `pretouch run`."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.metadata import version
from typing import TYPE_CHECKING, Annotated, cast

import tyro

from pretouch.arms import ArmOptions, ArmSetup, OpenedArm
from pretouch.errors import RobotError

if TYPE_CHECKING:
    from pretouch.arms.franka.arm import FrankaArm
    from pretouch.arms.franka.connection import Kind
    from pretouch.robot.description import RobotDescription
    from pretouch.session.memory import Identity


@dataclass(frozen=True)
class Franka(ArmOptions):
    """A Panda or FR3, over the Franka Control Interface."""

    ip: str
    """Address of the robot."""
    recover: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """First recover an arm that has stopped by itself, once it is free of what it touched."""

    def described(self, description: "RobotDescription") -> "RobotDescription":
        """Return the arm with the share of its accelerations that is used."""
        from pretouch.arms.franka.limits import LimiterParams, planned

        return planned(description, LimiterParams())

    def check(self, setup: ArmSetup) -> None:
        """Refuse other arms, and a missing vendor's library."""
        from pretouch.arms.franka.connection import LIBRARIES, need_library

        if setup.name not in LIBRARIES:
            raise RobotError(
                f"--arm {setup.name} is no arm of `pretouch run franka`, which is for a panda or an fr3: rehearse it"
                " with `pretouch run simulated`, or connect it by `pretouch run ros2`."
            )
        need_library(setup.name)

    @contextmanager
    def open(self, setup: ArmSetup) -> Iterator[OpenedArm]:
        """Connect to the arm, and set its collision behaviour by the profile's thresholds."""
        from pretouch.arms.franka.arm import FrankaArm
        from pretouch.arms.franka.limits import collision_behavior, largest_threshold
        from pretouch.session.terminal import say

        kind = cast("Kind", setup.name)
        robot = identity(kind, self.ip)
        behavior = collision_behavior(setup.profile, setup.model)
        say(
            f"The arm stops by itself from {behavior.upper_force[0]:.0f} N on; the profile detects"
            f" {largest_threshold(setup.profile, setup.model):.0f} N at the latest."
        )
        priority = setup.priority and min(setup.priority + 1, 99)
        with FrankaArm(self.ip, kind, setup.model, behavior=behavior, priority=priority) as arm:
            if self.recover:
                _recover(arm, setup.yes)
            state = arm.state()
            carried = f"hand {state.m_ee:.3g} kg, load {state.m_load:.3g} kg"
            notes = (arm.missing,) if arm.missing else ()
            yield OpenedArm(arm, robot, notes=lambda: notes, free_motion_id=f"{robot.key}, {carried}")


def identity(kind: "Kind", address: str) -> "Identity":
    """Return the identity of a robot at an address: another library requires the guided pushes again."""
    from pretouch.arms.franka.connection import LIBRARIES
    from pretouch.session.memory import Identity

    library = LIBRARIES[kind].distribution
    return Identity(kind, address, f"{library} {version(library)}")


def _recover(arm: "FrankaArm", yes: bool) -> None:
    """Let a stopped arm recover; a person is asked first, because it may move a little."""
    from pretouch.session.terminal import require_yes, say

    if arm.state().mode != "reflex":
        say(f"{arm.name} does not need to recover.")
        return
    if not yes:
        question = f"{arm.name} has stopped by itself. Is it free of what it touched, and may it recover?"
        require_yes(question, "The arm was not allowed to recover")
    arm.recover()
    say(f"{arm.name} has recovered.")
