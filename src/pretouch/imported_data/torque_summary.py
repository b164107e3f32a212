"""What decisions on recorded torques say: alarms in motion, residuals, evidence."""

import numpy as np

from pretouch.imported_data.torque_detect import TorqueDecisions
from pretouch.types import FloatArray
from pretouch.values import value


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


def torque_summary(d: TorqueDecisions, period: float) -> TorqueSummary:
    """Sum decisions up that were made every `period` [s]."""
    n = d.residual.shape[1]
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
    )  # fmt: skip
