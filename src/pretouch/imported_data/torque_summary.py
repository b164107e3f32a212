"""What decisions on recorded torques say: alarms in motion, residuals, evidence, and the force that is found."""

import numpy as np

from pretouch.imported_data.torque_detect import Instant, Stream, TorqueDecisions
from pretouch.types import FloatArray
from pretouch.values import value

PUSH_S = 0.1
"""How long a push is tried [s]."""
_AFTER_S = 0.05
"""Time after it in which it still counts as found [s]."""
_TRIED = 24
"""At how many instants."""
_LEAST_N, _MOST_N = 0.5, 500.0
_TIMES = 8
"""Bisections, on a logarithmic scale."""


@value
class TorqueSummary:
    """How a detector fared on torques."""

    duration: float
    """Time in which it was armed [s]."""
    motion: float
    """Part of it in which the arm moved [s]."""
    in_motion: int
    """Contacts that began in motion."""
    per_hour: float
    """Those in an hour of motion; false alarms, if nobody touched the arm. NaN without motion."""
    mean: FloatArray
    """(n,) of the residual outside contacts [Nm], NaN where there is none."""
    sigma: FloatArray
    """(n,) its standard deviation [Nm]."""
    before: FloatArray
    """(n,) that of the external torques [Nm]."""
    evidence: float
    """Largest outside contacts."""
    detectable_n: float
    """Force at the end-effector that the detector itself says it finds: median outside contacts [N]; NaN if it does not
    say."""
    push: FloatArray
    """(M,) smallest forces at the end-effector that are found if they last `PUSH_S`, tried at some instants along all
    axes [N]; infinite beyond `_MOST_N`."""

    def push_quantile(self, share: float) -> float:
        """Force with which such a share of the pushes is found [N]; NaN where none was tried."""
        return float(np.quantile(self.push, share, method="inverted_cdf")) if len(self.push) else np.nan


def torque_summary(stream: Stream, d: TorqueDecisions) -> TorqueSummary:
    """Sum decisions up, and try pushes."""
    period, n = stream.body.period, stream.model.n
    judged = d.armed & np.isfinite(d.residual).all(axis=1)
    free = judged & ~d.touched
    motion = float((judged & d.moving).sum() * period)
    begins = np.searchsorted(d.time, [c.time for c in d.contacts])
    in_motion = int(d.moving[begins].sum())
    some, nothing = bool(free.any()), np.full(n, np.nan)
    return TorqueSummary(
        duration=float(judged.sum() * period), motion=motion, in_motion=in_motion,
        per_hour=3600.0 * in_motion / motion if motion else np.nan,
        mean=d.residual[free].mean(axis=0) if some else nothing,
        sigma=d.residual[free].std(axis=0) if some else nothing,
        before=d.tau_ext[free].std(axis=0) if some else nothing,
        evidence=float(d.evidence[free].max()) if some else np.nan,
        detectable_n=float(np.median(d.detectable_n[free])) if some else np.nan,
        push=_pushes(stream, d),
    )  # fmt: skip


def _pushes(stream: Stream, d: TorqueDecisions) -> FloatArray:
    ahead = round((PUSH_S + _AFTER_S) / stream.body.period)
    calm = np.isfinite(d.residual).all(axis=1) & d.armed & ~d.touched & ~stream.first
    usable = [k for k in d.kept if k.cycle + ahead < len(d.time) and calm[k.cycle : k.cycle + ahead].all()]
    tried = [usable[i] for i in np.unique(np.linspace(0, len(usable) - 1, _TRIED).astype(int))] if usable else []
    axes = [sign * axis for axis in np.eye(3) for sign in (1.0, -1.0)]
    return np.array([_smallest(stream, instant, axis, ahead) for instant in tried for axis in axes])


def _smallest(stream: Stream, instant: Instant, axis: FloatArray, ahead: int) -> float:
    if not _is_found(stream, instant, _MOST_N * axis, ahead):
        return np.inf
    low, high = np.log(_LEAST_N), np.log(_MOST_N)
    for _ in range(_TIMES):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if _is_found(stream, instant, np.exp(middle) * axis, ahead) else (middle, high)
    return float(np.exp(high))


def _is_found(stream: Stream, instant: Instant, force: FloatArray, ahead: int) -> bool:
    """Whether a force (3,) [N] at the end-effector from a cycle on is detected, as late as an observer tells of it."""
    cycle, state, window = instant
    period, reached = stream.body.period, 0.0
    gain = getattr(stream.profile.detect, "observer_gain_1_s", 60.0)
    keep = np.exp(-gain * period)
    for k in range(ahead):
        reached = keep * reached + (1.0 - keep) * float((k + 0.5) * period < PUSH_S)
        sample, window = stream.sample(cycle + k, window, reached * force)
        found, state = stream.detector.step(state, stream.body, sample)
        if found.contact is not None:
            return True
    return False
