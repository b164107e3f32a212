"""What is known to move beside the arm, such as another arm: where its body is, and how fast."""

import numpy as np

from pretouch.values import FloatArray, value


@value
class MovingFixtures:
    """Bodies beside the arm that move and are known: C capsules in the arm's base frame.

    What units see of them is no obstacle, while the arm keeps off them as off any: they are neither a person nor free
    space.
    """

    stamp: float
    """Instant at which they were there [s]."""
    a: FloatArray
    """(C, 3) one end of each axis [m]."""
    b: FloatArray
    """(C, 3) other end of each axis [m]."""
    radius: FloatArray
    """(C,) [m]."""
    a_velocity: FloatArray
    """(C, 3) velocity of the one end [m/s]."""
    b_velocity: FloatArray
    """(C, 3) velocity of the other end [m/s]."""

    def at(self, time: float) -> tuple[FloatArray, FloatArray]:
        """Return both ends (C, 3) of each axis [m] at an instant close to the stamp [s], at constant velocities."""
        after = time - self.stamp
        return self.a + after * self.a_velocity, self.b + after * self.b_velocity


SOMEWHERE = MovingFixtures(-np.inf, np.zeros((1, 3)), np.zeros((1, 3)), np.zeros(1), np.zeros((1, 3)), np.zeros((1, 3)))
"""Something that nobody has told of yet: the arm holds until then."""
