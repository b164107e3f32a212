"""Types of sensor in a skin file: those that are known by name, and tables [sensor.NAME] of the file's own."""

from collections.abc import Iterable
from dataclasses import fields, replace
from typing import Any, cast

from pretouch.errors import ParameterError, SkinError
from pretouch.sensing.sensor import PAPER_SENSOR, Sensor

_LIKE, _OWN = "like", "own_name"


def sensor_called(name: Any, of: str, types: dict[str, Sensor]) -> Sensor:
    """Return the sensor of a type, by its name in a skin file; `of` says what has it, `types` are the file's own."""
    known = (*types, *Sensor.choices())
    if not isinstance(name, str) or name not in known:
        raise SkinError(f"{of} has the sensor {name!r}: choose from {', '.join(known)}, or describe [sensor.NAME].")
    return types[name] if name in types else cast(Sensor, Sensor.called(name)())


def sensor_tables(tables: Any) -> dict[str, Any]:
    """Return what a skin file has of its own types, by name."""
    if not isinstance(tables, dict):
        raise SkinError(f"sensor is {tables!r}: write a table [sensor.NAME] for each type of your own.")
    return tables


def own_type(name: str, table: Any) -> Sensor:
    """Return a type that a skin file describes: a type that is known, and what differs from it."""
    of = f"The type [sensor.{name}]" if name.isprintable() else f"The type {name!r}"
    if not isinstance(table, dict):
        raise SkinError(f"{of} is {table!r}: write a table [sensor.NAME].")
    like = sensor_called(table.get(_LIKE, PAPER_SENSOR.name), of, {})
    if name in Sensor.choices():
        raise SkinError(f"{of} is known by that name already: give yours another, and like = {name!r}.")
    allowed = [f.name for f in fields(like) if f.name != _OWN]
    unknown = sorted(set(table) - {_LIKE, *allowed})
    if unknown:
        raise SkinError(f"{of} has the unknown key {unknown[0]!r}: use {_LIKE}, {', '.join(allowed)}.")
    try:
        return replace(like, **{key: value for key, value in table.items() if key != _LIKE}, own_name=name)
    except ParameterError as error:
        raise SkinError(f"{of} cannot be: {error}") from error


def tables_of(sensors: Iterable[Sensor]) -> dict[str, dict[str, Any]]:
    """Return what a skin file says of types that stand in no other place: nothing where all are known by name."""
    tables = {}
    for sensor in sensors:
        if sensor.own_name:
            usual = type(sensor)()
            values = {f.name: getattr(sensor, f.name) for f in fields(sensor) if f.name != _OWN}
            tables[sensor.own_name] = {_LIKE: sensor.name} | {k: v for k, v in values.items() if v != getattr(usual, k)}
    return {"sensor": tables} if tables else {}
