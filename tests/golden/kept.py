"""Steps in a file, and the first difference between two sets of them."""

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from tests.golden.fields import Values

Steps = dict[str, dict[int, Values]]
"""Name of an input -> number of a cycle -> its fields."""
Same = Callable[[np.ndarray, np.ndarray], bool]

_NONE = -1
"""In place of the number of dimensions where a step has no such field."""
_DIMENSIONS = 2


def write(path: Path, steps: Steps) -> None:
    """Keep steps as a compressed .npz: of each field all values in a row, and the shape of each."""
    names = list(next(iter(next(iter(steps.values())).values())))
    columns = {"inputs": np.array(list(steps)), "cycles": np.array([len(cycles) for cycles in steps.values()])}
    columns["cycle"] = np.array([cycle for cycles in steps.values() for cycle in cycles])
    for name in names:
        values = [values[name] for cycles in steps.values() for values in cycles.values()]
        there = [value for value in values if value is not None]
        columns[f"{name}/values"] = np.concatenate([np.zeros(0), *there] if not there else [v.ravel() for v in there])
        columns[f"{name}/shape"] = np.array([_shape(value) for value in values], np.int32)
    np.savez_compressed(path, **columns)


def _shape(value: np.ndarray | None) -> list[int]:
    if value is None:
        return [_NONE] + [0] * _DIMENSIONS
    return [value.ndim, *value.shape] + [0] * (_DIMENSIONS - value.ndim)


def read(path: Path) -> Steps:
    """Return the steps that a file keeps."""
    with np.load(path) as file:
        columns = {name: file[name] for name in file.files}
    steps: Steps = {}
    places = iter(columns["cycle"].tolist())
    for name, count in zip(columns["inputs"].tolist(), columns["cycles"].tolist(), strict=True):
        steps[name] = {next(places): {} for _ in range(count)}
    rows = [values for cycles in steps.values() for values in cycles.values()]
    for column in columns:
        name, is_field, _ = column.partition("/values")
        if is_field:
            found = _split(columns[column], columns[f"{name}/shape"])
            for values, value in zip(rows, found, strict=True):
                values[name] = value
    return steps


def _split(values: np.ndarray, shapes: np.ndarray) -> Iterator[np.ndarray | None]:
    at = 0
    for ndim, *shape in shapes.tolist():
        if ndim == _NONE:
            yield None
            continue
        size = int(np.prod(shape[:ndim], dtype=np.int64))
        yield values[at : at + size].reshape(shape[:ndim])
        at += size


def equal(one: np.ndarray, other: np.ndarray) -> bool:
    """Whether two arrays agree to the last bit, the sign of a zero included; texts by what they say."""
    if one.dtype.kind == other.dtype.kind == "U":
        return bool(np.array_equal(one, other))
    return one.dtype == other.dtype and one.shape == other.shape and one.tobytes() == other.tobytes()


def close(one: np.ndarray, other: np.ndarray, tolerance: float = 1e-12) -> bool:
    """Whether numbers differ by no more than `tolerance * max(1, |value|)`; all else has to be equal."""
    if one.dtype.kind != "f" or other.dtype.kind != "f":
        return equal(one, other)
    if one.shape != other.shape or not np.array_equal(np.isnan(one), np.isnan(other)):
        return False
    there = ~np.isnan(one) & (one != other)
    a, b = one[there], other[there]
    if not (np.isfinite(a) & np.isfinite(b)).all():
        return False
    return bool(np.all(np.abs(a - b) <= tolerance * np.maximum(1.0, np.minimum(np.abs(a), np.abs(b)))))


def first_difference(one: Steps, other: Steps, same: Same, names: tuple[str, str]) -> str:
    """Say where two sets of steps first differ: input, cycle, field and values. '' where they are the same."""
    for name in dict.fromkeys((*one, *other)):
        if name not in one or name not in other:
            return f"The input {name} is only in {names[name not in one]}."
        for cycle in sorted({*one[name], *other[name]}):
            both = one[name].get(cycle), other[name].get(cycle)
            if both[0] is None or both[1] is None:
                return f"{name}, cycle {cycle}: only in {names[both[0] is None]}."
            for field in dict.fromkeys((*both[0], *both[1])):
                said = _difference(both[0], both[1], field, same, names)
                if said:
                    return f"{name}, cycle {cycle}, {field}: {said}"
    return ""


def _difference(one: Values, other: Values, field: str, same: Same, names: tuple[str, str]) -> str:
    """Say how a field of two steps differs."""
    if field not in one or field not in other:
        return f"only in {names[field not in one]}."
    a, b = one[field], other[field]
    if (a is None and b is None) or (a is not None and b is not None and same(a, b)):
        return ""
    most = ""
    if a is not None and b is not None and a.dtype.kind == b.dtype.kind == "f" and a.shape == b.shape:
        off = np.abs(a - b)[(a != b) & ~np.isnan(a) & ~np.isnan(b)]
        most = f", at most {off.max():.3g} apart" if len(off) else ""
    shown = (np.array2string(v, threshold=12, floatmode="unique") if v is not None else "none" for v in (a, b))
    return f"{next(shown)} in {names[0]}, {next(shown)} in {names[1]}{most}."


def summary(steps: Steps) -> str:
    """How many steps, inputs and fields there are."""
    rows = [values for cycles in steps.values() for values in cycles.values()]
    return f"{len(rows)} steps of {len(steps)} inputs, {len(rows[0])} fields"
