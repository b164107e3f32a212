"""The scenario files: what is played, fixed with checksums before any detector was built."""

import tomllib
from collections.abc import Iterator
from hashlib import sha256
from importlib.resources import files
from pathlib import Path
from typing import Any, Literal

from pretouch.errors import ExperimentError

FOLDER = Path(str(files("pretouch_lab.benchmarks") / "scenarios"))
CHECKSUMS = "CHECKSUMS"
"""File in the folder with a line `DIGEST  NAME` (SHA-256) for each of the others, as `sha256sum` writes it."""

SeedRange = Literal["published", "development"]
"""Seeds for the published tables, and others to develop detectors with."""


def scenario_path(name: str, folder: Path = FOLDER) -> Path:
    """Return where a scenario file is, once it is found to be as it was fixed; an ExperimentError if it is not."""
    path, known = folder / name, checksums(folder)
    if name not in known:
        raise ExperimentError(f"The scenario file {name} has no checksum: choose from {', '.join(known)}.")
    try:
        digest = sha256(path.read_bytes()).hexdigest()
    except OSError as error:
        raise ExperimentError(f"The scenario file {path} cannot be read: {error.strerror}: install again.") from error
    if digest != known[name]:
        raise ExperimentError(
            f"The scenario file {path} was changed, its SHA-256 is {digest[:12]}..., not {known[name][:12]}...:"
            " scenarios are fixed before detectors are built, so put the file back."
        )
    return path


def scenario(name: str, folder: Path = FOLDER) -> dict[str, Any]:
    """Read a scenario file of this name without `.toml`; one that was changed is an ExperimentError."""
    return tomllib.loads(scenario_path(f"{name}.toml", folder).read_text(encoding="utf-8"))


def checksums(folder: Path = FOLDER) -> dict[str, str]:
    """Return the SHA-256 digest of each scenario file by its name."""
    try:
        lines = (folder / CHECKSUMS).read_text(encoding="utf-8").splitlines()
    except OSError as error:
        raise ExperimentError(f"The checksums in {folder} cannot be read: {error.strerror}: install again.") from error
    pairs = [line.split() for line in lines if line.strip()]
    return {name: digest for digest, name in pairs}


def numbered(
    family: dict[str, Any], entries: list[dict[str, Any]], seeds: SeedRange, quick: bool
) -> Iterator[tuple[dict[str, Any], int]]:
    """Give each entry of a family as often as it is played, each time with a seed of its own.

    The n-th of the full run has the n-th seed, in a quick run too.
    """
    number = 0
    for entry in entries:
        for i in range(entry["full"]):
            if i < entry["quick"] or not quick:
                yield entry, seed_of(family, seeds, number)
            number += 1


def seed_of(family: dict[str, Any], seeds: SeedRange, number: int) -> int:
    """Return the seed of a family's cell number `number` (from 0) in a range of seeds."""
    first, last = family["seeds"][seeds]
    if not 0 <= number <= last - first:
        raise ExperimentError(f"There is no seed number {number} in the {seeds} ones, {first} to {last}: take fewer.")
    return int(first) + number
