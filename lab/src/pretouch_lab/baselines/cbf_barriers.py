"""The barriers and the objective of OSCBF's velocity formulation, in JAX, for cbfpy; imported only where it runs.

Of cbfpy's two solvers ElastiQP is the faster one here: 1.2 ms a step in place of 2.0 ms with qpax, or 1.4 ms with that
and JAX 0.4.30, which cbfpy once recommended.
"""

import os

# what cbfpy recommends on a processor, and warns of otherwise; JAX reads it as it is imported
os.environ.setdefault("JAX_ENABLE_X64", "1")
os.environ.setdefault("JAX_PLATFORMS", "cpu")
os.environ.setdefault("XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import jax
import jax.numpy as jnp
import numpy as np
from cbfpy import CBF, CBFConfig

from pretouch.control.interface import MotionBody
from pretouch.types import FloatArray

MOST = 32
"""Points that are taken, nearest first: JAX compiles for one number."""
_FAR_M = 100.0
"""Where a point is that stands for none [m]."""
_ZERO = 1e-12
"""Added under a root, whose slope is infinite at 0 [m^2]."""


@jax.tree_util.register_static
class VelocityBarriers(CBFConfig):  # type: ignore[misc]  # cbfpy has no types
    """State q, control qd: h >= 0 of joint limits, and of each capsule's distance from each point."""

    def __init__(self, body: MotionBody, gain: float) -> None:
        model, limits = body.model, body.limits
        rest, capsules = model.kinematics(np.zeros(model.n)), model.body
        R, p = rest.rotation[capsules.link], rest.position[capsules.link]
        self._a, self._b = (p + np.einsum("cij,cj->ci", R, end) for end in (capsules.a, capsules.b))
        self._radius, self._joints = capsules.radius, model.moved_by[capsules.link].sum(axis=1) - 1
        self._anchor, self._axis, self._gain = rest.anchor, rest.axis, gain
        self._q_min, self._q_max = limits.q_min, limits.q_max
        n = model.n
        seed = *no_points(), np.eye(n), model.ee_jacobian(model.kinematics(model.q_mid))
        super().__init__(n, n, -limits.qd_max, limits.qd_max, solver_tol=1e-6, backend="elastiqp", init_args=seed)

    def f(self, z: jax.Array, *given: jax.Array) -> jax.Array:
        """A velocity is what is commanded: nothing drifts."""
        return jnp.zeros(self.n)

    def g(self, z: jax.Array, *given: jax.Array) -> jax.Array:
        """The joints do as they are commanded."""
        return jnp.eye(self.n)

    def h_1(
        self, z: jax.Array, point: jax.Array, spread: jax.Array, M: jax.Array, J: jax.Array
    ) -> jax.Array:  # fmt: skip
        """Distances from joint limits [rad], then of C capsules from K points, less the points' spread [m]."""
        a, b = self._placed(z)
        axis, to = (b - a)[:, None], point[None] - a[:, None]
        along = jnp.clip((to * axis).sum(-1) / jnp.maximum((axis * axis).sum(-1), _ZERO), 0.0, 1.0)
        away = to - along[..., None] * axis
        gap = jnp.sqrt((away * away).sum(-1) + _ZERO) - self._radius[:, None] - spread[None]
        return jnp.concatenate([self._q_max - z, z - self._q_min, gap.ravel()])

    def _placed(self, q: jax.Array) -> tuple[jax.Array, jax.Array]:
        """Ends (C, 3) of the capsules' axes, base frame [m]: a product of exponentials from the joints' zero."""
        R, t, turned, moved = jnp.eye(3), jnp.zeros(3), [], []
        for j in range(self.n):
            x, y, z = self._axis[j]
            K = np.array(((0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0)))
            own = jnp.eye(3) + jnp.sin(q[j]) * K + (1.0 - jnp.cos(q[j])) * (K @ K)
            t = t + R @ (self._anchor[j] - own @ self._anchor[j])
            R = R @ own
            turned.append(R)
            moved.append(t)
        R, t = jnp.stack(turned)[self._joints], jnp.stack(moved)[self._joints]
        return tuple(t + jnp.einsum("cij,cj->ci", R, end) for end in (self._a, self._b))

    def alpha(self, h: jax.Array, *given: jax.Array) -> jax.Array:
        """How fast a barrier may be approached [1/s] times what is left of it."""
        return self._gain * h

    def P(self, z: jax.Array, u_des: jax.Array, *given: jax.Array) -> jax.Array:
        """The weight of a change of the command: in the task, and in its null space, both 1."""
        M, J = given[2:]
        N = jnp.eye(self.n) - consistent_inverse(M, J) @ J
        return N.T @ N + J.T @ J

    def q(self, z: jax.Array, u_des: jax.Array, *given: jax.Array) -> jax.Array:
        """The linear term that goes with it."""
        return -u_des @ self.P(z, u_des, *given)


def consistent_inverse(M: jax.Array, J: jax.Array) -> jax.Array:
    """Dynamically consistent inverse (n, 6) of a Jacobian (6, n), damped at singularities."""
    weighted = jnp.linalg.solve(M, J.T)
    return weighted @ jnp.linalg.inv(J @ weighted + _DAMPING * jnp.eye(6))


_DAMPING = 1e-6
"""Added to the inverse inertia of the task [1/kg]: where it is singular the published formulation divides by 0."""


class SafetyFilter:
    """From joint velocities that are wanted to those that keep the barriers."""

    def __init__(self, body: MotionBody, gain: float) -> None:
        self._cbf = CBF.from_config(VelocityBarriers(body, gain))
        n = body.model.n
        self._twist = jax.jit(lambda M, J, v: consistent_inverse(M, J) @ v)
        M, J = np.eye(n), np.eye(6, n)
        self(np.zeros(n), self.of_twist(M, J, np.zeros(6)), *no_points(), M, J)  # compiles both

    def __call__(
        self, q: FloatArray, qd: FloatArray, point: FloatArray, spread: FloatArray, M: FloatArray, J: FloatArray
    ) -> FloatArray:
        """Return joint velocities (n,) [rad/s] nearest to those wanted."""
        return np.asarray(self._cbf.safety_filter(q, qd, point, spread, M, J))

    def of_twist(self, M: FloatArray, J: FloatArray, twist: FloatArray) -> FloatArray:
        """Joint velocities (n,) [rad/s] of a twist (6,) of the end-effector."""
        return np.asarray(self._twist(M, J, twist))


def no_points() -> tuple[FloatArray, FloatArray]:
    """Return positions and spreads of as many points as are taken, none of which is there."""
    return np.full((MOST, 3), _FAR_M), np.zeros(MOST)
