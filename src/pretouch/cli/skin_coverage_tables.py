"""What `pretouch skin coverage` prints."""

import numpy as np

from pretouch.coverage.blind import BLIND, BlindSpot
from pretouch.coverage.measure import Coverage, Setting
from pretouch.coverage.suggest import Suggestions
from pretouch.coverage.ways import Ways
from pretouch.sensing.skin import Skin
from pretouch.text_table import TextTable, tabulated
from pretouch.types import BoolArray


def link_table(both: tuple[Coverage, Coverage], setting: Setting) -> TextTable:
    """Show the shares of each link and of the arm."""
    p, (found, met) = setting.params, both
    meets = {one.name: one.ways for one in (*met.links, met.arm)}
    columns = (
        ("link", lambda one: one.name),
        ("area\n[cm^2]", lambda one: f"{1e4 * one.area_m2:.0f}"),
        ("ways\n[%]", lambda one: _percent(one.ways)),
        ("surface\n[%]", lambda one: _percent(one.surface)),
        ("met\n[%]", lambda one: _percent(meets[one.name]) if one.name in meets else "-"),
    )
    return tabulated(
        f"Seen in time: {setting.model.description.name}, {setting.postures} postures of {setting.workspace}",
        columns,
        (*found.links, found.arm),
        f"A ball of {100 * p.object_radius_m:g} cm radius approaches a point in a straight line at"
        f" {p.object_speed_m_s:g} m/s, and the arm moves towards it at {p.arm_speed_m_s:g} m/s: it must be seen"
        f" {p.warning_m:.2f} m before contact. Paths: share of the free paths to the surface that are seen in time."
        " Surface: points to which at least half of the paths are seen in time. Met: share of what stands in the way of"
        f" the moving arm that is seen, {p.standing().warning_m:.2f} m before contact at the latest.",
        names=1,
    )


def unit_table(skin: Skin, ways: Ways, sees: BoolArray) -> TextTable:
    """Show what each unit sees, and what would be lost without it; `sees` (B, S, W)."""
    weight, alone = ways.share, sees.sum(axis=0) == 1
    columns = (
        ("unit", lambda k: skin.mounted[k].id),
        ("link", lambda k: skin.mounted[k].link),
        ("ways\n[%]", lambda k: f"{100 * float((weight * sees[k]).sum()):.2f}"),
        ("alone\n[%]", lambda k: f"{100 * float((weight * (sees[k] & alone)).sum()):.2f}"),
    )
    return tabulated(
        "What each unit sees",
        columns,
        range(len(skin.mounted)),
        "Share of all free paths to the arm. Alone: paths that no other unit sees, which would be lost without this"
        " unit.",
    )


def suggestion_table(
    suggested: Suggestions, before: tuple[Coverage, Coverage], after: tuple[Coverage, Coverage]
) -> TextTable:
    """Show the places of the new units, and what they change."""
    was, now = ([f"{_percent(one.arm.ways)} %" for one in both] for both in (before, after))
    columns = (
        ("unit", lambda one: one.unit.id),
        ("sensor", lambda one: one.unit.sensor.label),
        ("link", lambda one: one.unit.link),
        ("position\n[m]", lambda one: _vector(one.unit.T_link_sensor[:3, 3], 3)),
        ("beam", lambda one: _vector(one.unit.T_link_sensor[:3, 2], 2)),
        ("gain\n[%]", lambda one: f"{100 * one.gain:.2f}"),
    )
    return tabulated(
        f"{len(suggested.chosen)} more units: {was[0]} before, {now[0]} after; met {was[1]} and {now[1]}",
        columns,
        suggested.chosen,
        f"Chosen one by one from {suggested.candidates} positions, each that which adds most to what comes at"
        " the arm and to what it meets, which count the same. Gains are measured on the paths used for choosing, before"
        f" and after on others. No choice of as many could add more than {100 * suggested.most:.1f} %.",
    )


def spot_lines(spots: tuple[BlindSpot, ...], most: int) -> list[str]:
    """Name the largest blind spots, one a line."""
    if not spots:
        return [f"No blind spots: at least {100 * BLIND:g} % of the paths to each point are seen in time."]
    total = 1e4 * sum(spot.area_m2 for spot in spots)
    said = [f"Blind spots, with less than {100 * BLIND:g} % of the paths seen: {len(spots)}, {total:.0f} cm^2 in all."]
    said += [f"  {spot.sentence}" for spot in spots[:most]]
    return said + ([f"  and {len(spots) - most} smaller ones"] if len(spots) > most else [])


def _percent(share: float) -> str:
    return f"{100 * share:.1f}"


def _vector(values: np.ndarray, digits: int) -> str:
    return " ".join(f"{value:.{digits}f}" for value in values)
