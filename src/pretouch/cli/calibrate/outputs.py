"""Files that `pretouch skin calibrate` writes."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pretouch.cli.writing import check_outputs, numbers_to, same_file

if TYPE_CHECKING:
    from pretouch.cli.calibrate.options import Calibrate, CalibrateArm


@dataclass(frozen=True)
class Outputs:
    """Where the answer goes, besides the terminal."""

    skin: Path | None
    write: Callable[[Any], None]
    """Takes the numbers."""


@contextmanager
def outputs_of(command: "Calibrate | CalibrateArm[Any]") -> Iterator[Outputs]:
    """Give what is asked for.

    ExperimentError for what could not be written, or is also another input or output file; --out may be --skin.
    """
    recorded, units = getattr(command, "recorded", None), getattr(command, "units", None)
    inputs = [getattr(recorded, "recording", None), getattr(recorded, "joints", None), getattr(units, "keys", None)]
    if command.skin and not (command.out and same_file(command.skin, command.out)):
        inputs.append(command.skin)
    outputs = ("skin file", command.out), ("file", command.json), ("recording", getattr(command, "record", None))
    check_outputs(outputs, inputs, command.replace)
    with numbers_to(command.json) as write:
        yield Outputs(command.out, write)
