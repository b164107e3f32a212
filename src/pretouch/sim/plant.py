"""The simulated arm behind its joint velocity interface: 1 kHz physics, joint impedance, sensors, observer."""

from bisect import bisect_left
from collections.abc import Callable
from itertools import accumulate, repeat

import mujoco
import numpy as np

from pretouch.errors import ParameterError
from pretouch.robot.model import RobotModel
from pretouch.sim.arm_in_world import TOUCH_N as TOUCH_N
from pretouch.sim.arm_in_world import ArmInWorld
from pretouch.sim.arm_in_world import PointForce as PointForce
from pretouch.sim.arm_in_world import Touch as Touch
from pretouch.sim.physics import take_steps
from pretouch.sim.plant_params import PlantParams
from pretouch.sim.scene import SceneSpec, build, stiffen
from pretouch.sim.under_way import ROUNDING_S
from pretouch.types import FloatArray


class Plant(ArmInWorld):
    """The arm that a scene is built round, and the time in it."""

    def __init__(self, model: RobotModel, scene: SceneSpec, params: PlantParams, q: FloatArray, seed: int) -> None:
        """Build an arm at rest at q (n,) [rad]; the seed decides its errors and its noise."""
        super().__init__(model, params, seed)
        self.scene = scene
        self._before_step: list[Callable[[float], float | None]] = []
        self._idle_until: list[float] = []
        self.time = 0.0
        built = build(model, scene, self.error)
        self._enter(built, mujoco.MjData(built), 0, 0, q)

    def before_each_step(self, call: Callable[[float], float | None]) -> None:
        """Have `call(time)` run before each physics step, as `ArmInWorld` says."""
        self._before_step.append(call)
        self._idle_until.append(-np.inf)

    def stiffen(self, thing: str, stiffness: float) -> None:
        """Give the contacts with a thing of the scene, by name, another stiffness [N/m].

        To be done while nothing is `touching`: a spring that is stiffened while compressed gives more energy than it
        took.
        """
        stiffen(self.mj_model, thing, stiffness, self.scene.damping_ratio)

    def advance(self, duration: float) -> None:
        """Let time pass [s], in whole physics steps."""
        p, n = self.params, self._n
        steps, done = round(duration / p.period_s), 0
        draws = self._rng.standard_normal((steps, 2, n))
        velocity_noise = p.velocity_noise_rad_s * draws[:, 0]
        torque_noise = self._torque_noise * draws[:, 1]
        past = np.empty((steps if p.state_delay_s else 0, 5, n))
        times = list(accumulate(repeat(p.period_s, steps), initial=self.time))
        self._age(duration)
        while done < steps:
            first, until = done, self._prepare_step()
            last = bisect_left(times, until, first + 1, steps)
            done += take_steps(
                self._qd_set, velocity_noise[first:last], torque_noise[first:last], past[first:last], self._arm
            )
            self.time = times[done]
            if p.state_delay_s:
                self._states.extend(zip(times[first + 1 : done + 1], past[first:done], strict=True))
            self._note_contacts(times[first + 1 : done + 1])

    def _prepare_step(self) -> float:
        """Do what is due before the next physics step, and return up to when nothing else will be [s]."""
        time = self.time
        for i, call in enumerate(self._before_step):
            if time >= self._idle_until[i]:
                idle = call(time)
                self._idle_until[i] = -np.inf if idle is None else idle
        until, late = min(self._idle_until, default=np.inf), self._late_commands
        while late and late[0][0] <= time + ROUNDING_S:
            self._qd_set = late.popleft()[1]
        return min(until, late[0][0] - 2 * ROUNDING_S) if late else until  # too early does no harm

    def grip(self, load_kg: float) -> None:
        """Carry a load at the TCP from now on [kg]; 0 puts it down. An arm that was built without a payload cannot."""
        if not self.error.payload > 0.0:
            raise ParameterError(
                "This arm has nothing at its TCP that could grip: give PlantParams.payload_kg above 0."
            )
        self.mj_model.body("payload").mass[:] = self.error.payload + load_kg


class PlantClock:
    """The port `Clock` of a simulated arm: each tick lets one control period pass."""

    def __init__(self, plant: Plant, period: float) -> None:
        """Take the arm and the control period [s]; one that is no whole number of physics steps is a ParameterError."""
        step = plant.params.period_s
        if round(period / step) < 1 or abs(period / step - round(period / step)) > 1e-6:
            raise ParameterError(
                f"The control period is {period:g} s: give a multiple of the physics step of {step:g} s."
            )
        self._plant, self._period = plant, period

    def tick(self) -> float:
        """Advance the physics by one period and return its time [s]."""
        self._plant.advance(self._period)
        return self._plant.time
