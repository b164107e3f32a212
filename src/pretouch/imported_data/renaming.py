"""Columns of other programs by our names: `tau_J_0=tau1_Nm`, or all joints at once, `tau_J_*=tau*_Nm`."""

import re
from pathlib import Path

from pretouch.errors import ParameterError, RecordingError
from pretouch.toml_files import read_toml

Mapping = tuple[tuple[str, str], ...]


def mapping_of(text: str) -> Mapping:
    """Read a mapping: pairs THEIRS=OURS separated by commas, or the name of a TOML file of such pairs.

    ParameterError for what is neither.
    """
    if text.endswith(".toml"):
        return _of_file(Path(text))
    pairs = [part.strip().rpartition("=") for part in text.split(",") if part.strip()]
    for theirs, _, ours in pairs:
        if not (theirs.strip() and ours.strip()):
            said = theirs + ours
            raise ParameterError(f"--columns has {said!r}: write THEIRS=OURS, as tau_J_0=tau1_Nm, or FILE.toml.")
    return tuple((theirs.strip(), ours.strip()) for theirs, _, ours in pairs)


def _of_file(file: Path) -> Mapping:
    try:
        data = read_toml(file)
    except OSError as error:
        raise ParameterError(f"The columns {file} cannot be read ({error.strerror}): check the file's name.") from error
    except ValueError as error:
        raise ParameterError(f'The columns {file} are no TOML ({error}): write lines "THEIRS" = "OURS".') from error
    for theirs, ours in data.items():
        if not isinstance(ours, str):
            raise ParameterError(f'The columns {file} have {theirs!r} = {ours!r}: write lines "THEIRS" = "OURS".')
    return tuple(data.items())


def renamed(place: Path, names: list[str], mapping: Mapping) -> list[str]:
    """Return columns' names with those of a mapping in place of theirs; RecordingError for one that is not there.

    `*` is the number of a joint, from 0 or 1 on: where there is a column with 0, they count from 0.
    """
    found = list(names)
    for theirs, ours in mapping:
        numbers = _numbers(names, theirs) if "*" in theirs else {names.index(theirs): ""} if theirs in names else {}
        if not numbers:
            raise RecordingError(f"{place} has no column {theirs!r} (it has {listed(names)}): change --columns.")
        first = 1 if "0" in numbers.values() else 0
        for i, number in numbers.items():
            found[i] = ours.replace("*", str(int(number) + first)) if number else ours
    return found


def _numbers(names: list[str], pattern: str) -> dict[int, str]:
    """Which columns a name with a * fits, and the number that stands for it."""
    form = re.compile(r"(\d{1,2})".join(re.escape(part) for part in pattern.split("*", 1)))
    fits = {i: form.fullmatch(name) for i, name in enumerate(names)}
    return {i: fit[1] for i, fit in fits.items() if fit}


def listed(names: list[str]) -> str:
    """Names of columns, as a part of a sentence."""
    return ", ".join(repr(name) for name in names[:8]) + (", ..." if len(names) > 8 else "")
