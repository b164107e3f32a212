"""Driving the arm from a page: by a target of its hand, by keys, or by a gamepad."""

from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial.transform import Rotation

from pretouch.types import ControlStep, FloatArray
from pretouch.viewer.action_queue import ActionQueue
from pretouch.viewer.arm import quaternions
from pretouch.viewer.drive_keys import script
from pretouch.viewer.simulation import LiveSimulation, nobody
from pretouch.viewer.steering import REACH_M, Steering, velocity_of

if TYPE_CHECKING:
    from pretouch.viewer.door import PageServer

TASKS = ("follow the path", "drive yourself")
_HOW = (
    "<div id='driving' style='padding:0 12px 8px;font-size:12px;line-height:1.35'>Drag the target at the hand; hold W,"
    " S, A, D, E or Q; or use a gamepad's sticks. Blue is asked, green is allowed.</div>"
)
_STEP_M = 0.003
"""How far the hand moves before the target that waits at it follows [m]."""


class Drive:
    """The control of who or what has the arm move, and the target. The visitor who drove last is the one who asks."""

    def __init__(self, server: "PageServer", simulation: LiveSimulation, actions: ActionQueue) -> None:
        self._server, self._simulation, self._actions = server, simulation, actions
        self.steering = Steering()
        self._driver = -1
        gui = server.gui
        task = gui.add_dropdown("Task", TASKS, hint="Driven, the arm does what you ask, as far as it may.")
        task.on_update(self._chosen)
        self._how = gui.add_html(_HOW, visible=False)
        # what the page's script says of keys and sticks: by a control, for nothing else goes through the door
        self._keys = gui.add_text("Keys", "", visible=False)
        gui.add_html(f"<style>div:has(> div > div > p > label[for='{self._keys._impl.uuid}']){{display:none}}</style>")
        self._run(script(self._keys._impl.uuid))
        limits = (-REACH_M, REACH_M)
        self._target = server.scene.add_transform_controls(
            "/target", 0.22, translation_limits=(limits, limits, limits), depth_test=False, visible=False
        )
        self._keys.on_update(self._pressed)
        self._target.on_update(self._dragged)

    def _run(self, source: str) -> None:
        """Have each page run a script; viser offers it for its own plots only."""
        from viser._messages import RunJavascriptMessage

        self._server.gui._websock_interface.queue_message(RunJavascriptMessage(source))

    @property
    def on(self) -> bool:
        """Whether the arm is driven."""
        return self._simulation.commander is self.steering

    async def _chosen(self, event: Any) -> None:
        if event.client_id is not None:
            task = event.target.value
            self._actions.put(lambda: self._choose(event.client_id, task), "task")

    def _choose(self, visitor: int, task: str) -> None:
        self._driver = visitor
        self.steering.stand()
        self._simulation.commander = self.steering if task == TASKS[1] else nobody
        self._target.visible = self._how.visible = self._keys.visible = self.on

    async def _pressed(self, event: Any) -> None:
        if event.client_id is None:
            return
        keys, camera = event.target.value, event.client.camera
        look = np.array(camera.look_at) - np.array(camera.position)
        self._actions.put(lambda: self._push(event.client_id, keys, look), "drive", quiet=True)

    def _push(self, visitor: int, keys: str, look: FloatArray) -> None:
        simulation = self._simulation
        velocity = velocity_of(keys, look, simulation.settings.profile.task.speed_m_s)
        self._driver = visitor
        self.steering.push(velocity, simulation.time)

    async def _dragged(self, event: Any) -> None:
        if event.phase != "update" or event.client_id is None:
            return
        place, turn = np.array(event.target.position), np.array(event.target.wxyz)
        self._actions.put(lambda: self._aim(event.client_id, place, turn), "drive", quiet=True)

    def _aim(self, visitor: int, place: FloatArray, turn: FloatArray) -> None:
        if np.linalg.norm(turn) > 0.5:  # else it is no orientation
            self._driver = visitor
            self.steering.target(place, Rotation.from_quat(turn, scalar_first=True).as_matrix())

    def turn(self) -> None:
        """Look, before time passes, whether who drove last is still there and commands."""
        self.steering.held = self._server.commander.holds(self._driver)

    def draw(self, step: ControlStep) -> None:
        """Have a target that nobody has dragged wait at the hand."""
        if not self.on or self.steering.goal is not None:
            return
        if np.linalg.norm(self._target.position - step.ee_position) > _STEP_M:
            model = self._simulation.model
            rotation = model.kinematics(step.q).rotation[model.ee]
            self._target.position, self._target.wxyz = step.ee_position, quaternions(rotation)
