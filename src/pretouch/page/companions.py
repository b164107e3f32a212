"""Other arms beside that of the live page, each with another profile, and the same hand at all of them."""

from dataclasses import dataclass, replace

import numpy as np
from viser import LabelHandle, ViserServer

from pretouch.page.scene import CAMERA_AT, CAMERA_FROM, Scene
from pretouch.page.simulation import LiveSimulation
from pretouch.profiles import PROFILES
from pretouch.types import FloatArray

SIDE_BY_SIDE = ("blind", "paper", "pretouch")
"""Profiles that are compared, those of them that the page's own arm does not have."""
APART_M = 1.05
"""Distance between two arms [m], along y."""
_LOOK_FROM, _LOOK_AT = (5.0, 0.6, 1.6), (0.2, 0.15, 0.3)
"""Where the page looks from to see three arms, and at what [m]."""
_LABEL_AT = (0.0, 0.0, 0.95)


@dataclass
class Companion:
    """One arm beside the page's own."""

    name: str
    simulation: LiveSimulation
    scene: Scene
    label: LabelHandle
    most: float = 0.0
    """Largest force of a touch so far [N]."""


class Companions:
    """Arms that go through the same control cycles as the page's own, and whose hands go where its hand is to go.

    Each is a simulation of its own, at rest at first where its path begins, with the same seed, skin and silent units.
    """

    def __init__(self, server: ViserServer, main: LiveSimulation) -> None:
        own = main.settings.profile.name.partition(":")[0]
        others = [name for name in SIDE_BY_SIDE if name != own][:2]
        self._server, self._main, self._most = server, main, 0.0
        self._arms = [self._beside(name, side * APART_M) for name, side in zip(others, (-1.0, 1.0), strict=True)]
        self._own = server.scene.add_label("/own_label", own, position=_LABEL_AT)
        self._look(_LOOK_FROM, _LOOK_AT)

    def _beside(self, name: str, offset: float) -> Companion:
        main, root = self._main, f"/{name}"
        simulation = LiveSimulation(replace(main.settings, profile=PROFILES[name]), main.model, main.skin)
        scene = Scene(self._server, simulation.world, root, offset)
        label = self._server.scene.add_label(f"{root}/label", name, position=_LABEL_AT)
        return Companion(name, simulation, scene, label)

    def _look(self, place: tuple[float, float, float], at: tuple[float, float, float]) -> None:
        """Have all visitors look from a place (3,) [m] at another, and those that are still to come."""
        self._server.initial_camera.position, self._server.initial_camera.look_at = place, at
        for client in self._server.get_clients().values():
            client.camera.position, client.camera.look_at = np.array(place), np.array(at)

    def begin(self) -> None:
        """Begin again at time 0, as the page's own arm has."""
        self._most = 0.0
        for arm in self._arms:
            arm.most = 0.0
            arm.scene.trail.clear()
            arm.simulation.reset(object=self._main.settings.object)
            arm.scene.show_world(arm.simulation.world)

    def follow(self, steps: int) -> None:
        """Let the control cycles pass that the page's own arm went through."""
        self._most = max(self._most, _size(self._main.frame.true_force))
        for arm in self._arms:
            self._copy_settings(arm)
            arm.simulation.move_hand(self._main.hand_target)
            for _ in range(steps):
                arm.scene.trail.add(arm.simulation.single_step())
                arm.most = max(arm.most, _size(arm.simulation.frame.true_force))

    def _copy_settings(self, arm: Companion) -> None:
        """Have an arm go by what has been changed of the page's own, but for the profile."""
        settings, simulation = self._main.settings, arm.simulation
        simulation.commander = self._main.commander
        if simulation.settings.path != settings.path:
            simulation.set_path(settings.path)
            arm.scene.show_world(simulation.world)
        if simulation.settings.silenced != settings.silenced:
            simulation.silence(settings.silenced)

    def draw(self, now: float) -> None:
        """Show them at a time of the machine [s]."""
        for arm in self._arms:
            arm.scene.draw(arm.simulation.frame, now)
            arm.label.text = _label(arm.name, arm.simulation, arm.most)
        self._own.text = _label(self._main.settings.profile.name, self._main, self._most)

    def remove(self) -> None:
        """Take them out of the page."""
        self._own.remove()
        self._look(CAMERA_FROM, CAMERA_AT)
        for arm in self._arms:
            arm.scene.remove()


def _label(name: str, simulation: LiveSimulation, most: float) -> str:
    touch = f" · touched with {most:.0f} N" if most >= 1.0 else ""
    return f"{name}: {simulation.frame.step.mode.name}{touch}"


def _size(force: FloatArray | None) -> float:
    return 0.0 if force is None else float(np.linalg.norm(force))
