"""What no command of any experiment may exceed."""

import numpy as np


def assert_within_limits(record, model):
    """Check position, velocity and acceleration limits on every command of a record."""
    arm = model.description
    commands = np.array([step.command for step in record.steps])
    positions = np.array([step.q_commanded for step in record.steps])
    period = 0.01
    after = positions + commands * period
    assert np.all(after >= model.q_min)
    assert np.all(after <= model.q_max)
    assert np.all(np.abs(commands) <= arm.qd_max + 1e-12)
    changes = np.diff(np.vstack([np.zeros(model.n), commands]), axis=0)
    assert np.all(np.abs(changes) <= arm.qdd_max * period + 1e-12)
