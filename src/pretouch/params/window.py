"""Parameters of the force window (eq. 8)."""

from dataclasses import dataclass
from typing import Annotated

from pretouch.checks import Check, Checked, Fraction, NonNegative


@dataclass(frozen=True)
class WindowParams(Checked):
    """The sliding window of the external force (eq. 8): it tells when the controller has seen enough to detect."""

    samples: Annotated[int, Check(low=2)] = 100
    """Samples in the sliding window at the control rate; the paper does not say, the authors' code has 500."""
    alpha: Fraction = 0.1
    """Influence of an outlier on the value that enters the window, eq. 8 (Table I)."""
    lambda_: NonNegative = 0.75
    """Standard deviations beyond which a sample is an outlier, eq. 8 (Table I)."""
    freeze_while_reacting: bool = False
    """Whether the window stands still during a reaction, so that the push does not become its mean and the release a
    contact. Off in the paper; a rebound towards the person in 10 of 15 releases without it (prototype)."""
