"""A rehearsal for `pretouch run`: a simulated arm with simulated units."""

from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
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
        """Refuse a seed that is none."""
        if self.seed < 0:
            raise ParameterError(f"--seed is {self.seed}: give 0 or more.")

    @contextmanager
    def open(self, setup: ArmSetup) -> Iterator[OpenedArm]:
        """Let the arm live in a thread, and its units send to a receiver of this machine."""
        from pretouch.arms.simulated.arm import SimulateOptions
        from pretouch.arms.simulated.threaded import ThreadedArm
        from pretouch.robot.model import RobotModel
        from pretouch.sensing.skin import Skin
        from pretouch.signals import children_undisturbed
        from pretouch.sim.scene import SceneSpec
        from pretouch.units.fleet import simulated_keys
        from pretouch.units.network_skin import NetworkSkin
        from pretouch.units.udp import HOST

        model = RobotModel(setup.model.description)
        skin = setup.skin if setup.units else Skin((), setup.model)
        keys = simulated_keys(skin.network.ids, self.seed)
        with children_undisturbed():
            receiver = NetworkSkin(skin.network, keys, HOST, 0) if len(skin) else nullcontext()
        with receiver as units:
            port = units.address[1] if units else 9
            options = SimulateOptions(model, skin, keys, HOST, port, hand=False, seed=self.seed)
            with ThreadedArm(options, setup.start(), SceneSpec(floor_height=setup.floor)) as arm:
                yield OpenedArm(
                    arm, skin=units, units=units, push=lambda direction: arm.push(direction.axis),
                    free_motion_id=f"{arm.name}, seed {self.seed}", left_out=lambda: arm.left_out,
                    measured=arm.measured,
                )  # fmt: skip
