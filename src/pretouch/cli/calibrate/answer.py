"""The answer of `pretouch skin calibrate`: a table, sentences, the skin file, and all numbers."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from rich.console import Console
from scipy.spatial.transform import Rotation

from pretouch.calibration.observability import Observability
from pretouch.calibration.result import Calibration, Finding, Place, UnitCalibration
from pretouch.calibration.skin_of import skin_of
from pretouch.cli.calibrate.outputs import Outputs
from pretouch.cli.tables import Grid
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
    console.print(_table(answer))
    notes = [*answer.notes, *(finding.sentence for finding in answer.calibration.findings)]
    for sentence in (*notes, *_sentences(answer)):
        console.print(sentence, soft_wrap=True, markup=False)
    outputs.write(numbers(answer.model, answer.calibration, answer.clock_ahead, notes))
    if outputs.skin:
        console.print(_written(answer, outputs), soft_wrap=True, markup=False)
    return int(not all(unit.accepted for unit in answer.calibration.units))


def _table(answer: Answer) -> Grid:
    units = answer.calibration.units
    styles = ["bold red" if not unit.accepted else "yellow" if unit.findings else "" for unit in units]
    return Grid(_COLUMNS, [_cells(unit) for unit in units], 2, _TEXT, broken=2, styles=styles)


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


def numbers(model: RobotModel, calibration: Calibration, clock_ahead: float, notes: Sequence[str]) -> dict[str, Any]:
    """Return all numbers of a calibration."""
    return {
        "arm": model.description.name,
        "clock_ahead_s": clock_ahead,
        "board_misalignment_sigma_rad": calibration.orientation_floor,
        "notes": list(notes),
        "units": [_unit(unit) for unit in calibration.units],
        "findings": [_finding(finding) for finding in calibration.findings],
    }


def _unit(unit: UnitCalibration) -> dict[str, Any]:
    return {
        "unit": unit.id,
        "accepted": unit.accepted,
        "place": None if unit.place is None else _place(unit.place),
        "observability": None if unit.observability is None else _observability(unit.observability),
        "findings": [_finding(finding) for finding in unit.findings],
    }


def _place(place: Place) -> dict[str, Any]:
    return {
        "link": place.link,
        "position_m": place.T_link_sensor[:3, 3],
        "quaternion_wxyz": Rotation.from_matrix(place.T_link_sensor[:3, :3]).as_quat(canonical=True, scalar_first=True),
        "covariance": place.covariance,
        "position_sigma_m": place.position_sigma,
        "orientation_sigma_rad": place.orientation_sigma,
        "acceleration_bias_m_s2": place.acceleration_bias,
        "angular_velocity_bias_rad_s": place.angular_velocity_bias,
        "acceleration_scale_error": place.acceleration_scale,
        "angular_velocity_scale_error": place.angular_velocity_scale,
        "clock_offset_s": place.clock_offset,
        "acceleration_residual_m_s2": place.acceleration_residual,
        "angular_velocity_residual_rad_s": place.angular_velocity_residual,
        "used": place.used,
    }


def _observability(seen: Observability) -> dict[str, Any]:
    return {
        "position_directions": seen.position_directions,
        "position_sigma_m": seen.position_sigma,
        "orientation_axes": seen.orientation_axes,
        "orientation_sigma_rad": seen.orientation_sigma,
        "unknown": seen.unknown,
        "known": seen.known,
    }


def _finding(finding: Finding) -> dict[str, Any]:
    return {"kind": finding.kind, "sentence": finding.sentence, "refused": finding.refused}
