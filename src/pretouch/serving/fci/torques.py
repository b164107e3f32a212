"""Joint torques of the simulated arm as its interface tells them, without the errors of the torque sensors."""

import numpy as np

from pretouch.sim.plant import Plant
from pretouch.types import FloatArray


class JointTorques:
    """What the motors gave and the joints felt in the last physics step."""

    def __init__(self, plant: Plant) -> None:
        """Watch an arm."""
        self._plant, n, p = plant, plant.model.n, plant.params
        data = plant.mj_data
        self._applied, self._qd, self._qdd = data.qfrc_applied[:n], data.qvel[:n], data.qacc[:n]
        self._friction = np.array([p.friction_f1_nm, p.friction_f2_s_rad, p.friction_f3_rad_s])
        self._still = np.zeros(n)
        self._before = self._still
        self.measured, self.rate, self.desired = np.zeros(n), np.zeros(n), np.zeros(n)
        """(n,) torques on the side of the links [Nm] and their rate of change [Nm/s]; those asked for beyond gravity
        [Nm]."""
        self._known = False
        plant.before_each_step(self._keep)

    def _keep(self, _time: float) -> None:
        self._before = self._qd.copy()

    def update(self, q: FloatArray) -> None:
        """Take in a physics step that led to measured positions q (n,) [rad]."""
        p, gravity = self._plant.params, np.empty(len(q))
        self._plant.model.mass_matrix_and_bias(q, self._still, gravity)
        lost = self._lost(self._before)
        motor = self._applied + lost
        measured = motor - p.armature_kg_m2 * self._qdd - p.friction_compensated * lost
        self.rate = (measured - self.measured) / p.period_s if self._known else self._still
        self.measured, self.desired, self._known = measured, motor - gravity, True

    def _lost(self, qd: FloatArray) -> FloatArray:
        """Torques (n,) [Nm] lost to friction at velocities qd (n,) [rad/s]."""
        f1, f2, f3 = self._friction
        return f1 / (1 + np.exp(-f2 * (qd + f3))) - f1 / (1 + np.exp(-f2 * f3))
