"""Short motions."""

import numpy as np

from pretouch.calibration.motion.plan import Plan, Swing

START = np.array([0.0, -0.4, 0.0, -2.0, 0.0, 1.8, 0.6])


def short_plan(postures: int = 4, swing_s: float = 6.0, seed: int = 0) -> Plan:
    """Stand in some postures; in the first and in the third, swing all joints at once."""
    rng = np.random.default_rng(seed)
    stands = [START, *(START + rng.uniform(-0.5, 0.5, (postures - 1, 7)))]
    knots, ways, swings = [0.0], [START], []
    for i, (here, there) in enumerate(zip(stands, [*stands[1:], START], strict=True)):
        spans = [1.0, swing_s] if i in (0, 2) else [1.0]
        if i in (0, 2):
            amplitude = rng.uniform(0.1, 0.2, (1, 7))
            frequency = np.linspace(0.5, 1.1, 7)[None]
            swings.append(Swing(knots[-1] + 1.0, swing_s, 1.0, amplitude, frequency, rng.uniform(0, 6, (1, 7))))
        for span in spans:
            knots.append(knots[-1] + span)
            ways.append(here)
        knots.append(knots[-1] + 1.5)
        ways.append(there)
    return Plan(np.array(knots), np.array(ways), tuple(swings))
