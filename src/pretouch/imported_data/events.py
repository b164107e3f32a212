"""From what a detector says cycle by cycle to contacts, each with its time, place and force."""

from pathlib import Path

import numpy as np

from pretouch.contact.detector import Detection
from pretouch.robot.model import RobotModel
from pretouch.types import FloatArray
from pretouch.values import value

_OVER_S = 0.5
"""Time without evidence of a contact after which it is over [s]."""


@value
class ContactEvent:
    """A contact that a detector found, where its place was surest."""

    time: float
    """At which it was detected [s]."""
    end: float
    """Of the last evidence of it [s]."""
    link: str
    """The link that is touched; '' where the profile does not say."""
    point: FloatArray
    """(3,) where on its surface, base frame [m]; NaN likewise."""
    force: FloatArray
    """(3,) on the robot, base frame [N]: there, or else at the end-effector."""
    probability: float
    """That it is this link's rigid body; NaN likewise."""
    evidence: float
    """Largest of the contact."""


class Events:
    """Gathers contacts."""

    def __init__(self, model: RobotModel, place: Path) -> None:
        self._model, self._place = model, place
        self._found: list[ContactEvent] = []
        self._now: ContactEvent | None = None

    def add(self, time: float, d: Detection) -> None:
        """Take in a cycle."""
        if self._now is not None and time - self._now.end > _OVER_S:
            self._found.append(self._now)
            self._now = None
        if d.contact is not None and self._now is None:
            self._now = ContactEvent(time, time, "", np.full(3, np.nan), d.contact.force, np.nan, -1.0)
        if self._now is None or not d.armed or not d.evidence >= 1.0:
            return
        now, found = self._now, d.touched
        link, point, force, probability = now.link, now.point, now.force, now.probability
        # the place gathers what all samples say: it is surest late, when the evidence may have passed its peak
        if len(found.link) and not probability >= found.probability[0]:  # NaN: none is known yet
            link, point, force = self._model.links[found.link[0]], found.point[0], found.force[0]
            probability = float(found.probability[0])
        elif not link and d.contact is not None and d.evidence > now.evidence:
            force = d.contact.force
        self._now = ContactEvent(now.time, time, link, point, force, probability, max(now.evidence, d.evidence))

    def all(self) -> tuple[ContactEvent, ...]:
        """Return the contacts of all cycles."""
        return (*self._found, *([self._now] if self._now else []))
