"""What only a simulation knows."""

from pretouch.types import FloatArray
from pretouch.values import value


@value
class Truth:
    """What only a simulation knows, of the time since the cycle before. M instants of the physics."""

    time: FloatArray
    """(M,) instants of the physics [s]."""
    force: FloatArray
    """(M, 3) true contact force on the arm [N], base frame."""
    hand: FloatArray
    """(3,) centre of the person's hand [m], NaN without one."""
    touches: tuple[tuple[float, int, FloatArray], ...]
    """Beginnings of contacts: instant [s], link index, velocity (3,) of the touching point [m/s]."""
