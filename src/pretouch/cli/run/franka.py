"""A Franka arm for `pretouch run`, in real time."""

from collections.abc import Iterator
from contextlib import contextmanager

from pretouch.cli.run.options import Run
from pretouch.cli.run.parts import Parts
from pretouch.cli.run.robots import Opened, network_units
from pretouch.hardware.franka.arm import FrankaArm
from pretouch.hardware.franka.collision import collision_behavior
from pretouch.session.franka import FrankaSessionArm, identity
from pretouch.session.session import NoUnits
from pretouch.session.signals import children_undisturbed


@contextmanager
def franka(command: Run, parts: Parts) -> Iterator[Opened]:
    """Connect to the arm, set its collision behaviour by the profile's thresholds, and hear its units."""
    kind, address = command.robot.arm, command.robot.ip
    known = identity(kind, address)
    behavior = collision_behavior(parts.profile, parts.model)
    print(
        f"The arm stops by itself from {behavior.upper_force[0]:.0f} N on; the profile reacts from"
        f" {parts.profile.threshold.f_base_n:g} N above the mean.",
        flush=True,
    )
    priority = command.priority and min(command.priority + 1, 99)
    with children_undisturbed():
        connected = FrankaArm(address, kind, parts.model, behavior=behavior, priority=priority)
    with connected as arm, network_units(command, parts) as units:
        notes = (arm.missing,) if arm.missing else ()
        yield Opened(FrankaSessionArm(arm, kind, address), units or NoUnits(), known, units, notes=lambda: notes)
