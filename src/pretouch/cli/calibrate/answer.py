"""The answer of `pretouch skin calibrate`: a table, sentences, the skin file, and all numbers."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from rich.console import Console

from pretouch.calibration.result import Calibration, UnitCalibration
from pretouch.calibration.skin_of import skin_of
from pretouch.cli.calibrate.outputs import Outputs
from pretouch.cli.tables import PlainTable
from pretouch.cli.writing import plain
from pretouch.errors import CalibrationError
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin, save_skin

_COLUMNS = (
    "unit", "link", "position\n[mm]", "sigma\n[mm]", "sigma\n[deg]", "clock\n[ms]", "residual\n[m/s^2]", "verdict",
)  # fmt: skip
_TEXT = (0, 1, 7)
"""Columns that hold no numbers."""


@dataclass(frozen=True, eq=False)
class Answer:
    """What a calibration found, and what it was asked with."""

    model: RobotModel
    calibration: Calibration
    believed: Skin | None
    """The skin as it was believed to be."""
    clock_ahead: float
    """By how much the units' clock was ahead of the joints' [s], taken off before; NaN if that was not found."""
    notes: tuple[str, ...]
    """What is to be known of the data, a sentence each."""


def give(answer: Answer, outputs: Outputs) -> int:
    """Show and write an answer; return 1 if a unit was refused, or else 0."""
    console = Console(highlight=False)
    console.print(_table(answer), crop=False)
    notes = [*answer.notes, *(finding.sentence for finding in answer.calibration.findings)]
    for sentence in (*notes, *_sentences(answer)):
        console.print(sentence, soft_wrap=True, markup=False)
    about = {"arm": answer.model.description.name, "clock_ahead_s": answer.clock_ahead, "notes": notes}
    outputs.write(about | plain(answer.calibration))
    if outputs.skin:
        console.print(_written(answer, outputs), soft_wrap=True, markup=False)
    return int(not all(unit.accepted for unit in answer.calibration.units))


def _table(answer: Answer) -> PlainTable:
    units = answer.calibration.units
    styles = ["bold red" if not unit.accepted else "yellow" if unit.findings else "" for unit in units]
    return PlainTable(_COLUMNS, [_cells(unit) for unit in units], _TEXT, styles)


def _cells(unit: UnitCalibration) -> tuple[str, ...]:
    place, verdict = unit.place, "good" if unit.accepted else "refused"
    if place is None:
        return unit.id, *("-" for _ in _COLUMNS[2:]), verdict
    return (
        unit.id,
        place.link,
        " ".join(f"{1000 * value:.1f}" for value in place.T_link_sensor[:3, 3]),
        f"{1000 * place.position_sigma:.2f}",
        f"{np.rad2deg(place.orientation_sigma):.3f}",
        f"{1000 * place.clock_offset:.2f}",
        f"{place.acceleration_residual:.3f}",
        verdict,
    )


def _sentences(answer: Answer) -> Iterator[str]:
    """Say what is to be known of each unit, refused ones first."""
    for unit in sorted(answer.calibration.units, key=lambda unit: unit.accepted):
        for finding in unit.findings:
            yield f"{unit.id}{' is refused' if finding.refused else ''}: {finding.sentence}"


def _written(answer: Answer, outputs: Outputs) -> str:
    """Write the skin file, and say what it holds."""
    if outputs.skin is None:
        raise CalibrationError("No skin file is written: name one with --out.")
    try:
        made = skin_of(answer.calibration, answer.model, answer.believed)
    except CalibrationError as error:
        return f"{error} {outputs.skin} is not written."
    if not made.located:
        return f"No unit was located well enough, so {outputs.skin} is not written."
    save_skin(made.skin, outputs.skin)
    said = [f"Skin file: {outputs.skin} has {len(made.located)} units where they were found."]
    if made.kept:
        said.append(f"Kept as before, without calibration: {', '.join(made.kept)}.")
    if made.left_out:
        said.append(f"Left out: {', '.join(made.left_out)}.")
    return " ".join(said)
