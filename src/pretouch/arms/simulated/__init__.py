"""A rehearsal for `pretouch run`: a simulated arm with simulated units."""

from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass
from typing import ClassVar

from pretouch.arms import ArmOptions, ArmSetup, OpenedArm
from pretouch.errors import ParameterError


@dataclass(frozen=True)
class Simulated(ArmOptions):
    """A rehearsal without hardware: an arm in simulation, with simulated units if it has a skin."""

    seed: int = 0
    """Seed of everything that is random in the simulation."""
    simulated: ClassVar[bool] = True
    brings_units: ClassVar[bool] = True

    def check(self, setup: ArmSetup) -> None:
        """Refuse a negative seed."""
        if self.seed < 0:
            raise ParameterError(f"--seed is {self.seed}: give 0 or more.")

    @contextmanager
    def open(self, setup: ArmSetup) -> Iterator[OpenedArm]:
        """Run the arm in a thread, with units that send to a receiver on this machine."""
        from pretouch.arms.simulated.arm import ThreadedArm
        from pretouch.robot.model import RobotModel
        from pretouch.sensing.skin import Skin
        from pretouch.sim.imu import ImuParams
        from pretouch.sim.scene import SceneSpec
        from pretouch.units import HOST
        from pretouch.units.fleet import Fleet, FleetParams, simulated_keys
        from pretouch.units.skin import NetworkSkin

        model = RobotModel(setup.model.description)
        skin = setup.skin if setup.units else Skin((), setup.model)
        keys, params = simulated_keys(skin.network.ids, self.seed), FleetParams(imu=ImuParams())
        with ExitStack() as stack:
            units = stack.enter_context(NetworkSkin(skin.network, keys, HOST)) if len(skin) else None
            address = units.address if units else (HOST, 9)
            fleet = stack.enter_context(closing(Fleet(skin.network, keys, params, self.seed, address)))
            scene = SceneSpec(floor_height=setup.floor)
            arm = stack.enter_context(ThreadedArm(model, setup.start(), skin, fleet, scene))
            yield OpenedArm(
                arm,
                skin=units,
                push=lambda direction: arm.push(direction.axis),
                free_motion_id=f"{arm.name}, seed {self.seed}",
                left_out=lambda: arm.left_out,
                measured=arm.measured,
            )
