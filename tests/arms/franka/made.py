"""States, and an arm that checks what it is told."""

import numpy as np

from pretouch.arms.franka.limits import FrankaLimits
from pretouch.arms.franka.state import FrankaState

DT = 1e-3


def state(**changed) -> FrankaState:
    values = {name: np.arange(7.0) + 10.0 * i for i, name in enumerate(("q", "qd", "q_d", "dq_d", "ddq_d", "tau_ext"))}
    plain = {"time": 1.25, "mode": "move", "errors": (), "last_motion_errors": (), "success_rate": 0.97}
    return FrankaState(**{**values, **plain, "wrench": np.arange(6.0) + 1.0, "m_ee": 0.73, "m_load": 0.0, **changed})


class CheckingArm:
    """The vendor's rules, written down once more: velocity, acceleration, jerk, position and the FR3's envelope."""

    def __init__(self, limits: FrankaLimits, q: np.ndarray) -> None:
        self.limits, self.q = limits, q
        self.qd, self.qdd = np.zeros(7), np.zeros(7)
        self.time = 0.0

    def state(self) -> FrankaState:
        zero = np.zeros(7)
        return FrankaState(
            self.time, "move", (), (), self.q, self.qd, self.q.copy(), self.qd.copy(), self.qdd.copy(), zero,
            np.zeros(6), 1.0, 0.0, 0.0,
        )  # fmt: skip

    def take(self, command: list[float] | None) -> None:
        """Follow a command; None is one that was lost."""
        limits = self.limits
        wanted = self.qd + self.qdd * DT if command is None else np.array(command)
        qdd = (wanted - self.qd) / DT
        jerk = (qdd - self.qdd) / DT
        assert np.all(np.abs(wanted) <= limits.qd_max)
        assert np.all(np.abs(qdd) <= limits.qdd_max)
        assert np.all(np.abs(jerk) <= limits.qddd_max)
        self.q, self.qd, self.qdd = self.q + wanted * DT, wanted, qdd
        self.time += DT
        assert np.all((self.q > limits.q_min) & (self.q < limits.q_max))
        if limits.envelope is not None:
            e = limits.envelope
            up = np.maximum(0, -e.offset + np.sqrt(np.maximum(0, e.slope * (e.q_upper - self.q))))
            down = np.maximum(0, -e.offset + np.sqrt(np.maximum(0, e.slope * (self.q - e.q_lower))))
            assert np.all(self.qd <= up + 1e-12)
            assert np.all(self.qd >= -down - 1e-12)


def middle(limits: FrankaLimits) -> np.ndarray:
    return (limits.q_min + limits.q_max) / 2
