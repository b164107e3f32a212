"""`pretouch skin coverage`: what a skin sees in time, its blind spots, and where more units help most."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import tyro
from rich.console import Console

from pretouch.cli.options import JsonFile, OptionalFile
from pretouch.cli.tables import show
from pretouch.cli.writing import check_outputs, numbers_to
from pretouch.coverage import measure
from pretouch.coverage.blind import BLIND, blind_spots
from pretouch.coverage.measure import CoverageSetting, covered
from pretouch.coverage.params import CoverageParams
from pretouch.coverage.suggest import Suggestion, candidates, suggest
from pretouch.coverage.ways import Ways, seen_by
from pretouch.errors import ParameterError, SkinError
from pretouch.robot.description import robot_named
from pretouch.robot.model import RobotModel
from pretouch.sensing.sensor import sensor_called
from pretouch.sensing.skin import Skin, load_skin, save_skin, skin_file
from pretouch.sim.scene import floor_and_pedestal
from pretouch.text_table import TextTable, tabulated
from pretouch.types import BoolArray

_SPOTS = 8
"""Blind spots that are printed; the file of numbers has all."""


@dataclass(frozen=True)
class MeasureCoverage:
    """Share of the paths to the arm on which a skin sees an object in time; blind spots; where more units help most."""

    skin: tyro.conf.Positional[Annotated[Path | None, tyro.conf.arg(metavar="[FILE]")]] = None
    """Skin file; by default the sixteen units that come with the package, or the skin in the arm's folder."""
    arm: str = "panda"
    """panda, fr3, or the folder of an imported arm."""
    workspace: str = "paths"
    """Postures to average over: circle, line, paths (both of the paper's), or joints (their whole range)."""
    approach: CoverageParams = field(default_factory=CoverageParams)
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
    json: JsonFile = None
    replace: bool = False
    """Overwrite existing files."""

    def run(self) -> None:
        """Measure, show, and write the requested files."""
        model = RobotModel(robot_named(self.arm))
        try:
            source: Path | None = self.skin or skin_file(model.description)
        except SkinError:  # the first units of an arm are to be suggested
            if not self.suggest:
                raise
            source = None
        skin = load_skin(source, model) if source else Skin([], model)
        if self.suggest < 0:
            raise SkinError(f"--suggest is {self.suggest}: give 1 or more, or leave it out.")
        if self.out and not self.suggest:
            raise SkinError(
                f"--out {self.out} writes the skin with the suggested units: give their number with --suggest."
            )
        if self.seed < 0:
            raise ParameterError(f"The seed is {self.seed}: give 0 or more.")
        check_outputs([("skin file", self.out), ("file", self.json)], [source], self.replace)
        fixed = floor_and_pedestal(self.floor)
        setting = CoverageSetting(model, fixed, self.approach, self.workspace, self.postures, self.seed)
        with numbers_to(self.json) as write:
            write({"asked": self} | _measured(self, setting, skin))


def _measured(command: MeasureCoverage, setting: CoverageSetting, skin: Skin) -> dict[str, Any]:
    """Measure and print; return the numbers."""
    sets, console = setting.draw(), Console(highlight=False)
    masks = [seen_by(one, skin) for one in sets]
    measures = [covered(one, sees) for one, sees in zip(sets, masks, strict=True)]
    spots = blind_spots(sets[0], measures[0])
    show(console, [_link_table(setting, measures), *([_unit_table(skin, sets[0], masks[0])] if len(skin) else [])])
    total = 1e4 * sum(spot.area_m2 for spot in spots)
    lines = [f"Blind spots, with less than {100 * BLIND:g} % of the paths seen: {len(spots)}, {total:.0f} cm^2 in all."]
    lines += [f"  {spot.sentence}" for spot in spots[:_SPOTS]]
    lines += [f"  and {len(spots) - _SPOTS} smaller ones"] if len(spots) > _SPOTS else []
    console.print("\n".join(lines), markup=False, soft_wrap=True)
    numbers = _numbers(measures) | {"blind_spots": spots}
    if command.suggest:
        own = {unit.sensor.label: unit.sensor for unit in skin.mounted}
        places = candidates(sets[0], skin, sensor_called(command.sensor, "--sensor", own))
        suggested = suggest(sets, skin, command.suggest, places)
        old, skin = skin, Skin((*skin.mounted, *(one.unit for one in suggested)), setting.model)
        # what the new units add, by ways that they were not chosen by
        sets, first = setting.draw(1), len(old.first)
        masks = [seen_by(one, skin) for one in sets]
        before = [covered(one, sees[:first]) for one, sees in zip(sets, masks, strict=True)]
        after = [covered(one, sees) for one, sees in zip(sets, masks, strict=True)]
        show(console, [_suggestion_table(suggested, len(places), before, after)])
        numbers["suggested"] = suggested
        numbers["before"], numbers["after"] = _numbers(before), _numbers(after)
        if command.out:
            save_skin(skin, command.out)
            console.print(f"Skin: {command.out}", markup=False, soft_wrap=True)
    return numbers


def _numbers(measures: list[measure.Coverage]) -> dict[str, Any]:
    return {name: (*one.links, one.arm) for name, one in zip(("links", "met", "hand"), measures, strict=True)}


def _link_table(setting: CoverageSetting, measures: list[measure.Coverage]) -> TextTable:
    """Show the shares of each link and of the arm."""
    p, coming = setting.params, measures[0]
    resting, close = ({one.name: f"{100 * one.ways:.1f}" for one in (*m.links, m.arm)} for m in measures[1:])
    columns = (
        ("link", lambda one: one.name),
        ("area\n[cm^2]", lambda one: f"{1e4 * one.area_m2:.0f}"),
        ("paths\n[%]", lambda one: f"{100 * one.ways:.1f}"),
        ("met\n[%]", lambda one: resting.get(one.name, "-")),
        ("hand\n[%]", lambda one: close.get(one.name, "-")),
    )
    return tabulated(
        f"Seen in time: {setting.model.description.name}, {setting.postures} postures of {setting.workspace}",
        columns,
        (*coming.links, coming.arm),
        f"A ball of {100 * p.object_radius_m:g} cm radius approaches a point in a straight line at"
        f" {p.object_speed_m_s:g} m/s, and the arm moves towards it at {p.arm_speed_m_s:g} m/s: it must be seen"
        f" {p.warning_m:.2f} m before contact. Paths: share of the free paths to the surface that are seen in time."
        f" Met: share of what stands in the way of the moving arm that is seen, {p.standing().warning_m:.2f} m before"
        " contact at the latest. Hand: the same share for the hand alone, in all directions.",
        names=1,
    )


def _unit_table(skin: Skin, ways: Ways, sees: BoolArray) -> TextTable:
    """Show the paths that each unit sees, and those that no other unit sees; `sees` (B, S, W)."""
    weight, alone = ways.share, sees.sum(axis=0) == 1
    columns = (
        ("unit", lambda k: skin.mounted[k].id),
        ("link", lambda k: skin.mounted[k].link),
        ("paths\n[%]", lambda k: f"{100 * float((weight * sees[k]).sum()):.2f}"),
        ("alone\n[%]", lambda k: f"{100 * float((weight * (sees[k] & alone)).sum()):.2f}"),
    )
    return tabulated(
        "Paths that each unit sees",
        columns,
        range(len(skin.mounted)),
        "Share of all free paths to the arm. Alone: paths that no other unit sees, which would be lost without this"
        " unit.",
    )


def _suggestion_table(
    suggested: tuple[Suggestion, ...], places: int, before: list[measure.Coverage], after: list[measure.Coverage]
) -> TextTable:
    """Show the places of the new units, and the coverage before and after."""
    was, now = ([f"{100 * one.arm.ways:.1f}" for one in each] for each in (before, after))
    shares = ", ".join(f"{name} {a} to {b} %" for name, a, b in zip(("paths", "met", "hand"), was, now, strict=True))
    columns = (
        ("unit", lambda one: one.unit.id),
        ("sensor", lambda one: one.unit.sensor.label),
        ("link", lambda one: one.unit.link),
        ("position\n[m]", lambda one: _vector(one.unit.T_link_sensor[:3, 3], 3)),
        ("beam", lambda one: _vector(one.unit.T_link_sensor[:3, 2], 2)),
        ("gain\n[%]", lambda one: f"{100 * one.gain:.2f}"),
    )
    return tabulated(
        f"{len(suggested)} more units: {shares}",
        columns,
        suggested,
        f"Units are chosen one by one from {places} poses. Each adds the most to paths, met and hand, which have equal"
        " weight. Gains are measured on the paths used for the choice, before and after on others.",
    )


def _vector(values: np.ndarray, digits: int) -> str:
    return " ".join(f"{value:.{digits}f}" for value in values)
