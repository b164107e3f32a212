"""The units of a skin as they speak over the network: one each, however many zones its sensor has."""

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import accumulate


@dataclass(frozen=True)
class NetworkUnits:
    """B units in the order of the skin. What units measure has K rows, one for each zone (`Skin`)."""

    ids: tuple[str, ...]
    """Their names: those of keys and traffic."""
    zones: tuple[int, ...]
    """Zones along each side of each one's sensor; 1: a single range."""

    @classmethod
    def of(cls, units: "NetworkUnits | Iterable[str]") -> "NetworkUnits":
        """Return units as they are, or those of these names, none of which has zones."""
        if isinstance(units, NetworkUnits):
            return units
        ids = tuple(units)
        return cls(ids, (1,) * len(ids))

    @property
    def first(self) -> tuple[int, ...]:
        """Row of each one's range, or of its first zone's; touch and IMU are told there too."""
        return tuple(accumulate((side**2 for side in self.zones[:-1]), initial=0))[: len(self.ids)]

    @property
    def rows(self) -> int:
        """K."""
        return sum(side**2 for side in self.zones)
