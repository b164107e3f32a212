"""`pretouch skin coverage`: what a skin sees in time, its blind spots, and where more units help most."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import tyro
from rich.console import Console

from pretouch.cli.options import JsonFile, OptionalFile
from pretouch.cli.skin_coverage_tables import link_table, spot_lines, suggestion_table, unit_table
from pretouch.cli.tables import show
from pretouch.cli.writing import check_outputs, numbers_to, unwritable_said
from pretouch.coverage import measure
from pretouch.coverage.blind import BlindSpot, blind_spots
from pretouch.coverage.measure import Setting, coverage_of, covered
from pretouch.coverage.params import CoverageParams
from pretouch.coverage.suggest import Suggestions, candidates, suggest
from pretouch.coverage.ways import Ways, seen_by
from pretouch.errors import ExperimentError, ParameterError, SkinError
from pretouch.extras import FIGURES
from pretouch.perception.scene_filter import floor_and_pedestal
from pretouch.robot.description import robot_named
from pretouch.robot.model import RobotModel
from pretouch.sensing.sensor import sensor_called
from pretouch.sensing.skin import Skin, load_skin, save_skin, skin_file
from pretouch.types import BoolArray

_FORMATS = (".png", ".pdf", ".svg")
_SPOTS = 8
"""Blind spots that are printed; the file of numbers has all."""


@dataclass(frozen=True)
class Coverage:
    """Share of the paths to the arm on which a skin sees an object in time; blind spots; where more units help most."""

    skin: tyro.conf.Positional[Path | None] = None
    """Skin file; by default the seven units that come with the package, or the skin in the arm's folder."""
    arm: str = "panda"
    """panda, fr3, or the folder of an imported arm."""
    workspace: str = "paths"
    """Postures to average over: circle, line, paths (both of the paper's), or joints (their whole range)."""
    speed: float = 0.5
    """Speed of the approaching object [m/s]."""
    arm_speed: float = 0.3
    """Speed at which the arm moves towards it [m/s]."""
    deceleration: float = 0.6
    """Deceleration with which the arm brakes [m/s^2]."""
    object_radius: float = 0.05
    """Radius of the approaching object [m]: a fist by default."""
    rate: float = 50.0
    """Readings of a unit a second [Hz]."""
    latency: float = 0.04
    """Time from a measurement to a motion [s]."""
    range: float = 1.3
    """Farthest target that fills a unit's cone [m]."""
    reflectance: float = 0.5
    """Reflectance of the approaching object at 940 nm."""
    way: float = 0.8
    """Length of the straight path on which it approaches [m]."""
    floor: float = -0.2
    """Height of the floor in the base frame [m]."""
    postures: int = 50
    """Number of postures."""
    seed: int = 0
    """Seed of the random postures and paths: the same seed gives the same numbers."""
    suggest: int = 0
    """Number of additional units to place where they help most."""
    sensor: str = "vl53l1x"
    """Type of sensor of additional units: vl53l1x, vl53l5cx, vl53l7cx, capacitive, or what the skin file describes."""
    out: OptionalFile = None
    """Skin file to write, with --suggest: the existing units and the new ones."""
    figure: OptionalFile = None
    """File for a figure of the arm, ending in .png, .pdf or .svg."""
    json: JsonFile = None
    replace: bool = False
    """Overwrite existing files."""

    def run(self) -> None:
        """Measure, show, and write the requested files."""
        model, skin, source = _arm_and_skin(self)
        _check_outputs(self, source)
        with numbers_to(self.json) as write:
            write(_measured(self, model, skin))


def _measured(command: Coverage, model: RobotModel, skin: Skin) -> dict[str, Any]:
    """Measure, print and draw; return the numbers."""
    setting = Setting(
        model, floor_and_pedestal(command.floor), _params(command), command.workspace,
        command.postures, command.seed,
    )  # fmt: skip
    ways, met = setting.ways(), setting.met()
    console = Console(highlight=False)
    found, sees = coverage_of(ways, skin)
    both = found, coverage_of(met, skin)[0]
    spots = blind_spots(ways, found)
    show(console, [link_table(both, setting), *([unit_table(skin, ways, sees)] if len(skin) else [])])
    for line in spot_lines(spots, _SPOTS):
        console.print(line, markup=False, soft_wrap=True)
    numbers = _numbers(command, setting, both, spots)
    shown, new = skin, frozenset[str]()
    if command.suggest:
        own = {unit.sensor.label: unit.sensor for unit in skin.mounted}
        places = candidates(ways, skin, sensor_called(command.sensor, "--sensor", own))
        suggested = suggest((ways, met), skin, command.suggest, places)
        shown, new = Skin((*skin.units, *suggested.units), model), frozenset(unit.id for unit in suggested.units)
        found, numbers["suggested"] = _suggested(console, setting, skin, shown, suggested)
        if command.out:
            save_skin(shown, command.out)
            console.print(f"Skin: {command.out}", markup=False, soft_wrap=True)
    if command.figure:
        from pretouch.coverage.figure import coverage_figure  # needs the extra

        with unwritable_said("figure", command.figure):
            figure = coverage_figure(setting.ways(1) if new else ways, found, shown, new)
            figure.savefig(command.figure, dpi=110)
        console.print(f"Figure: {command.figure}", markup=False, soft_wrap=True)
    return numbers


def _arm_and_skin(command: Coverage) -> tuple[RobotModel, Skin, Path | None]:
    """Return the arm, its skin, and the skin's file; no units and no file where the first units are to be suggested."""
    model = RobotModel(robot_named(command.arm))
    try:
        source = command.skin or skin_file(model.description)
    except SkinError:
        if not command.suggest:
            raise
        return model, Skin([], model), None
    return model, load_skin(source, model), source


def _params(command: Coverage) -> CoverageParams:
    return CoverageParams(
        object_radius_m=command.object_radius, object_speed_m_s=command.speed, arm_speed_m_s=command.arm_speed,
        deceleration_m_s2=command.deceleration, rate_hz=command.rate, latency_s=command.latency,
        range_m=command.range, way_m=command.way, reflectance=command.reflectance,
    )  # fmt: skip


def _check_outputs(command: Coverage, source: Path | None) -> None:
    """Refuse, before anything is computed, what could not be done or would be lost."""
    if command.suggest < 0:
        raise SkinError(f"--suggest is {command.suggest}: give 1 or more, or leave it out.")
    if command.out and not command.suggest:
        raise SkinError(
            f"--out {command.out} writes the skin with the suggested units: give their number with --suggest."
        )
    if command.seed < 0:
        raise ParameterError(f"The seed is {command.seed}: give 0 or more.")
    if command.figure and command.figure.suffix not in _FORMATS:
        raise ExperimentError(
            f"The figure {command.figure} has an unknown format: use one of the endings {', '.join(_FORMATS)}."
        )
    if command.figure:
        FIGURES.need("A figure")
    outputs = ("skin file", command.out), ("figure", command.figure), ("file", command.json)
    check_outputs(outputs, [source], command.replace)


def _suggested(
    console: Console, setting: Setting, skin: Skin, more: Skin, suggested: Suggestions
) -> tuple[measure.Coverage, dict[str, Any]]:
    """Print what the new units add, by ways that they were not chosen by."""
    fresh = setting.ways(1), setting.met(1)
    seen = [seen_by(ways, more) for ways in fresh]
    before = _both(fresh, [sees[: len(skin.first)] for sees in seen])
    after = _both(fresh, seen)
    show(console, [suggestion_table(suggested, before, after)])
    return after[0], {
        "units": [
            {
                "id": s.unit.id, "sensor": s.unit.sensor.label, "link": s.unit.link,
                "T_link_sensor": s.unit.T_link_sensor.tolist(), "gain": s.gain,
            }
            for s in suggested.chosen
        ],
        "places": suggested.candidates,
        "most_any_could_add": suggested.most,
        "before": _links(before),
        "after": _links(after),
    }  # fmt: skip


def _both(ways: tuple[Ways, Ways], seen: list[BoolArray]) -> tuple[measure.Coverage, measure.Coverage]:
    return covered(ways[0], seen[0]), covered(ways[1], seen[1])


def _numbers(
    command: Coverage, setting: Setting, both: tuple[measure.Coverage, measure.Coverage], spots: tuple[BlindSpot, ...]
) -> dict[str, Any]:
    return {
        "asked": asdict(command),
        "parameters": asdict(setting.params) | {"warning_m": setting.params.warning_m},
        "links": _links(both),
        "blind_spots": spots,
    }


def _links(both: tuple[measure.Coverage, measure.Coverage]) -> list[dict[str, Any]]:
    found, met = both
    meets = {one.name: one.ways for one in (*met.links, met.arm)}
    return [
        {
            "link": one.name, "area_m2": one.area_m2, "ways": one.ways, "surface": one.surface,
            "met": meets.get(one.name),
        }
        for one in (*found.links, found.arm)
    ]  # fmt: skip
