"""Driving the arm from a page, by a target of its hand."""

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation
from viser import ViserServer

from pretouch import desired
from pretouch.desired import Desired
from pretouch.page.arm import quaternions
from pretouch.page.panel import ActionQueue
from pretouch.page.simulation import LiveSimulation, nobody
from pretouch.types import ControlStep, FloatArray

TASKS = ("follow the path", "drive yourself")
REACH_M = 1.2
"""Largest coordinate of a target [m]."""
_HOW = (
    "<div id='driving' style='padding:0 12px 8px;font-size:12px;line-height:1.35'>Drag the target at the hand. Blue:"
    " requested motion. Green: allowed motion.</div>"
)
_STEP_M = 0.003
"""How far the hand moves before the target that waits at it follows [m]."""


class Steering:
    """A commander that asks for a pose; for no motion before the first. No page, no thread, no clock."""

    def __init__(self) -> None:
        self.attended = False
        """True if who steers is there: else what is asked ages, and the arm comes to rest."""
        self.goal: FloatArray | None = None
        """(4, 4) T_O_ee to go to; None: no motion is asked for."""
        self._stamp = 0.0

    def target(self, position: FloatArray, rotation: FloatArray) -> None:
        """Ask for a position (3,) [m], or the nearest in the workspace, and an orientation (3, 3), base frame."""
        self.goal = np.eye(4)
        self.goal[:3, :3], self.goal[:3, 3] = rotation, np.clip(position, -REACH_M, REACH_M)

    def __call__(self, now: float) -> Desired:
        """Return what is asked at an instant [s]."""
        self._stamp = now if self.attended else min(self._stamp, now)
        if self.goal is not None:
            return desired.pose(self._stamp, self.goal)
        return desired.twist(self._stamp, np.zeros(3))


class Drive:
    """The control of who has the arm move, and the target. The visitor who drove last is the one who asks."""

    def __init__(self, server: ViserServer, simulation: LiveSimulation, actions: ActionQueue) -> None:
        self._server, self._simulation, self._actions = server, simulation, actions
        self.steering, self._driver = Steering(), -1
        task = server.gui.add_dropdown("Task", TASKS, hint="The arm follows your target, within its limits.")
        task.on_update(self._choose_task)
        self._how = server.gui.add_html(_HOW, visible=False)
        limits = (-REACH_M, REACH_M)
        self._target = server.scene.add_transform_controls(
            "/target", 0.22, translation_limits=(limits, limits, limits), depth_test=False, visible=False
        )
        self._target.on_update(self._drag)

    @property
    def on(self) -> bool:
        """True while the arm is driven."""
        return self._simulation.commander is self.steering

    async def _choose_task(self, event: Any) -> None:
        visitor, task = event.client_id, event.target.value
        if visitor is not None:
            self._actions.put(lambda: self._begin(visitor, task), "task")

    def _begin(self, visitor: int, task: str) -> None:
        self._driver, self.steering.goal = visitor, None
        self._simulation.commander = self.steering if task == TASKS[1] else nobody
        self._target.visible = self._how.visible = self.on

    async def _drag(self, event: Any) -> None:
        visitor, position, wxyz = event.client_id, np.array(event.target.position), np.array(event.target.wxyz)
        if event.phase == "update" and visitor is not None:
            self._actions.put(lambda: self._aim(visitor, position, wxyz), "drive", quiet=True)

    def _aim(self, visitor: int, position: FloatArray, wxyz: FloatArray) -> None:
        if np.linalg.norm(wxyz) > 0.5:  # else it is no orientation
            self._driver = visitor
            self.steering.target(position, Rotation.from_quat(wxyz, scalar_first=True).as_matrix())

    def turn(self) -> None:
        """Look, before time passes, whether who drove last is still there."""
        self.steering.attended = self._driver in self._server.get_clients()

    def draw(self, step: ControlStep) -> None:
        """Have a target that nobody has dragged wait at the hand."""
        if not self.on or self.steering.goal is not None:
            return
        if np.linalg.norm(self._target.position - step.ee_position) > _STEP_M:
            model = self._simulation.model
            rotation = model.kinematics(step.q).rotation[model.ee]
            self._target.position, self._target.wxyz = step.ee_position, quaternions(rotation)
