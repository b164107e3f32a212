"""An arm across the table from that of the live page: in the same world, under a controller of its own."""

from typing import TYPE_CHECKING

import numpy as np

from pretouch.contact.moving_thresholds import thresholds_of
from pretouch.control.path import Path
from pretouch.control.posture import brought_to
from pretouch.controller import Controller
from pretouch.loop import Cycle, Options, turn
from pretouch.profiles import Profile
from pretouch.robot.model import RobotModel
from pretouch.robot.other_arm import OtherArm
from pretouch.sensing.skin import Skin
from pretouch.sim.plant import Plant
from pretouch.sim.plant_params import PlantParams
from pretouch.sim.range_finder import RangeFinderParams, RangeFinders
from pretouch.sim.scene import BasePose, fixtures
from pretouch.sim.second_arm import SecondArm
from pretouch.viewer.arm import Arm, capsule_surfaces, quaternions
from pretouch.viewer.expectation import expectation, in_levels
from pretouch.viewer.frame import World
from pretouch.viewer.scene import draw_pedestal
from pretouch.viewer.units import Units
from pretouch.viewer.vendor import vendor_surfaces

if TYPE_CHECKING:
    from viser import ViserServer

_APART_M = 1.1
"""How far it stands from the page's own arm, face to face, where both follow the paper's paths [m]: they reach over the
middle. Arms with smaller paths stand nearer."""
_SEEDS_APART = 1_000_000
"""Its errors and its noise are another arm's."""


class Across:
    """The other arm. It follows the same path in its own base frame, and each is told where the other is.

    Profile and path are those that the session began with, until it begins again.
    """

    cycle: Cycle
    """The newest."""

    def __init__(self, model: RobotModel, skin: Skin, plant: PlantParams, seed: int, scale: float) -> None:
        """Draw the arm, for a scene to be built with its `spec`; paths are `scale` times the paper's."""
        self._model, self._skin, self._seed = model, skin, seed + _SEEDS_APART
        self._arm = SecondArm(model, BasePose((_APART_M * scale, 0.0, 0.0), np.pi), plant, self._seed)
        self.spec = self._arm.spec
        """What the scene needs to know of it."""

    def join(self, first: Plant, path: Path, profile: Profile, ranging: RangeFinderParams) -> None:
        """Begin at rest where the path begins, in the world of the page's own arm."""
        model, arm, known = self._model, self._arm, fixtures(first.scene)
        arm.join(first, brought_to(model, path.point(0.0)))
        self._units = RangeFinders(arm, self._skin, ranging, self._seed)
        self._controller = Controller(model, self._skin, known, path, profile)
        self._state = self._controller.init(arm.read())
        T = self.spec.base.T
        back = np.asarray(np.linalg.inv(T))
        self._first = OtherArm(first.model, back, first.read, known.capsules)
        self.told = OtherArm(model, T, arm.read, known.capsules)
        """Where this arm is, for the controller of the page's own."""

    def turn(self, tick: float) -> None:
        """Let one control cycle pass, at a tick [s]."""
        self.cycle = turn(self._controller, self._state, self._arm, self._units, tick, Options(moving=self._first))
        self._state = self.cycle.after


class DrawnAcross:
    """The other arm on the page, with its units."""

    def __init__(self, server: "ViserServer", world: World, base: BasePose) -> None:
        """Draw it as the page draws its own arm of a world, at another base."""
        scene, root, model, skin = server.scene, "/across", world.model, world.skin
        self._model, self._skin, self._profile = model, skin, world.profile
        turn = tuple(quaternions(base.T[None, :3, :3])[0].tolist())
        scene.add_frame(root, show_axes=False, position=base.position, wxyz=turn)
        found, _ = vendor_surfaces(model)
        self._arm = Arm(scene, model, skin, found or capsule_surfaces(model), root)
        self._units = Units(scene, skin, model.links, root)
        draw_pedestal(server, world.floor_height, root)

    def draw(self, across: Across, now: float) -> None:
        """Show its newest cycle at a time of the machine [s]."""
        step, inputs = across.cycle.step, across.cycle.inputs
        kin, sight = self._model.kinematics(step.q), self._profile.sight
        self._arm.place(kin)
        self._arm.paint(
            in_levels(expectation(step.obstacles, len(self._skin), thresholds_of(self._profile.detect))), now
        )
        late = step.stamp - inputs.readings.stamp > sight.silent_after_s
        self._units.draw(step, kin, late, self._profile.perception is not None)
