"""Files that `pretouch skin calibrate` writes."""

from dataclasses import dataclass
from pathlib import Path
from typing import Self

from pretouch.cli.skin_calibrate_options import Calibrate
from pretouch.cli.writing import check_writable
from pretouch.errors import CalibrationError


@dataclass(frozen=True)
class Outputs:
    """Where the answer goes, besides the terminal."""

    skin: Path | None
    json: Path | None

    @classmethod
    def of(cls, command: Calibrate) -> Self:
        """Return what is asked for; CalibrationError or ExperimentError for what could not be written."""
        made = cls(Path(command.out) if command.out else None, Path(command.json) if command.json else None)
        if made.skin:
            check_free("skin file", made.skin, command.replace)
            check_writable("skin file", made.skin)
        if made.json:
            check_writable("file", made.json)
        return made


def check_free(what: str, place: Path, replace: bool) -> None:
    """Raise CalibrationError for a file that is there and not to be replaced."""
    if place.is_file() and not replace:
        raise CalibrationError(f"The {what} {place} is there already: give another name, or --replace.")
