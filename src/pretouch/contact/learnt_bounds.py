"""Which free motion an arm can have: bounds by physics on what a file says was learnt of it."""

import numpy as np

from pretouch.contact.residual_model import PLAIN, ResidualModel
from pretouch.errors import ParameterError
from pretouch.robot.model import RobotModel

_NOISIEST = 100.0
"""Noise of the measured joint velocities times the observer's gain [rad/s^2]: a real Panda's is 0.5."""


def check_learnt(learnt: ResidualModel, model: RobotModel) -> None:
    """Refuse, by a ParameterError, what no free motion of an arm can be: believed, it would hide every contact.

    Offset, friction and noise of a joint stay within the torque it can give, the error of a link's mass within that
    mass, and an unknown load within the mass of the arm. None is less certain than by its bound.
    """
    torque, n = model.description.tau_max, model.n
    largest = np.column_stack([*[torque] * PLAIN, np.ones((n, n)), np.full(n, model.mass.sum())])
    noisiest = np.stack([np.full(n, _NOISIEST), torque]) ** 2
    known = np.diagonal(learnt.covariance, axis1=1, axis2=2)
    for name, found, bound in (
        ("weight", np.abs(learnt.weights), largest), ("variance", known, largest**2),
        ("spread", learnt.spread.max(axis=0), noisiest),
    ):  # fmt: skip
        at = np.unravel_index(int(np.argmax(found / bound)), bound.shape)
        if not found[at] <= bound[at]:
            raise ParameterError(
                f"What was learnt has a {name} of {found[at]:.3g}, beyond the {bound[at]:.3g} that this arm can have:"
                " learn it anew."
            )
