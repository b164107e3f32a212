"""What tells one trial from another, and what all trials of a run share."""

from dataclasses import dataclass, replace

from pretouch.params import Orientation, Profile, RestrictionMode, profile
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin

_SAFE = {"-y": "minus-y", "+y": "plus-y"}


@dataclass(frozen=True)
class Cell:
    """One cell of an experiment's table: all its trials differ by their seed only."""

    experiment: str
    profile: str
    where: dict[str, str]
    """What else tells the cell from the others, in the order of the table."""

    @property
    def name(self) -> str:
        """Name for files: safe characters only."""
        safe = [_SAFE.get(value, value) for value in self.where.values()]
        return "_".join([self.experiment, *safe, self.profile])


@dataclass(frozen=True)
class Context:
    """What all trials of a run share."""

    model: RobotModel
    skin: Skin
    stiffness: float
    """Contact stiffness of static objects [N/m]."""
    restrictions: RestrictionMode | None
    """Restriction mode for all experiments, or None for each experiment's own."""
    orientation: Orientation | None = None
    """Whether the hand's orientation is free or held, or None for the profile's own."""

    def profile(self, name: str, restrictions: RestrictionMode) -> Profile:
        """Return a profile by name, as this run has it; `restrictions` is the experiment's own mode.

        Without proximity there is nothing to restrict.
        """
        found = profile(name)
        if found.perception.enabled:
            found = replace(found, restriction=replace(found.restriction, mode=self.restrictions or restrictions))
        return replace(found, task=replace(found.task, orientation=self.orientation or found.task.orientation))
