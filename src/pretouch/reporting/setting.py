"""Setting of a run, and its parameters."""

import re
from dataclasses import fields, is_dataclass, replace
from datetime import UTC, datetime
from typing import Any

from pretouch.composition import at, field_docs, leaves
from pretouch.profiles import PROFILES, Profile
from pretouch.recording.run import Run
from pretouch.reporting.html import NOTHING, Html, Row, Text, element, facts, joined, number, table, table_html
from pretouch.reporting.record import RunCourse
from pretouch.text_table import TextTable

_LONGEST = 300
"""Characters of a fact that are shown."""
_PROFILES = 6
"""Profiles that are shown side by side."""


def setting_section(course: RunCourse) -> Html:
    """Section on profile, time and arm of a run."""
    first = course.runs[0]
    rows: list[tuple[Text, Text]] = [
        ("begun", started(first)),
        ("duration", f"{course.lasted.sum():.2f} s, {len(course)} control steps"),
        ("arm", f"{first.model.description.name}, {first.model.n} joints"),
        ("skin", f"{len(course.units)} units: {', '.join(course.units)}" if course.units else "none"),
        ("versions", ", ".join(f"{name} {version}" for name, version in first.versions.items())),
    ]
    for name, value in first.about.items():  # whatever the one who recorded said about it
        text = written(value)
        rows.append((name, text if len(text) <= _LONGEST else f"{text[:_LONGEST]} ..."))
    return joined([facts(rows), _runs(course)])


def started(run: Run) -> str:
    """Start of a run, in UTC."""
    try:
        return datetime.fromtimestamp(run.started, UTC).strftime("%Y-%m-%d %H:%M:%S UTC")
    except (ValueError, OverflowError, OSError):
        return "not known"


def _runs(course: RunCourse) -> Html:
    """Profile and path by time."""
    rows: list[Row] = []
    for i, run in enumerate(course.runs):
        time = course.time[course.run == i]
        if len(time):
            rows.append(
                {
                    "profile": run.profile.name,
                    "path": described(run.path),
                    "from [s]": number(time[0], 2),
                    "to [s]": number(time[-1], 2),
                    "steps": str(len(time)),
                }
            )
    return table(rows, names=2)


def described(path: object) -> str:
    """Say what a path is."""
    if is_dataclass(path):
        values = [f"{f.name} {written(getattr(path, f.name))}" for f in fields(path)]
    else:
        length = getattr(path, "length", None)
        values = [] if length is None else [f"{length:.2f} m"]
    return f"{type(path).__name__}: {', '.join(values)}"


def written(value: object) -> str:
    """Write a parameter, or whatever JSON holds."""
    if isinstance(value, dict):
        return "; ".join(f"{name}: {written(part)}" for name, part in value.items())
    if isinstance(value, list | tuple):
        return f"({', '.join(map(written, value))})"
    if value is None or isinstance(value, bool):
        return {None: "none", True: "yes", False: "no"}[value]
    return f"{value:.6g}".replace("-", "−") if isinstance(value, float) else str(value)


def parameter_section(course: RunCourse) -> Html:
    """All parameters of all profiles that ran, marked where they are not those of `paper`."""
    profiles = list(dict.fromkeys(run.profile for run in course.runs))
    beside = [PROFILES["paper"], *profiles[:_PROFILES]]
    values: list[dict[str, Any]] = [dict(leaves(replace(profile, name=""))) for profile in beside]
    units = {path: _unit(profile, path) for profile, own in zip(beside, values, strict=True) for path in own}

    def parameter(path: str, column: int) -> Text:
        usual, value = (own.get(path, NOTHING) for own in (values[0], values[column]))
        return written(value) if value == usual else element("b", written(value), "other")

    header = "parameter", "unit", *(profile.name for profile in beside)
    rows = [(path, units[path], *(parameter(path, i) for i in range(len(beside)))) for path in units if path != "name"]
    more = len(profiles) - _PROFILES
    note = "Bold on colour: not the value of the profile paper (Table I of the paper, and what it leaves open)."
    if more > 0:
        note += f" {more} more profiles are left out."
    return table_html(TextTable("", header, tuple(rows), note))


def _unit(profile: Profile, path: str) -> str:
    """Unit of a parameter, as its documentation has it."""
    group, _, name = path.rpartition(".")
    holder: Any = at(profile, group) if group else profile
    unit = re.search(r"\[([^\]]*)\]", field_docs(holder.__class__).get(name, ""))
    return unit[1].replace("^2", "²") if unit and unit[1] != "1" else ""
