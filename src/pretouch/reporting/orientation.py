"""Force limits of body regions, to hold the recorded forces against: for orientation, not conformity."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pretouch.errors import ParameterError
from pretouch.toml_files import read_toml


@dataclass(frozen=True)
class Region:
    """What a region of the body is said to bear."""

    name: str
    transient: float | None
    """Force of a contact of less than 0.5 s [N], None if the source has none."""
    quasi_static: float
    """Force of a contact that lasts [N]."""


@dataclass(frozen=True)
class BodyLimits:
    """Regions, and where their figures were read."""

    source: str
    regions: tuple[Region, ...]


ISO_TS_15066 = BodyLimits(
    "ISO/TS 15066:2016, table A.2; transient figures are twice the quasi-static ones but for skull and face, where it"
    " has none",
    (
        Region("Skull and forehead", None, 130.0),
        Region("Face", None, 65.0),
        Region("Chest", 280.0, 140.0),
        Region("Abdomen", 220.0, 110.0),
        Region("Back and shoulders", 420.0, 210.0),
        Region("Upper arms and elbows", 300.0, 150.0),
        Region("Forearms and wrists", 320.0, 160.0),
        Region("Hands and fingers", 280.0, 140.0),
    ),
)
"""Public copies of the table disagree in places: give your own figures where it matters."""

_LARGEST_N = 1e5
_KEYS = {"name", "transient_n", "quasi_static_n"}


def load_limits(place: Path) -> BodyLimits:
    """Read a TOML file of `source` and `[[region]]` tables; what is wrong with it is a ParameterError."""
    try:
        data = read_toml(place)
    except OSError as error:
        raise ParameterError(f"The body limits {place} cannot be read: {error.strerror}: give another file.") from error
    except ValueError as error:  # not of UTF-8 or of TOML, an integer too long, brackets too deep
        raise ParameterError(f"The body limits {place} are not valid TOML: {error}.") from error
    entries, source = data.get("region"), data.get("source")
    if not isinstance(source, str) or not source.strip():
        raise ParameterError(f'The body limits {place} name no source: write source = "where the figures are from".')
    if not isinstance(entries, list) or not entries:
        raise ParameterError(
            f"The body limits {place} have no [[region]]: give at least one with name, quasi_static_n and transient_n."
        )
    return BodyLimits(source, tuple(_region(place, entry) for entry in entries))


def _region(place: Path, entry: Any) -> Region:
    name = entry.get("name") if isinstance(entry, dict) else None
    if not isinstance(name, str) or not name.strip():
        raise ParameterError(f"The body limits {place} have a region without a name: give each [[region]] one.")
    unknown = sorted(set(entry) - _KEYS)
    if unknown:
        raise ParameterError(
            f"The region {name!r} in {place} has the unknown key {unknown[0]!r}: use name, transient_n, quasi_static_n."
        )
    transient = _force(place, name, entry, "transient_n") if "transient_n" in entry else None
    return Region(name, transient, _force(place, name, entry, "quasi_static_n"))


def _force(place: Path, name: str, entry: dict[str, Any], key: str) -> float:
    value: Any = entry.get(key)
    if type(value) not in (int, float) or not 0 < value <= _LARGEST_N:
        raise ParameterError(
            f"The region {name!r} in {place} has {key} = {value!r}: give a force in N, more than 0 and up to"
            f" {_LARGEST_N:g}."
        )
    return float(value)
