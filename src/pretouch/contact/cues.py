"""What sensor units say of a touch beside the arm's torques: where one is likelier, and where there is one."""

from functools import cache
from typing import Any, Self

import numpy as np

from pretouch.composition import Part
from pretouch.contact.detector import Body, Sample
from pretouch.types import FloatArray, IntArray
from pretouch.values import value


@value
class Cues:
    """Evidence of the units of one step, for detection and localisation. L links of the arm, C touched places."""

    gain: FloatArray
    """(L,) times a contact on each link is likelier than without the units; 1 where they say nothing. What localisation
    makes of a link with a touched place is that place alone."""
    link: IntArray
    """(C,) index of the link of each place that a unit says is touched."""
    point: FloatArray
    """(C, 3) these places, base frame [m]."""
    sigma: FloatArray
    """(C,) standard deviation of each in the worst direction [m]."""
    force: FloatArray
    """(C,) size of the force there [N], NaN where the unit measures none; nothing is inferred from it."""


@cache
def no_cues(links: int) -> Cues:
    """Return what units that say nothing say, of an arm with so many links: one for all steps, to be read only."""
    return Cues(np.ones(links), np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros(0), np.zeros(0))


def together(*cues: Cues) -> Cues:
    """Return what several kinds of units say together, at least one kind: gains multiply, places add up."""
    if len(cues) == 1:
        return cues[0]
    return Cues(
        # likelihood ratios of sensors that err independently
        np.prod([c.gain for c in cues], axis=0),
        np.concatenate([c.link for c in cues]),
        np.concatenate([c.point for c in cues]),
        np.concatenate([c.sigma for c in cues]),
        np.concatenate([c.force for c in cues]),
    )


class Cue(Part, group="pretouch.cues"):
    """What the units' touch readings say of a contact. As a detector, it is a frozen dataclass."""

    def on(self, body: Body) -> Self:
        """Return the cue for an arm with all prepared that does not change; by default itself."""
        return self

    def init(self, body: Body) -> Any:
        """Return what is remembered before the first step."""
        return None

    def step(self, state: Any, body: Body, sample: Sample) -> tuple[Cues | None, Any]:
        """Return what the units say in one step, None for nothing, and what to remember."""
        raise NotImplementedError
