"""A second arm in a simulated scene: it shares the first arm's world, and has errors and sensors of its own."""

from collections.abc import Callable

import numpy as np

from pretouch.robot.model import RobotModel
from pretouch.sim.physics import begin_step, end_step
from pretouch.sim.plant import ArmInWorld, Plant
from pretouch.sim.plant_params import PlantParams
from pretouch.sim.scene import BasePose, SecondArmSpec, body_before_second
from pretouch.sim.under_way import ROUNDING_S
from pretouch.types import FloatArray, RobotState


class SecondArm(ArmInWorld):
    """An arm in another arm's world; the first arm's `PlantClock` advances both.

    Create it, build the first arm with its `spec` in the scene, then call `join`. Its estimated force is in its own
    base frame. True contact forces are in the world frame.
    """

    def __init__(self, model: RobotModel, base: BasePose, params: PlantParams, seed: int) -> None:
        """Draw an arm that stands at `base`; the seed decides its errors and its noise."""
        super().__init__(model, params, seed)
        self.spec = SecondArmSpec(model, base, self.error)
        """Model, base and errors of this arm for the scene."""
        self._base = base
        self._torques: tuple[FloatArray, FloatArray] | None = None
        """Torques of the gears and of friction (n,), (n,) in the step under way [Nm]."""

    def join(self, first: Plant, q: FloatArray) -> None:
        """Start at rest at q (n,) [rad], in the world of an arm whose scene has the `spec`."""
        self._first, self.time = first, first.time
        built = first.mj_model
        before = body_before_second(built)
        joint = next(j for j in range(built.njnt) if built.jnt_bodyid[j] > before)
        self._enter(built, first.mj_data, joint, before, q)
        first.before_each_step(self._begin)

    def before_each_step(self, call: Callable[[float], float | None]) -> None:
        """Run `call(time)` before each physics step, see `ArmInWorld`."""
        self._first.before_each_step(call)

    def read(self) -> RobotState:
        """Return the state that the arm's interface reports now."""
        self.catch_up()
        return super().read()

    def catch_up(self) -> None:
        """Update sensors and errors after the last physics step, if time has passed since; `read` calls it."""
        if self._torques is None or self._first.time == self.time:
            return
        p, noise = self.params, self._noise * self._rng.standard_normal((2, self._n))
        self._age(p.period_s)
        self.time = self._first.time
        end_step(self._arm, *self._torques, noise[0], noise[1])
        self._torques = None
        if p.state_delay_s:
            self._states.append((self.time, self._arm.report.copy()))
        self._note_contacts([self.time])

    def _begin(self, time: float) -> None:
        """Drive the arm in the step that begins now."""
        self.catch_up()
        while self._late_commands and self._late_commands[0][0] <= time + ROUNDING_S:
            self._qd_set[:] = self._late_commands.popleft()[1]
        self._torques = begin_step(self._arm)

    def _in_base(self, point: FloatArray) -> FloatArray:
        T = self._base.T
        return np.asarray(T[:3, :3].T @ (point - T[:3, 3]))
