"""What is played: scenarios as their files fix them."""

from dataclasses import dataclass
from functools import cache
from typing import Any

from pretouch.errors import ExperimentError
from pretouch_lab.benchmarks.scenario_files import SeedRange, scenario, seed_of

FAMILIES = ("srdo", "drdo", "person", "hand", "static", "sensing", "arm", "walking")
"""Files, less `avoidance-`, in the order in which they are shown."""
_FAMILY_ONLY = ("family", "text", "source", "seeds", "variant")

Table = dict[str, Any]


@dataclass(frozen=True)
class Scenario:
    """One scene with all that its file says; trials of it differ by their seed."""

    name: str
    family: str
    text: str
    """What happens, in a sentence."""
    params: Table
    """The file's keys, with what this scenario has in place of them."""
    count: int
    """Trials of each baseline in a full run."""
    quick: int
    """Trials of each baseline in a quick run."""

    def seeds(self, seeds: SeedRange, quick: bool) -> list[int]:
        """Return the seeds of a run's trials."""
        family = _family(self.family)
        return [seed_of(family, seeds, number) for number in range(self.quick if quick else self.count)]

    def __hash__(self) -> int:
        return hash(self.name)


def _family(name: str) -> Table:
    return scenario(f"avoidance-{name}")


@cache
def scenarios() -> dict[str, Scenario]:
    """Return all scenarios by their names; a file that was changed since is an ExperimentError."""
    found: dict[str, Scenario] = {}
    for family in FAMILIES:
        given = _family(family)
        shared = {key: value for key, value in given.items() if key not in _FAMILY_ONLY}
        for variant in given["variant"]:
            own = {key: value for key, value in variant.items() if key not in ("name", "count", "quick")}
            params = {**shared, **{key: _over(shared.get(key), value) for key, value in own.items()}}
            name = variant["name"]
            if name in found:
                raise ExperimentError(f"There are two scenarios {name!r}: give each its own name.")
            found[name] = Scenario(name, given["family"], given["text"], params, variant["count"], variant["quick"])
    return found


def _over(shared: Any, own: Any) -> Any:
    """Return a variant's value, or its table's entries over the family's."""
    return {**shared, **own} if isinstance(shared, dict) and isinstance(own, dict) else own
