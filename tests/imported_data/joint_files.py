"""Joint torques as an arm would record them: a smooth motion, friction, noise, and pushes on a link."""

import numpy as np

from tests.imported_data.files import write_csv

RATE = 500.0
FRICTION = np.array([0.5, 0.8, 0.6, 1.0, 0.5, 0.3, 0.4])


class Moving:
    """A motion of all joints about the ready posture, with forces on links: (start, duration [s], link, force (3,))."""

    def __init__(self, model, seconds, pushes=(), rate=RATE, payload=0.0, seed=1):
        self.model, rng = model, np.random.default_rng(seed)
        t = self.time = np.arange(round(seconds * rate)) / rate
        n, kinds = model.n, np.arange(model.n)
        w, amplitude = 0.7 + 0.13 * kinds, 0.35
        self.q = model.description.q_ready + amplitude * np.sin(np.outer(t, w) + kinds)
        self.qd_d = amplitude * w * np.cos(np.outer(t, w) + kinds)
        qdd = -amplitude * w**2 * np.sin(np.outer(t, w) + kinds)
        self.qd = self.qd_d + 0.005 * rng.standard_normal((len(t), n))
        friction = FRICTION[:n] * np.tanh(self.qd_d / 0.1) + 0.3 * self.qd_d
        self.external = np.zeros((len(t), n))
        self.driving = np.zeros((len(t), n))
        for i, (q, qd) in enumerate(zip(self.q, self.qd_d, strict=True)):
            kin = model.kinematics(q)
            for start, duration, link, force in pushes:
                if start <= t[i] < start + duration:
                    k = model.link_index(link)
                    point = kin.position[k] + kin.rotation[k] @ model.mechanism.links.com[k]
                    self.external[i] += model.jacobian(kin, k, point)[:3].T @ np.array(force)
            mass, bias = model.mass_matrix_and_bias(q, qd, np.empty(n))
            load = payload * model.ee_jacobian(kin)[:3].T @ -model.gravity
            self.driving[i] = mass @ qdd[i] + bias - self.external[i] + friction[i] + load
        self.driving += 0.1 * rng.standard_normal((len(t), n))
        unknown, keep = self.external - friction, np.exp(-60.0 / rate)
        self.tau_ext = np.zeros((len(t), n))
        for i in range(1, len(t)):
            self.tau_ext[i] = keep * self.tau_ext[i - 1] + (1.0 - keep) * unknown[i]
        self.tau_ext += 0.05 * rng.standard_normal((len(t), n))

    def columns(self, *kinds, order=None):
        """Columns of the time and of kinds (names with * for the joint, and a factor if any)."""
        found = {"time_s": self.time}
        for kind, values in kinds:
            values = values if order is None else values[:, order]
            found |= {kind.replace("*", str(j + 1)): values[:, j] for j in range(values.shape[1])}
        return found

    def external_csv(self, file):
        return write_csv(
            file, self.columns(("q*_rad", self.q), ("dq*_rad_s", self.qd), ("dq_d*_rad_s", self.qd_d),
                               ("tau_ext*_Nm", self.tau_ext)),
        )  # fmt: skip

    def raw_csv(self, file, q=1.0, dq=1.0, tau=1.0, order=None, names=("q*_rad", "dq*_rad_s", "tau*_Nm")):
        kinds = zip(names, (q * self.q, dq * self.qd, tau * self.driving), strict=True)
        return write_csv(file, self.columns(*kinds, order=order))
