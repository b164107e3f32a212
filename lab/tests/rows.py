"""Made-up records of trials."""

from types import SimpleNamespace

import numpy as np

from pretouch.types import Mode
from pretouch_lab.trial import Record


def made_up(times, true_force=None, touches=(), hand=None, **of_steps):
    """Return a record of control steps at some times with only what is given; other values are those of an idle arm."""
    steps = [
        SimpleNamespace(
            stamp=float(t),
            mode=Mode.TRACK,
            contact=None,
            ee_velocity=np.zeros(3),
            obstacles=SimpleNamespace(body_distance=np.zeros(0), unit=np.zeros(0, np.int64)),
        )
        for t in times
    ]
    for name, values in of_steps.items():
        for step, value in zip(steps, values, strict=True):
            setattr(step, name, value)
    force = np.zeros((len(times), 3)) if true_force is None else np.asarray(true_force, dtype=float)
    where = np.full((len(times), 3), np.nan) if hand is None else np.asarray(hand, dtype=float)
    return Record(steps, np.asarray(times, dtype=float), force, list(touches), where)
