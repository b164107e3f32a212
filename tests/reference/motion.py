"""From what is wanted and what is near to a quadratic program: path, eqs. 2-7, and the joint box."""

import numpy as np

from pretouch.control.path import Path
from pretouch.params import RestrictionParams, SpeedReduction, TaskParams
from pretouch.types import Obstacles
from tests.reference.geometry import Posture


class Fading:
    """Eqs. 3 and 4: the factor falls at once and rises no faster than from its last fall to 1 in l_max cycles."""

    def __init__(self, slow: SpeedReduction | None, l_max: int) -> None:
        self.slow, self.l_max, self.low, self.since = slow, l_max, 1.0, 0

    def factor(self, nearest: float, heard: float) -> float:
        """Let one cycle pass and return the factor; `nearest` [m] may be infinite, `heard` is that of silence."""
        fresh = min(heard, 1.0, nearest / self.slow.d_max_m) if self.slow else heard
        self.since += 1
        faded = self.low + (1.0 - self.low) * min(1.0, self.since / self.l_max)
        if fresh <= faded:
            self.low, self.since = fresh, 0
        return min(fresh, faded)


class Progress:
    """How far along the path the arm is, and how fast it may go by now."""

    def __init__(self, path: Path, params: TaskParams) -> None:
        self.path, self.params, self.phase, self.speed = path, params, 0.0, 0.0

    def forward(self, x: np.ndarray) -> float:
        """Speed along the path [m/s] at x (3,): less and less off the path."""
        off = np.linalg.norm(self.path.point(self.phase) - x)
        return self.speed * max(0.0, 1.0 - off / self.params.off_path_m)

    def velocity(self, x: np.ndarray) -> np.ndarray:
        """Velocity (3,) [m/s] along the path and back to it, no faster than allowed by now."""
        back = self.params.position_gain_1_s * (self.path.point(self.phase) - x)
        wanted = self.forward(x) * self.path.tangent(self.phase) + back
        size = np.linalg.norm(wanted)
        return wanted if size <= self.speed else wanted / size * self.speed

    def advance(self, x: np.ndarray, moving: np.ndarray) -> None:
        """Advance by what the hand's commanded velocity `moving` (3,) [m/s] achieves of the way along the path."""
        short = max(0.0, (self.velocity(x) - moving) @ self.path.tangent(self.phase))
        self.phase += max(0.0, self.forward(x) - short) * self.params.control_period_s
        if not self.path.closed:
            self.phase = min(self.phase, self.path.length)
        self.speed = min(
            self.speed + self.params.acceleration_m_s2 * self.params.control_period_s, self.params.speed_m_s
        )


def cost(
    J: np.ndarray, wanted: np.ndarray, q: np.ndarray, middle: np.ndarray, p: TaskParams
) -> tuple[np.ndarray, np.ndarray]:
    """H (n, n) and f (n,) of eq. 2, stacked as the least-squares problem it is.

    With B = [J; sqrt(mu + k) I], the manipulability of the damping mu is the product of the singular values of J.
    """
    w = float(np.prod(np.linalg.svd(J, compute_uv=False)))
    mu = p.damping_max * max(0.0, 1.0 - w / p.manipulability_threshold) ** 2
    k = p.mid_joint_gain
    B = np.vstack([J, np.sqrt(mu + k) * np.eye(len(q))])
    return B.T @ B, -J.T @ wanted - k * (middle - q) / p.mid_joint_time_s


def orientation_error(R: np.ndarray, goal: np.ndarray) -> np.ndarray:
    """Axis times sine of the angle (3,) of the turn goal R^T, in the base frame: half the sum of r x g by columns."""
    return 0.5 * sum(np.cross(R[:, i], goal[:, i]) for i in range(3))


def limit(d: float, p: RestrictionParams) -> float:
    """Eqs. 5-7: the largest approach velocity [m/s] at a distance from the body [m], infinite from d_notice on."""

    def logistic(x: float) -> float:
        return p.v_max_m_s / (1.0 + np.exp(min(p.beta * (2.0 * x - 1.0), 700.0)))

    if d >= p.d_notice_m:
        return np.inf
    if d < p.d_repulse_m:
        value = logistic(d / p.d_crit_m) - p.v_max_m_s
    else:
        value = logistic((d - p.d_crit_m) / (p.d_notice_m - p.d_crit_m))
    return max(value, p.floor_m_s) if p.rows == "floor" else value


def approach_rows(
    posture: Posture, obstacles: Obstacles, p: RestrictionParams | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """G (K', n), h (K',) and which obstacles (K',) they are of."""
    which, G, h = [], [], []
    for k in range(len(obstacles.unit) if p else 0):
        bound = limit(float(obstacles.body_distance[k]), p)
        if np.isfinite(bound):
            J = posture.jacobian(int(obstacles.link[k]), obstacles.body_point[k])
            which.append(k)
            G.append(obstacles.direction[k] @ J[:3])
            h.append(bound)
    return np.reshape(G, (-1, len(posture.twist))), np.array(h), np.array(which, dtype=np.int64)


def viable(distance: float, a: float, dt: float) -> float:
    """Largest speed [rad/s] from which a joint held for dt at a time can stop within `distance` [rad].

    After v dt the joint brakes by a dt each step, so in n more steps it goes (n + 1) v dt - a dt^2 n (n + 1) / 2. The
    whole way is the largest of these over n, so the bound is the least of those for each n.
    """
    d = max(distance, 0.0)
    n = np.arange(int(np.sqrt(2.0 * d / a) / dt) + 3)
    return float(((d / dt + a * dt * n * (n + 1) / 2.0) / (n + 1)).min())


def joint_box(
    q: np.ndarray, qd: np.ndarray, low: np.ndarray, high: np.ndarray, speed: np.ndarray, a: np.ndarray, dt: float
) -> tuple[np.ndarray, np.ndarray]:
    """Bounds (n,) [rad/s] on the next command: viable, within the speed, and above all what acceleration can reach."""
    lower, upper = np.zeros(len(q)), np.zeros(len(q))
    for j in range(len(q)):
        reach = qd[j] - a[j] * dt, qd[j] + a[j] * dt
        upper[j] = np.clip(min(speed[j], viable(high[j] - q[j], a[j], dt)), *reach)
        lower[j] = np.clip(-min(speed[j], viable(q[j] - low[j], a[j], dt)), *reach)
    return lower, upper


def brake(qd: np.ndarray, lower: np.ndarray, upper: np.ndarray, a: np.ndarray, dt: float) -> np.ndarray:
    """Slow all joints (n,) [rad/s] by one factor, as much as the one that needs longest allows, within the box."""
    cycles = (np.abs(qd) / (a * dt)).max()
    return np.clip(qd * (1.0 - 1.0 / max(cycles, 1.0)), lower, upper)
