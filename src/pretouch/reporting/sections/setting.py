"""Sections about what ran, with which parameters, and how well units, robot and loop did."""

from collections.abc import Mapping
from dataclasses import fields, replace
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

from pretouch.composition import leaves
from pretouch.profiles import PROFILES
from pretouch.reporting.course import Course
from pretouch.reporting.health import UnitHealth
from pretouch.reporting.html import (
    NOTHING,
    Html,
    Text,
    bad,
    element,
    facts,
    joined,
    note,
    number,
    percent,
    table,
    vector,
)  # fmt: skip
from pretouch.reporting.measures import Measures
from pretouch.reporting.numbers import Spread

if TYPE_CHECKING:
    from pretouch.recording.reader import Run

_LONGEST = 300
"""Characters of a fact that are shown."""
_RUNS = 30
"""Stretches of one profile and path that are listed."""
_PROFILE_COLUMNS = 6
"""Profiles that are shown side by side."""
_ABSENT = "–"
"""Stands for a parameter of a part that a profile does not have."""
_UNITS = {
    "_m_s_n": "(m/s)/N", "_kg_m2": "kg m²", "_rad_s2": "rad/s²", "_nm_s": "Nm s/rad", "_m_s2": "m/s²",
    "_nm_rad": "Nm/rad", "_rad_s": "rad/s", "_m_s": "m/s", "_1_s": "1/s", "_rad": "rad", "_nm": "Nm", "_kg": "kg",
    "_s": "s", "_m": "m", "_n": "N", "_j": "J", "_per_hour": "1/h", "_nats": "nats", "_cycles": "cycles",
    "_samples": "samples",
}  # fmt: skip
"""Units by the end of a parameter's name, longest first."""
_LOST = 0.05
"""Share of lost measurements from which it is marked."""


def setting_section(m: Measures) -> Html:
    """What ran, when, on which arm, and whether the file is whole."""
    course = m.course
    whole: Text = "complete" if m.complete else bad(m.said or "incomplete")
    if not course.runs or not len(course):
        return facts([("recording", whole), ("control steps", str(len(course)))])
    first = course.runs[0]
    rows: list[tuple[Text, Text]] = [
        ("recording", whole),
        ("begun", started(first)),
        ("duration", f"{m.duration:.2f} s, {len(course)} control steps"),
        ("arm", f"{first.model.description.name}, {first.model.n} joints"),
        ("skin", f"{len(course.units)} units: {', '.join(course.units)}" if course.units else "none"),
        ("versions", ", ".join(f"{name} {version}" for name, version in first.versions.items())),
        *_about(first.about),
    ]
    return joined([facts(rows), _runs(course)])


def started(run: "Run") -> str:
    """When a run began, in UTC."""
    try:
        return datetime.fromtimestamp(run.started, UTC).strftime("%Y-%m-%d %H:%M:%S UTC")
    except (ValueError, OverflowError, OSError):
        return "not known"


def _about(about: Mapping[str, Any]) -> list[tuple[Text, Text]]:
    """Whatever the one who recorded said about it."""
    shown = [(name, _told(value)) for name, value in about.items()]
    return [(name, text if len(text) <= _LONGEST else f"{text[:_LONGEST]} ...") for name, text in shown]


def _told(value: object, depth: int = 6) -> str:
    """Write a fact, whatever JSON holds, down to some depth."""
    if isinstance(value, dict | list) and not depth:
        return "..."
    if isinstance(value, dict):
        return "; ".join(f"{name}: {_told(part, depth - 1)}" for name, part in value.items())
    if isinstance(value, list):
        return f"({', '.join(_told(part, depth - 1) for part in value)})"
    return "none" if value is None else _value(value)


def _runs(course: Course) -> Html:
    """Which profile and path were in force when."""
    rows: list[list[Text]] = []
    for i, run in enumerate(course.runs):
        times = course.time[course.run == i]
        if len(times):
            rows.append([
                run.profile.name, described(run.path), number(float(times[0]), 2), number(float(times[-1]), 2),
                str(len(times)),
            ])  # fmt: skip
    shown = table(("profile", "path", "from [s]", "to [s]", "steps"), rows[:_RUNS], words=2)
    return joined([shown, note(f"{len(rows) - _RUNS} more changes are left out.")]) if len(rows) > _RUNS else shown


def described(path: object) -> str:
    """Say what a path is."""
    try:
        values = [f"{f.name} {_value(getattr(path, f.name))}" for f in fields(path)]  # type: ignore[arg-type]
    except TypeError:
        length = getattr(path, "length", None)
        values = [] if length is None else [f"{length:.2f} m"]
    return f"{type(path).__name__}: {', '.join(values)}"


def parameter_section(m: Measures) -> Html:
    """All parameters of all profiles that ran, marked where they are not those of `paper`."""
    profiles = list(dict.fromkeys(run.profile for run in m.course.runs))
    if not profiles:
        return element("p", "No profile is known.")
    shown = profiles[:_PROFILE_COLUMNS]
    head = ("parameter", "unit", "paper", *(profile.name for profile in shown))
    paper, *others = [dict(leaves(replace(profile, name=""))) for profile in (PROFILES["paper"], *shown)]
    rows: list[list[Text]] = []
    for path in dict.fromkeys(path for values in (paper, *others) for path in values if path != "name"):
        usual, values = paper.get(path, _ABSENT), [known.get(path, _ABSENT) for known in others]
        marked: list[Text] = [_value(v) if v == usual else element("b", _value(v), "other") for v in values]
        rows.append([path, unit_of(path.rpartition(".")[2]), _value(usual), *marked])
    left_out = len(profiles) - len(shown)
    return joined([
        table(head, rows, words=2),
        note("Bold on colour: not the value of the profile paper (Table I of the paper, and what it leaves open)."),
        *([note(f"{left_out} more profiles are left out.")] if left_out > 0 else []),
    ])  # fmt: skip


def unit_of(name: str) -> str:
    """Unit of a parameter, by its name."""
    return next((unit for ending, unit in _UNITS.items() if name.endswith(ending)), "")


def _value(value: object) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, tuple | list):
        return f"({', '.join(map(_value, value))})"
    return f"{value:.6g}".replace("-", "−") if isinstance(value, float) else str(value)


def health_section(m: Measures) -> Html:
    """Units, robot interface and loop."""
    head = (
        "unit", "readings", "rate [Hz]", "lost", "latency, median [ms]", "99 % [ms]", "longest silence [s]",
        "noise [mm]", "status",
    )  # fmt: skip
    parts = [element("p", "The arm wears no unit.")]
    if m.units:
        rows = [_unit(unit) for unit in m.units]
        parts = [
            table(head, rows),
            note(
                "Of the readings that the steps were given: a unit faster than the loop is counted at the loop's rate."
                " Latency: from a measurement to the first step that had it. Noise: of distances, a steady motion"
                " left out."
            ),
        ]
    r, loop = m.robot, m.loop
    rows_of_rest: list[tuple[Text, Text]] = [
        ("robot states", f"{number(r.rate, 1)} Hz; age {_milliseconds(r.age)}"),
        ("force estimate missing", percent(r.force_missing, 1)),
        ("noise of the force estimate x y z (median of the detector's σ)", Html(vector(r.sigma, 2) + " N")),
        ("period of the loop", _milliseconds(loop.period)),
        ("late steps (by half a period or more)", str(loop.late)),
        ("steps whose inputs could not be kept", bad(str(loop.without_inputs)) if loop.without_inputs else "0"),
    ]
    return joined([*parts, facts(rows_of_rest)])


def _unit(unit: UnitHealth) -> list[Text]:
    latency = unit.latency
    status = ", ".join(f"{name} {count}" for name, count in unit.status.items()) or NOTHING
    lost = percent(unit.lost, 1)
    return [
        unit.name, str(unit.readings), number(unit.rate, 1),
        bad(lost) if unit.lost is not None and unit.lost > _LOST else lost,
        number(latency.median if latency else None, 1, 1000.0), number(latency.p99 if latency else None, 1, 1000.0),
        number(unit.silence, 2), number(unit.noise, 1, 1000.0), status,
    ]  # fmt: skip


def _milliseconds(spread: Spread | None) -> str:
    if spread is None:
        return NOTHING
    median, p99, largest = (number(value, 1, 1000.0) for value in (spread.median, spread.p99, spread.max))
    return f"median {median}, 99 % {p99}, largest {largest} ms"
