"""A Franka arm for `pretouch run`, in real time."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from pretouch.cli.run.setup import OpenedRobot, RunSetup, network_units
from pretouch.hardware.franka.arm import FrankaArm
from pretouch.hardware.franka.collision import CollisionParams, collision_behavior, largest_threshold
from pretouch.session.franka import FrankaSessionArm, identity
from pretouch.session.session import NoUnits
from pretouch.session.terminal import require_yes, say
from pretouch.signals import children_undisturbed

if TYPE_CHECKING:
    from pretouch.cli.run.options import Run

_REFUSED = "The arm was not allowed to recover"


@contextmanager
def franka(command: "Run", setup: RunSetup) -> Iterator[OpenedRobot]:
    """Connect to the arm, set its collision behaviour by the profile's thresholds, and hear its units."""
    kind, address = command.robot.kind, command.robot.ip
    known = identity(kind, address)
    behavior = collision_behavior(setup.profile, setup.model)
    say(
        f"The arm stops by itself from {behavior.upper_force[0]:.0f} N on; the profile detects"
        f" {largest_threshold(setup.profile, setup.model, CollisionParams()):.0f} N at the latest."
    )
    priority = command.priority and min(command.priority + 1, 99)
    with children_undisturbed():
        connected = FrankaArm(address, kind, setup.model, behavior=behavior, priority=priority)
    with connected as arm, network_units(command, setup) as units:
        notes = (arm.missing,) if arm.missing else ()
        ours = FrankaSessionArm(arm, kind, address)
        if command.robot.recover:
            _recover(ours, command.yes)
        told = arm.state()
        robot = f"{known.key}, hand {told.m_ee:.3g} kg, load {told.m_load:.3g} kg"
        yield OpenedRobot(ours, units or NoUnits(), known, units, notes=lambda: notes, free_motion_id=robot)


def _recover(arm: FrankaSessionArm, yes: bool) -> None:
    """Let an arm that has stopped by itself recover; a person is asked first, for it may move a little."""
    if not arm.reflex:
        say(f"{arm.name} does not need to recover.")
        return
    if not yes:
        require_yes(f"{arm.name} has stopped by itself. Is it free of what it touched, and may it recover?", _REFUSED)
    arm.recover()
    say(f"{arm.name} has recovered.")
