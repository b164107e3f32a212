"""A Franka arm for `pretouch run`, in real time."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from pretouch.cli.run.asking import demand_yes, say
from pretouch.cli.run.opened import Opened, network_units
from pretouch.cli.run.parts import Parts
from pretouch.hardware.franka.arm import FrankaArm
from pretouch.hardware.franka.collision import CollisionParams, collision_behavior, largest_threshold
from pretouch.session.franka import FrankaSessionArm, identity
from pretouch.session.session import NoUnits
from pretouch.signals import children_undisturbed

if TYPE_CHECKING:
    from pretouch.cli.run.options import Run

_REFUSED = "The arm was not let recover"


@contextmanager
def franka(command: "Run", parts: Parts) -> Iterator[Opened]:
    """Connect to the arm, set its collision behaviour by the profile's thresholds, and hear its units."""
    kind, address = command.robot.arm, command.robot.ip
    known = identity(kind, address)
    behavior = collision_behavior(parts.profile, parts.model)
    say(
        f"The arm stops by itself from {behavior.upper_force[0]:.0f} N on; the profile feels"
        f" {largest_threshold(parts.profile, parts.model, CollisionParams()):.0f} N at the latest."
    )
    priority = command.priority and min(command.priority + 1, 99)
    with children_undisturbed():
        connected = FrankaArm(address, kind, parts.model, behavior=behavior, priority=priority)
    with connected as arm, network_units(command, parts) as units:
        notes = (arm.missing,) if arm.missing else ()
        ours = FrankaSessionArm(arm, kind, address)
        if command.robot.recover:
            _recover(ours, command.yes)
        told = arm.state()
        robot = f"{known.key}, hand {told.m_ee:.3g} kg, load {told.m_load:.3g} kg"
        yield Opened(ours, units or NoUnits(), known, units, notes=lambda: notes, learnt_as=robot)


def _recover(arm: FrankaSessionArm, yes: bool) -> None:
    """Let an arm that has stopped by itself recover; a person is asked first, for it may move a little."""
    if not arm.reflex:
        say(f"{arm.name} need not recover.")
        return
    if not yes:
        demand_yes(f"{arm.name} has stopped by itself. Is it clear of what it touched, and may it recover?", _REFUSED)
    arm.recover()
    say(f"{arm.name} has recovered.")
